"""Flat boxes that drift before a far wall: depth at pixel centres, colour as means over pixels, both in closed form."""

from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import R_BODY_OPTICAL

Floats = NDArray[np.float64]

WIDTH, HEIGHT = 200, 150
FOCAL_PX = 180.0
WALL_M = 20.0
PERIOD_US, FRAMES = 20_000, 16


@dataclass(frozen=True)
class OutlineWorld:
    """Where the colour camera is, and how the boxes are drawn.

    ``shift_px`` moves the colour image right and down; ``baseline_m`` the colour camera to the right; ``lean_dn`` is
    the amplitude of a texture that only the boxes have.
    """

    shift_px: tuple[float, float] = (0.0, 0.0)
    baseline_m: float = 0.0
    lean_dn: float = 0.0
    boxes: int = 24
    seed: int = 2

    def altered(self, **changes: object) -> "OutlineWorld":
        return replace(self, **changes)  # type: ignore[arg-type]

    def frame(self, number: int) -> tuple[Floats, Floats]:
        """Depth in m and luma in DN of one frame, (H, W) both."""
        rng = np.random.default_rng(self.seed)
        depth_m, luma = np.full((HEIGHT, WIDTH), WALL_M), np.full((HEIGHT, WIDTH), 120.0)
        nearer = np.sort(rng.uniform(3.0, 12.0, self.boxes))[::-1]
        for z_m in nearer:
            centre, half = rng.uniform((20, 15), (WIDTH - 20, HEIGHT - 15)), rng.uniform(6, 16, 2)
            drift, level = rng.uniform(-1.5, 1.5, 2), rng.uniform(40, 220)
            left, top = centre - half + number * drift
            right, bottom = centre + half + number * drift
            inside = np.outer(_inside(top, bottom, HEIGHT), _inside(left, right, WIDTH))
            depth_m = np.where(inside, z_m, depth_m)
            moved = np.array(self.shift_px) - (FOCAL_PX * self.baseline_m / z_m, 0.0)
            share = np.outer(_share(top + moved[1], bottom + moved[1], HEIGHT),
                             _share(left + moved[0], right + moved[0], WIDTH))  # fmt: skip
            texture = self.lean_dn * rng.uniform(-1, 1, (HEIGHT, WIDTH)) if self.lean_dn else 0.0
            luma = (1 - share) * luma + share * (level + texture)
        return depth_m, luma

    def write(self, path: Path, *, colour_mirrored: bool = False) -> Path:
        """Write depth and colour frames with their cameras."""
        frames = [self.frame(i) for i in range(FRAMES)]
        timestamps = PERIOD_US * np.arange(FRAMES)
        rgb = np.rint(np.clip([luma for _, luma in frames], 0, 255)).astype(np.uint8)
        with h5py.File(path, "w") as file:
            file.attrs.update({"format": "fedora", "format_version": "1.0"})
            file["path/depth"] = (1000 * np.array([depth_m for depth_m, _ in frames])).astype(np.float32)
            file["path/rgb"] = (rgb[:, :, ::-1] if colour_mirrored else rgb)[..., np.newaxis].repeat(3, axis=3)
            file["path/depth_ts"], file["path/rgb_ts"] = timestamps, timestamps
            file["metadata/depth_range"] = np.array([0.1, 30.0])
            for name, baseline_m in (("depth", 0.0), ("rgb", self.baseline_m)):
                T_body_camera = np.eye(4)
                T_body_camera[:3, :3] = R_BODY_OPTICAL
                T_body_camera[1, 3] = -baseline_m
                file.create_group(f"metadata/cameras/{name}").attrs.update({
                    "width": WIDTH, "height": HEIGHT, "T_body_camera": T_body_camera, "camera_model": "pinhole",
                    "K": [[FOCAL_PX, 0, (WIDTH - 1) / 2], [0, FOCAL_PX, (HEIGHT - 1) / 2], [0, 0, 1]],
                })  # fmt: skip
        return path


def _inside(start: float, stop: float, size: int) -> NDArray[np.bool_]:
    pixels = np.arange(size)
    inside: NDArray[np.bool_] = (pixels >= start) & (pixels < stop)
    return inside


def _share(start: float, stop: float, size: int) -> Floats:
    """Share of each pixel [i - 1/2, i + 1/2] that an interval covers."""
    borders = np.clip(np.arange(size + 1) - 0.5, start, stop)
    share: Floats = np.diff(borders)
    return share
