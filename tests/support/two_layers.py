"""Two frames of a textured disc before a textured wall, and the flow between them, with what the disc hides known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class TwoLayers:
    """A disc that moves before a wall that moves otherwise.

    Attributes
    ----------
    wall_px, disc_px
        Displacement of the wall, and of the middle of the disc, right and down.
    scale
        By how much the disc grows.
    radius_px
        Of the disc in the first frame.
    """

    wall_px: tuple[float, float]
    disc_px: tuple[float, float]
    scale: float = 1.0
    radius_px: float = 40.0
    width: int = 320
    height: int = 240

    @property
    def grid(self) -> tuple[Floats, Floats]:
        """Columns and rows (H, W) from the middle of the disc in the first frame, px."""
        columns, rows = np.meshgrid(np.arange(float(self.width)), np.arange(float(self.height)))
        return columns - self.width // 2, rows - self.height // 2

    @property
    def is_disc(self) -> NDArray[np.bool_]:
        """(H, W) which pixels of the first frame show the disc."""
        return np.hypot(*self.grid) < self.radius_px

    @property
    def flow_px(self) -> Floats:
        """(H, W, 2) from the first frame to the second, right and down."""
        x, y = self.grid
        disc = [self.disc_px[axis] + (self.scale - 1) * place for axis, place in enumerate((x, y))]
        return np.dstack([np.where(self.is_disc, disc[axis], self.wall_px[axis]) for axis in range(2)])

    @property
    def is_hidden(self) -> NDArray[np.bool_]:
        """(H, W) which pixels of the wall the disc hides in the second frame."""
        x, y = self.grid
        from_disc = (x + self.wall_px[0] - self.disc_px[0], y + self.wall_px[1] - self.disc_px[1])
        return ~self.is_disc & (np.hypot(*from_disc) < self.scale * self.radius_px)

    def frames(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return both frames (H, W, 3)."""
        x, y = self.grid
        in_disc = ((x - self.disc_px[0]) / self.scale, (y - self.disc_px[1]) / self.scale)
        second = np.where(
            np.hypot(*in_disc) < self.radius_px,
            _texture(*in_disc, seed=2),
            _texture(x - self.wall_px[0], y - self.wall_px[1], seed=1),
        )
        first = np.where(self.is_disc, _texture(x, y, seed=2), _texture(x, y, seed=1))
        one, other = (np.repeat(np.rint(frame).astype(np.uint8)[..., None], 3, axis=2) for frame in (first, second))
        return one, other


def _texture(x: Floats, y: Floats, seed: int) -> Floats:
    """Return codes of waves of 8 to 30 px in all directions, at any place: nothing is interpolated."""
    rng = np.random.default_rng(seed)
    codes = np.full(x.shape, 90.0 + 50 * seed % 100)
    for _ in range(24):
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        wave = 2 * np.pi / rng.uniform(8, 30)
        codes += 5 * np.cos(wave * (np.cos(angle) * x + np.sin(angle) * y) + phase)
    return np.clip(codes, 0, 255)
