"""What a field of flow is held against: two smoothed frames on the flow's own grid, and the pixels that both show."""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.mask import edges, flow_conflicts, inverse_depth
from fedora_qa.estimators.flow.motion_fit import fit_motion, twist_statistic
from fedora_qa.estimators.flow.residual import HALO_PX, TILE_PX
from fedora_qa.estimators.flow.tiles import patches_of, pixels_of
from fedora_qa.estimators.flow.visibility import seen_in_both, seen_in_few_tiles
from fedora_qa.estimators.flow.warp import (
    parts_about,
    read_between,
    read_parts,
    smooth,
    smoothed_patches,
    smoothing_taps,
    taps_at_pixels,
)
from fedora_qa.estimators.images.luma import LUMA_ROUNDING_VARIANCE_DN2, luma_table
from fedora_qa.estimators.images.samples import noise_variances
from fedora_qa.estimators.images.transfer import to_linear
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_motion import motion_over
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_intervals import Interval, PoseTrack, frame_at, pose_track
from fedora_qa.views.luma import luma_dn
from fedora_qa.views.pixel_lattice import sample_field

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Mask = NDArray[np.bool_]

_SAME: Final = 1e-6
"""Pixels, or metres, by which two cameras may differ and still be one."""

PATCH_PX: Final = TILE_PX + 2 * HALO_PX
"""Side of a tile with its halo."""

_AS_IT_IS: Final = np.ones(1, np.float32)
"""Weights that smooth nothing."""

_IN_PARTS: Final = 0.3
"""Share of a frame up to which only the parts that are asked for are made: what is made of all serves three rates."""

_FEW: Final = 0.05
"""Share of a frame's pixels in tiles up to which edges of the depth are looked for about these only.

Maps of a whole frame serve three rates. With 3.5% of 1440x1080 in tiles a field takes 0.9 ms without them, and 1.3 ms
with its part of them: both say the same, to the bit.
"""

_PLAUSIBLE: Final = 10.0
"""A correction of the pose of up to so many times its expected square is believed when pixels are masked."""


@dataclass(frozen=True, slots=True)
class Optics:
    """How the colour camera sees the flow's grid: ``H_rgb_flow`` (3, 3) maps pixels; None where they are the same.

    ``sigma_px`` is the smoothing in colour pixels that is 1 px on the coarser of the two grids.
    """

    H_rgb_flow: Float64 | None
    sigma_px: float


def optics_of(facts: Facts) -> Optics | str:
    """Return how colour frames map onto the flow's grid, or why they cannot be mapped."""
    cameras = facts.declared.cameras
    rgb, depth = cameras.get("rgb"), cameras.get("depth")
    for camera in (rgb, depth):
        if camera is not None and camera.model != "pinhole":
            return f"a camera is declared as {camera.model}, and only a pinhole is modelled"
    if rgb is None or depth is None:
        return Optics(None, 1.0)
    if np.abs(rgb.T_body_camera[:3, 3] - depth.T_body_camera[:3, 3]).max() > _SAME:
        return "the colour camera sits elsewhere than the depth camera, on whose grid flow lies"
    R_rgb_depth = rgb.T_body_camera[:3, :3].T @ depth.T_body_camera[:3, :3]
    # Homography of a pure rotation, H = K_rgb R K_depth^-1 (Hartley and Zisserman 2004, ch. 8.4): centres agree.
    H = rgb.K @ R_rgb_depth @ np.linalg.inv(depth.K)
    if (rgb.width, rgb.height) == (depth.width, depth.height) and _moves_nothing(H / H[2, 2], depth):
        return Optics(None, 1.0)
    return Optics(H / H[2, 2], max(1.0, rgb.K[0, 0] / depth.K[0, 0]))


def _moves_nothing(H: Float64, camera: Camera) -> bool:
    corners = np.array([[0, 0, 1], [camera.width, 0, 1], [0, camera.height, 1]], dtype=np.float64).T
    moved = H @ corners
    return bool(np.abs(moved[:2] / moved[2] - corners[:2]).max() < _SAME * camera.width)


