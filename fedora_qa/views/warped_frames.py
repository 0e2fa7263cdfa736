"""The frames at both ends of a field of flow, smoothed and warped to the flow's grid, and the pixels that both show."""

from dataclasses import dataclass
from functools import cache
from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.mask import edges, flow_conflicts, inverse_depth
from fedora_qa.estimators.flow.motion_fit import fit_motion, twist_statistic
from fedora_qa.estimators.flow.residual import HALO_PX, TILE_PX, patches_of, pixels_of
from fedora_qa.estimators.flow.visibility import seen_in_both, seen_in_few_tiles
from fedora_qa.estimators.flow.warp import (
    parts_about,
    read_between,
    read_parts,
    smoothed_patches,
    smoothing_taps,
    taps_at_pixels,
)
from fedora_qa.estimators.images.luma import LUMA_ROUNDING_VARIANCE_DN2, luma_table, to_linear
from fedora_qa.estimators.images.samples import noise_variances
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_axes import AXES_AGREE, CENTRES_AGREE_M, why_not_one_lens
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_intervals import Interval, PoseTrack, frame_at, motion_over, pose_track
from fedora_qa.views.frames import smoothed_luma_dn
from fedora_qa.views.pixel_lattice import sample_field

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Mask = NDArray[np.bool_]

_CORNERS_AGREE: Final = 1e-6
"""Share of the image's width by which a corner may move between two cameras that count as the same."""

PATCH_PX: Final = TILE_PX + 2 * HALO_PX
"""Side of a tile with its halo."""

_SPLINE_REACH_PX: Final = 2
"""Half of the support of a cubic B-spline, px."""

_NO_SMOOTHING: Final = np.ones(1, np.float32)
"""Taps of no smoothing."""

_LARGEST_SHARE_IN_PARTS: Final = 0.3
"""Share of a frame's pixels up to which only the parts about the tiles are smoothed.

Beyond it the whole frame is smoothed, once for the fields of all three rates.
"""

_LARGEST_SHARE_WITHOUT_MAPS: Final = 0.05
"""Share of a frame's pixels in tiles up to which edges of the depth are computed about these tiles only.

Beyond it they are computed of the whole frame, once for the fields of all three rates. With 3.5% of 1440x1080 in tiles
a field takes 0.9 ms without maps of the frame, and 1.3 ms with its share of them. Both results are equal bit for bit.
"""

_LARGEST_CHI2_PER_DOF: Final = 10.0
"""Largest chi^2 per degree of freedom of a correction of the motion that declared noise explains."""


@dataclass(frozen=True, slots=True)
class Optics:
    """Mapping of pixels of the flow's grid to pixels of the colour frames.

    Attributes
    ----------
    H_rgb_flow
        (3, 3) homography from (column, row, 1) of the flow to that of the colour frame, px; None where it is the
        identity.
    sigma_px
        Standard deviation of the smoothing, in colour pixels, that is 1 px on the coarser of the two grids.
    """

    H_rgb_flow: Float64 | None
    sigma_px: float


def optics_of(facts: Facts) -> Optics | str:
    """Return the mapping of pixels of the flow's grid, which is that of the depth camera, to those of colour frames.

    Parameters
    ----------
    facts
        With the declared cameras ``rgb`` and ``depth``. Where either is not declared, flow and colour are taken to have
        one grid.

    Returns
    -------
    Optics or str
        A sentence that gives the reason where no homography maps the frames.
    """
    cameras = facts.declared.cameras
    rgb, depth = cameras.get("rgb"), cameras.get("depth")
    for camera in (rgb, depth):
        if camera is not None and camera.model != "pinhole":
            return f"a camera is declared as {camera.model}; the check needs pinholes"
    if rgb is None or depth is None:
        return Optics(None, 1.0)
    if reason := why_not_one_lens(rgb, depth, ("rgb", "depth")):
        return reason
    if np.abs(rgb.T_body_camera[:3, 3] - depth.T_body_camera[:3, 3]).max() > CENTRES_AGREE_M:
        return "the colour camera is not at the position of the depth camera, whose pixel grid flow uses"
    R_rgb_depth = rgb.T_body_camera[:3, :3].T @ depth.T_body_camera[:3, :3]
    if rgb.lens is not None and np.abs(R_rgb_depth - np.eye(3)).max() > AXES_AGREE:
        return "the optical axes of the colour and depth cameras differ, and their lens is distorted"
    # Homography of a pure rotation, H = K_rgb R K_depth^-1 (Hartley and Zisserman 2004, ch. 8.4): centres agree.
    H = rgb.K @ R_rgb_depth @ np.linalg.inv(depth.K)
    H_rgb_flow = H / H[2, 2]
    if (rgb.width, rgb.height) == (depth.width, depth.height):
        # Frames need no warp where three corners, in homogeneous coordinates, stay in their place.
        corners = np.array([[0, 0, 1], [depth.width, 0, 1], [0, depth.height, 1]], dtype=np.float64).T
        mapped = H_rgb_flow @ corners
        if np.abs(mapped[:2] / mapped[2] - corners[:2]).max() < _CORNERS_AGREE * depth.width:
            return Optics(None, 1.0)
    return Optics(H_rgb_flow, max(1.0, rgb.K[0, 0] / depth.K[0, 0]))