@dataclass(frozen=True, slots=True)
class FramePair:
    """The frames at both ends of an interval, by row, seen through the optics."""

    window: Window
    optics: Optics
    before: int
    after: int

    def first(self, origins: Int64) -> Float32:
        """Return patches of the first frame on tiles of the flow's grid with their halo, (n, s, s)."""
        if self.optics.H_rgb_flow is None and self._in_parts(self.before, len(origins) * PATCH_PX**2):
            rgb, taps = self.window.rgb(self.before), taps_at_pixels(self.optics.sigma_px)
            corners = origins - HALO_PX
            return np.asarray(
                smoothed_patches(rgb, _luma_of_codes(self.window.facts.declared.transfer), taps, corners, PATCH_PX)
            )
        columns, rows = pixels_of(origins)
        return self._read(self.before, columns.astype(np.float32), rows.astype(np.float32))

    def noise_variances_dn2(self, origins: Int64) -> Float64:
        """Return the variance (n,) of noise that pixels of the first frame may hold, by tiles of the flow, DN^2."""
        rgb = self.window.rgb(self.before)
        middles = (origins + TILE_PX // 2).astype(np.float32)
        corners = np.stack(self._on_frame(middles[:, 0], middles[:, 1]), axis=-1) - TILE_PX // 2
        inside = np.clip(np.rint(corners), 0, np.array(rgb.shape[1::-1]) - TILE_PX).astype(np.int64)
        patches = smoothed_patches(rgb, _luma_of_codes(self.window.facts.declared.transfer), _AS_IT_IS, inside, TILE_PX)
        return np.maximum(noise_variances(patches), LUMA_ROUNDING_VARIANCE_DN2)

    def second(self, columns: Float32, rows: Float32) -> Float32:
        """Return the second frame at positions (n, s, s) on the flow's grid; NaN positions read anything."""
        return self._read(self.after, columns, rows)

    def _read(self, frame: int, columns: Float32, rows: Float32) -> Float32:
        """Read a frame at positions (n, s, s): of the parts about them, or where these are large of all of it."""
        columns, rows = (np.ascontiguousarray(places) for places in self._on_frame(columns, rows))
        rgb, taps = self.window.rgb(frame), smoothing_taps(self.optics.sigma_px)
        parts = parts_about(columns, rows, rgb.shape[1], rgb.shape[0])
        sides = parts[:, 2:] - parts[:, :2] + len(taps) - 1
        if self._in_parts(frame, int(np.sum(sides[:, 0] * sides[:, 1]))):
            return np.asarray(
                read_parts(rgb, _luma_of_codes(self.window.facts.declared.transfer), taps, parts, columns, rows)
            )
        flat = (-1, columns.shape[-1])
        sigma_px = self.optics.sigma_px
        smoothed = self.window.of_image("smooth luma", frame, lambda: smooth(luma_dn(self.window, frame), sigma_px))
        return read_between(smoothed, columns.reshape(flat), rows.reshape(flat)).reshape(columns.shape)

    def _in_parts(self, frame: int, pixels: int) -> bool:
        """Whether so many pixels of a frame are few enough to make only these."""
        return pixels < _IN_PARTS * self.window.rgb(frame)[..., 0].size

    def _on_frame(self, columns: Float32, rows: Float32) -> tuple[Float32, Float32]:
        """Return positions on the colour frame of positions on the flow's grid."""
        H = self.optics.H_rgb_flow
        if H is None:
            return columns, rows
        scale = H[2, 0] * columns + H[2, 1] * rows + H[2, 2]
        x, y = (((H[i, 0] * columns + H[i, 1] * rows + H[i, 2]) / scale).astype(np.float32) for i in range(2))
        return x, y


@cache
def _luma_of_codes(transfer: str) -> Float32:
    """Return what each code (3, 256) of a channel adds to the luma of linear R, G, B, in DN."""
    linear_dn = to_linear(np.arange(256.0), transfer)
    return luma_table(linear_dn)


def frame_pair(window: Window, optics: Optics, interval: Interval) -> FramePair | None:
    """Return the frames at both ends of an interval; None where either end has none."""
    clock = window.facts.clocks["rgb"]
    before, after = frame_at(clock, interval.start_ns), frame_at(clock, interval.end_ns)
    return None if before is None or after is None else FramePair(window, optics, before, after)


def visible(window: Window, interval: Interval, origins: Int64, fewest: int = 0) -> tuple[Mask, bool]:
    """Return which pixels of tiles (n, 32, 32) both frames show, and whether they follow from depth and motion.

    From depth and motion where both are there; otherwise from the flow itself, which is weaker. Tiles of which surely
    fewer than the ``fewest`` pixels are shown may be left empty.
    """
    geometry = geometry_of(window, interval)
    if geometry is None:
        stored = window.flow_px(interval.stream, interval.row)
        breaks, crowded = flow_conflicts(stored)
        columns, rows = pixels_of(origins, halo_px=0)
        flow_px = patches_of(stored, origins, halo_px=0)
        height, width = breaks.shape
        with np.errstate(invalid="ignore"):
            at_columns, at_rows = np.rint(columns + flow_px[..., 0]), np.rint(rows + flow_px[..., 1])
            inside = (at_columns >= 0) & (at_columns < width) & (at_rows >= 0) & (at_rows < height)
        there = crowded[np.where(inside, at_rows, 0).astype(np.int64), np.where(inside, at_columns, 0).astype(np.int64)]
        visible_by_flow = np.asarray(inside & (there == 0) & (patches_of(breaks, origins, halo_px=0) == 0))
        return visible_by_flow, False
    K, size, motion = geometry.track.camera.K, (TILE_PX, TILE_PX), geometry.corrected
    depths_m = window.depth_m(geometry.frames[0]), window.depth_m(geometry.frames[1])
    if len(origins) * TILE_PX**2 < _FEW * min(image.size for image in depths_m):
        return seen_in_few_tiles(K, motion, origins, size, depths_m, geometry.uncertainty_px, fewest), True
    first, second = ((_inverse_depth(window, frame), _edges(window, frame)) for frame in geometry.frames)
    return seen_in_both(K, motion, origins, size, first, second, geometry.uncertainty_px), True


@dataclass(frozen=True, slots=True)
class Geometry:
    """What follows from depth and poses over an interval.

    Attributes
    ----------
    motion, correction
        As declared, and the twist (6,) by which the flow corrects a noisy motion.
    frames
        The depth frames at both ends, by row.
    uncertainty_px
        How far the corrected motion may still misplace a pixel.
    """

    track: PoseTrack
    motion: RigidMotion
    correction: Float64
    frames: tuple[int, int]
    uncertainty_px: float

    @property
    def corrected(self) -> RigidMotion:
        """The motion with its correction."""
        return self.motion.corrected(self.correction) if self.correction.any() else self.motion


def geometry_of(window: Window, interval: Interval) -> Geometry | None:
    """Return what depth and poses say of an interval; None where either does not cover it. Kept for the window."""
    return window.once(("geometry", interval), lambda: _geometry(window, interval))


def _geometry(window: Window, interval: Interval) -> Geometry | None:
    facts, camera = window.facts, window.facts.declared.cameras.get("depth")
    if camera is None or not {"depth", "pose"} <= facts.streams:
        return None
    frames = [frame_at(facts.clocks["depth"], time_ns) for time_ns in (interval.start_ns, interval.end_ns)]
    track = pose_track(window, camera)
    motion = motion_over(window, track, interval)
    if frames[0] is None or frames[1] is None or motion is None:
        return None
    correction, uncertainty_px = _correction(window, track, interval, frames[0], motion)
    return Geometry(track, motion, correction, (frames[0], frames[1]), uncertainty_px)


def _correction(
    window: Window, track: PoseTrack, interval: Interval, frame: int, motion: RigidMotion
) -> tuple[Float64, float]:
    """Correct a noisy motion by the flow, where that takes no more than the noise; six numbers hide no local fault."""
    noise = window.facts.declared.pose
    if noise is None or not is_noisy(noise):
        return np.zeros(6), 0.0
    covariance = track.covariance(interval.start_ns, interval.end_ns, noise.position_sigma_m, noise.rotation_sigma_rad)
    sample = sample_field(window, interval, frame)
    fit = None if sample is None else fit_motion(track.camera.K, motion, sample)
    if fit is not None:
        chi2, dof = twist_statistic(fit, covariance)
        if chi2 <= _PLAUSIBLE * dof:
            return fit.twist, 0.0
    # A rotation error of sigma rad moves a pixel by f sigma px; the trace adds the variances of all three axes.
    return np.zeros(6), float(track.camera.K[0, 0] * np.sqrt(np.trace(covariance[:3, :3])))


def _inverse_depth(window: Window, frame: int) -> Float32:
    """Return 1 / depth (H, W) of a frame, 1/m, 0 where invalid; kept for the window."""
    return window.of_image("inverse depth", frame, lambda: inverse_depth(window.depth_m(frame)))


def _edges(window: Window, frame: int) -> NDArray[np.uint8]:
    focal_px = float(window.facts.declared.cameras["depth"].K[0, 0])
    return window.of_image("depth edges", frame, lambda: edges(_inverse_depth(window, frame), focal_px))