@dataclass(frozen=True, slots=True)
class FramePair:
    """The frames at both ends of an interval, to be read at positions on the flow's grid.

    Attributes
    ----------
    window
        Frames are read from it.
    optics
        Mapping of the flow's grid to the frames.
    before, after
        Rows of the colour frames at the start and at the end of the interval.
    """

    window: Window
    optics: Optics
    before: int
    after: int

    @property
    def reach_px(self) -> int:
        """Distance, colour pixels, of the farthest pixels that a value depends on: half of the taps, and the spline."""
        return len(smoothing_taps(self.optics.sigma_px)) // 2 + _SPLINE_REACH_PX

    def first(self, origins: Int64) -> Float32:
        """Return the smoothed luma of the first frame on tiles of the flow's grid with their halo.

        Parameters
        ----------
        origins
            (n, 2) first column and row of each tile, px on the flow's grid.

        Returns
        -------
        ndarray of float32
            (n, s, s) linear luma in DN, s = ``PATCH_PX``.
        """
        if self.optics.H_rgb_flow is None and self._is_read_in_parts(self.before, len(origins) * PATCH_PX**2):
            # At pixel centres the Gaussian and the B-spline are one kernel: nothing is interpolated.
            rgb, taps = self.window.rgb(self.before), taps_at_pixels(self.optics.sigma_px)
            corners = origins - HALO_PX
            return np.asarray(
                smoothed_patches(rgb, _luma_of_codes(self.window.facts.declared.transfer), taps, corners, PATCH_PX)
            )
        columns, rows = pixels_of(origins)
        return self._read(self.before, columns.astype(np.float32), rows.astype(np.float32))

    def noise_variances_dn2(self, origins: Int64) -> Float64:
        """Return the variance of noise that pixels of the first frame may hold, by tiles.

        Parameters
        ----------
        origins
            (n, 2) first column and row of each tile, px on the flow's grid.

        Returns
        -------
        ndarray of float64
            (n,) DN^2, at least that of rounding to eight bits.
        """
        rgb = self.window.rgb(self.before)
        # A square of colour pixels about the middle of each tile, moved into the frame where it would leave it.
        middles = (origins + TILE_PX // 2).astype(np.float32)
        corners = np.stack(self.on_frame(middles[:, 0], middles[:, 1]), axis=-1) - TILE_PX // 2
        inside = np.clip(np.rint(corners), 0, np.array(rgb.shape[1::-1]) - TILE_PX).astype(np.int64)
        patches = smoothed_patches(
            rgb, _luma_of_codes(self.window.facts.declared.transfer), _NO_SMOOTHING, inside, TILE_PX
        )
        return np.maximum(noise_variances(patches), LUMA_ROUNDING_VARIANCE_DN2)

    def second(self, columns: Float32, rows: Float32) -> Float32:
        """Return the smoothed luma of the second frame at positions on the flow's grid.

        Parameters
        ----------
        columns, rows
            (n, s, s) positions by tile, px; beyond the frame its border is read.

        Returns
        -------
        ndarray of float32
            (n, s, s) linear luma in DN; arbitrary where a position is NaN.
        """
        return self._read(self.after, columns, rows)

    def are_within(self, columns: Float32, rows: Float32) -> Mask:
        """Return which positions lie so far within the colour frames that nothing beyond their border is read.

        Parameters
        ----------
        columns, rows
            (n, s, s) positions by tile, px on the flow's grid.

        Returns
        -------
        ndarray of bool
            (n, s, s) False also at positions that are NaN.
        """
        # The neighbours of the gradient are a pixel of the flow's grid away.
        reach_px = self.reach_px + self.optics.sigma_px
        height, width = self.window.rgb(self.before).shape[:2]
        x, y = self.on_frame(columns, rows)
        with np.errstate(invalid="ignore"):
            inside = (x >= reach_px) & (x <= width - 1 - reach_px) & (y >= reach_px) & (y <= height - 1 - reach_px)
        return np.asarray(inside)

    def _read(self, frame: int, columns: Float32, rows: Float32) -> Float32:
        """Return the smoothed luma of a frame (by row) at positions (n, s, s) on the flow's grid."""
        columns, rows = (np.ascontiguousarray(positions) for positions in self.on_frame(columns, rows))
        rgb, taps = self.window.rgb(frame), smoothing_taps(self.optics.sigma_px)
        # Each tile needs the part of the frame about its positions, and the reach of the taps around it.
        parts = parts_about(columns, rows, rgb.shape[1], rgb.shape[0])
        sides_px = parts[:, 2:] - parts[:, :2] + len(taps) - 1
        if self._is_read_in_parts(frame, int(np.sum(sides_px[:, 0] * sides_px[:, 1]))):
            return np.asarray(
                read_parts(rgb, _luma_of_codes(self.window.facts.declared.transfer), taps, parts, columns, rows)
            )
        smoothed = smoothed_luma_dn(self.window, frame, self.optics.sigma_px)
        lines = (-1, columns.shape[-1])
        return read_between(smoothed, columns.reshape(lines), rows.reshape(lines)).reshape(columns.shape)

    def _is_read_in_parts(self, frame: int, pixels: int) -> bool:
        """Whether the parts about the tiles have few enough pixels to smooth only these."""
        return pixels < _LARGEST_SHARE_IN_PARTS * self.window.rgb(frame)[..., 0].size

    def on_frame(self, columns: Float32, rows: Float32) -> tuple[Float32, Float32]:
        """Return positions in the colour frame.

        Parameters
        ----------
        columns, rows
            Positions on the flow's grid, px, of any shape.

        Returns
        -------
        columns, rows
            Of the same shape, px of the colour frame.
        """
        H = self.optics.H_rgb_flow
        if H is None:
            return columns, rows
        # (x, y, 1) ~ H (u, v, 1): the third homogeneous coordinate is divided out.
        scale = H[2, 0] * columns + H[2, 1] * rows + H[2, 2]
        x, y = (((H[i, 0] * columns + H[i, 1] * rows + H[i, 2]) / scale).astype(np.float32) for i in range(2))
        return x, y


@cache
def _luma_of_codes(transfer: str) -> Float32:
    """Return what each 8-bit code of a channel adds to the luma of linear R, G, B: (3, 256) by channel, in DN."""
    linear_dn = to_linear(np.arange(256.0), transfer)
    return luma_table(linear_dn)


def frame_pair(window: Window, optics: Optics, interval: Interval) -> FramePair | None:
    """Return the colour frames at both ends of an interval; None where either end has none.

    Parameters
    ----------
    window
        Frames are read from it.
    optics
        Mapping of the flow's grid to colour frames.
    interval
        Of a field of flow.

    Returns
    -------
    FramePair or None
        None where an end of the interval has no frame with its timestamp.
    """
    clock = window.facts.clocks["rgb"]
    before, after = frame_at(clock, interval.start_ns), frame_at(clock, interval.end_ns)
    return None if before is None or after is None else FramePair(window, optics, before, after)


def visible(window: Window, interval: Interval, origins: Int64, fewest: int = 0) -> tuple[Mask, bool]:
    """Return which pixels of tiles both frames show.

    Depth and the camera's motion decide where the file has both. Otherwise the flow decides, which excludes fewer
    pixels.

    Parameters
    ----------
    window, interval
        A window of the sequence, and the interval of the field.
    origins
        (n, 2) first column and row of each tile, px on the flow's grid.
    fewest
        In tiles with fewer visible pixels, all pixels may be returned as invisible.

    Returns
    -------
    visible
        (n, 32, 32) by tile.
    by_depth
        Whether depth and motion decided.
    """
    geometry = geometry_of(window, interval)
    if geometry is None:
        # Pixels are invisible near a break of the flow, where they leave the image, and where points of different flow
        # meet: one of these must be occluded.
        stored = window.flow_px(interval.stream, interval.row)
        breaks, crowded = window.derived_image(_flow_conflicts, interval.row, interval.stream)
        columns, rows = pixels_of(origins, halo_px=0)
        flow_px = patches_of(stored, origins, halo_px=0)
        height, width = breaks.shape
        with np.errstate(invalid="ignore"):
            at_columns, at_rows = np.rint(columns + flow_px[..., 0]), np.rint(rows + flow_px[..., 1])
            inside = (at_columns >= 0) & (at_columns < width) & (at_rows >= 0) & (at_rows < height)
        target_rows = np.where(inside, at_rows, 0).astype(np.int64)
        target_columns = np.where(inside, at_columns, 0).astype(np.int64)
        is_free = crowded[target_rows, target_columns] == 0
        visible_by_flow = np.asarray(inside & is_free & (patches_of(breaks, origins, halo_px=0) == 0))
        return visible_by_flow, False
    K, size, motion = geometry.track.camera.K, (TILE_PX, TILE_PX), geometry.corrected
    depths_m = window.depth_m(geometry.frames[0]), window.depth_m(geometry.frames[1])
    if len(origins) * TILE_PX**2 < _LARGEST_SHARE_WITHOUT_MAPS * min(image.size for image in depths_m):
        return seen_in_few_tiles(K, motion, origins, size, depths_m, geometry.uncertainty_px, fewest), True
    # Inverse depth (1/m, 0 where invalid) and edges of both frames, which the fields of all rates share.
    first, second = (
        (window.derived_image(_inverse_depth_per_m, frame), window.derived_image(_depth_edges, frame))
        for frame in geometry.frames
    )
    return seen_in_both(K, motion, origins, size, first, second, geometry.uncertainty_px), True


def _flow_conflicts(window: Window, field: int, stream: str) -> NDArray[np.uint8]:
    return flow_conflicts(window.flow_px(stream, field))


def _inverse_depth_per_m(window: Window, frame: int) -> Float32:
    return inverse_depth(window.depth_m(frame))


def _depth_edges(window: Window, frame: int) -> NDArray[np.uint8]:
    focal_px = float(window.facts.declared.cameras["depth"].K[0, 0])
    return edges(window.derived_image(_inverse_depth_per_m, frame), focal_px)


@dataclass(frozen=True, slots=True)
class Geometry:
    """Depth frames and camera motion over an interval.

    Attributes
    ----------
    track
        Poses of the body, with the depth camera.
    motion
        How points move in the depth camera (Z forward, X right, Y down) from the start to the end of the interval, as
        declared.
    correction
        (6,) twist, rad and m, by which the flow corrects a noisy motion; zero where it does not.
    frames
        Rows of the depth frames at the start and at the end.
    uncertainty_px
        Standard deviation of a pixel's position by an uncorrected noisy motion, px; 0 otherwise.
    """

    track: PoseTrack
    motion: RigidMotion
    correction: Float64
    frames: tuple[int, int]
    uncertainty_px: float

    @property
    def corrected(self) -> RigidMotion:
        """The motion followed by its correction."""
        return self.motion.corrected(self.correction) if self.correction.any() else self.motion


def geometry_of(window: Window, interval: Interval) -> Geometry | None:
    """Return depth frames and camera motion over an interval, computed once for all checks of the window.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the result.
    interval
        Of a field of flow.

    Returns
    -------
    Geometry or None
        None where the depth camera is not declared or has a distorted lens, where an end of the interval has no depth
        frame, or where no pose covers it.
    """
    return window.derived(_geometry, interval)


def _geometry(window: Window, interval: Interval) -> Geometry | None:
    facts, camera = window.facts, window.facts.declared.cameras.get("depth")
    # The compiled loops over tiles project with K alone: with a distorted lens the flow decides what both frames show.
    if camera is None or camera.lens is not None or not {"depth", "pose"} <= facts.streams:
        return None
    frames = [frame_at(facts.clocks["depth"], time_ns) for time_ns in (interval.start_ns, interval.end_ns)]
    track = pose_track(window, camera)
    motion = motion_over(window, interval)
    if frames[0] is None or frames[1] is None or motion is None:
        return None
    correction, uncertainty_px = np.zeros(6), 0.0
    noise = facts.declared.pose
    if noise is not None and is_noisy(noise):
        # The flow corrects a noisy motion, by no more than the declared noise gives: six numbers hide no local fault.
        sigma_m, sigma_rad = noise.position_sigma_m, noise.rotation_sigma_rad
        covariance = track.covariance(interval.start_ns, interval.end_ns, sigma_m, sigma_rad)
        sample = sample_field(window, interval, frames[0])
        fit = None if sample is None else fit_motion(track.camera.K, motion, sample)
        chi2, dof = (inf, 0.0) if fit is None else twist_statistic(fit, covariance)
        if fit is not None and chi2 <= _LARGEST_CHI2_PER_DOF * dof:
            correction = fit.twist
        else:
            # A rotation by sigma rad moves a pixel by f sigma px; the trace adds the variances about all three axes.
            uncertainty_px = float(track.camera.K[0, 0] * np.sqrt(np.trace(covariance[:3, :3])))
    return Geometry(track, motion, correction, (frames[0], frames[1]), uncertainty_px)
