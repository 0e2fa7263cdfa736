"""The residual flow of one field, from the frames at both ends of its interval, by tiles.

Templates give the effect of small faults of camera, mounting and time on the flow of the tiles, from depth and motion.
"""

from dataclasses import dataclass, replace
from math import asin, ceil, hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.field_fit import MEAN, fit_field, lock_in, templates_of_flow
from fedora_qa.estimators.flow.parameter_templates import Evidence
from fedora_qa.estimators.flow.residual import (
    HALO_PX,
    TILE_PX,
    TileGrid,
    TileResiduals,
    known_patches,
    mean_derivatives,
    means_slopes_sines,
    pixels_of,
    places_of,
    tile_residuals,
)
from fedora_qa.estimators.images.luma import LUMA_ROUNDING_VARIANCE_DN2
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.so3 import cross_matrices
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_intervals import DELAY_NS, Interval, motion_over
from fedora_qa.views.frames import is_large
from fedora_qa.views.warped_frames import FramePair, geometry_of, visible

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Mask = NDArray[np.bool_]

LARGEST_FLOW_PX: Final = 1e4
"""Larger values, px, are taken as invalid."""

TEXTURED_PX: Final = 0.1
"""Largest standard error of a tile's flow by noise alone, px, for the tile to count.

Noise of variance s^2 in N pixels adds N s^2 / (16 pi) to the sum of squares G of the smoothed mean's slopes. The
estimate is too small by that share of G. With 2 s^2 / G below 0.01 px^2 and N = 1024 the share is less than 0.1. At
night, with noise of 1 DN, it would be more than 0.5.
"""

FEWEST_VALID: Final = 0.4
"""Least share of a tile's pixels that are visible in both frames."""

FEWEST_TILES: Final = 4

_OF_LARGE_FRAMES: Final = 2 / 3
"""Factor on the share of tiles that the effort asks for, in large frames.

The mean of a rate comes from the tiles of many fields; its error falls with the root of their number. The tiles differ
from field to field, so no place is left out. At 1440x1080 over 1 s, limits are 1.04 to 1.36 times as large (median
1.2); that of the worst tile of ten fields is 1.54 times as large.
"""

UNMATCHED: Final = 0.5
"""Unexplained share above which a tile's frames do not match: half of its contrast remains after the warp.

Tiles of a correct file leave up to 1%, of detail that the pixels do not resolve; unrelated ones leave 1 to 4."""

_SECOND_STEP_PX: Final = 0.5
"""Error of the flow, px, beyond which the linearisation is repeated about the corrected flow."""

_EVERY_PX: Final = 2
"""Step between the pixels, px, that give a tile's flow and its slopes: flow is smooth within a surface."""

_TEMPLATE_STRIDE_PX: Final = 8
"""Step between the pixels of a tile, px, that give the mean of a template: templates are as smooth as the flow."""

_ABOUT_OPTICAL_AXIS: Final = np.eye(6)[:, 2:3]
_NARROW: Final = 2.0
"""Trace of a rotation by 60 degrees: up to 90 degrees the sine determines the angle."""

_PERCENT, _DEG = 0.01, np.pi / 180


@dataclass(frozen=True, slots=True)
class FieldTiles:
    """Tiles of one field, and the pixels of them that may be compared.

    Attributes
    ----------
    origins
        (n, 2) first column and row of each tile, px.
    flow_px
        (n, 36, 36, 2) patches of the flow (u right, v down) with their halo, px, finite.
    usable
        (n, 32, 32) pixels that both frames show and whose flow is valid.
    noise_dn2
        (n,) variance of the noise in the pixels of the frames, DN^2. It includes texture of one pixel's size.
    by_depth
        Whether depth and motion decided which pixels both frames show, so that every tile must match.
    """

    origins: Int64
    flow_px: Float32
    usable: Mask
    noise_dn2: Float64
    by_depth: bool

    def residuals(self, frames: FramePair, extra_px: Float64 | None = None) -> TileResiduals:
        """Warp the second frame back by the flow and estimate the residual flow of each tile.

        Parameters
        ----------
        frames
            The frames at both ends of the interval.
        extra_px
            (n, 2) error of the flow (u, v) that is subtracted before the warp, px; zero if None.

        Returns
        -------
        TileResiduals
            Residual flow of the n tiles, px; its noise covariances are scaled to the noise of each tile.
        """
        less_px = np.zeros(self.origins.shape) if extra_px is None else extra_px
        warped = frames.second(*places_of(self.flow_px, self.origins, HALO_PX, less_px.astype(np.float32)))
        estimated = tile_residuals(frames.first(self.origins), warped, self.usable, LUMA_ROUNDING_VARIANCE_DN2)
        noisier = self.noise_dn2 / LUMA_ROUNDING_VARIANCE_DN2
        return replace(estimated, noise_covariances_px2=estimated.noise_covariances_px2 * noisier[:, None, None])

    def chosen(self, mask: Mask) -> "FieldTiles":
        """Return the tiles for which ``mask`` (n,) is True."""
        return FieldTiles(
            self.origins[mask], self.flow_px[mask], self.usable[mask], self.noise_dn2[mask], self.by_depth
        )


@dataclass(frozen=True, slots=True)
class FieldResidual:
    """Residual flow of one field, from its tiles.

    Attributes
    ----------
    interval
        Of the field.
    frame
        Row of the colour frame at the start of the interval.
    tiles, textured, unmatched
        Numbers of tiles that were read, of tiles with texture, and of textured tiles whose frames do not match.
    mean_px, mean_error_px
        Mean residual flow (u, v) and its formal standard error, px; NaN where too few tiles match.
    spread, freedom
        Mean square of the tiles' deviations from the mean over their formal errors, and its degrees of freedom.
    mean_locking
        Change of the mean, px, by a bias of 1 px times the sine of 2 pi times the flow.
    evidence
        Normal equations of the templates; None where too few tiles match.
    least_matched, least_matched_tile
        Largest unexplained share of a textured tile, and that tile (left, top, right, bottom, px); None unless depth
        decided which pixels both frames show.
    worst_tile, worst_px, worst_error_px
        The matched tile (left, top, right, bottom, px) with the largest ratio of its deviation from the field's mean to
        the error of that; both in px.
    tiles_of_field
        Number of all tiles of the field, read or not.
    tile_errors_px
        Lowest and highest standard error of a matched tile, px: in its best and in its worst determined direction.
    """

    interval: Interval
    frame: int
    tiles: int
    textured: int
    unmatched: int
    mean_px: tuple[float, float] = (float("nan"), float("nan"))
    mean_error_px: tuple[float, float] = (float("nan"), float("nan"))
    spread: float = float("nan")
    freedom: int = 0
    mean_locking: float = 1.0
    evidence: Evidence | None = None
    least_matched: float = 0.0
    least_matched_tile: tuple[int, int, int, int] | None = None
    worst_tile: tuple[int, int, int, int] | None = None
    worst_px: float = 0.0
    worst_error_px: float = 0.0
    tiles_of_field: int = 0
    tile_errors_px: tuple[float, float] = (float("nan"), float("nan"))

    @property
    def unmatched_share(self) -> float:
        """Share of the textured tiles whose frames do not match."""
        return self.unmatched / self.textured if self.textured else 0.0


def sample_tiles(frames: FramePair, interval: Interval, share: float) -> FieldTiles | None:
    """Choose tiles of a field and the pixels of them that may be compared; None where the image has no tile.

    Parameters
    ----------
    frames
        The frames at both ends of the interval.
    interval
        Of the field.
    share
        Share of the field's tiles that is taken, 0 to 1.

    Returns
    -------
    FieldTiles or None
        None where the image has no tile.
    """
    stored = frames.window.flow_px(interval.stream, interval.row)
    origins = _sampled(stored, interval, share)
    if not len(origins):
        return None
    visible_pixels, by_depth = visible(frames.window, interval, origins)
    return _tiles_at(frames, stored, origins, visible_pixels, by_depth=by_depth)


def _sampled(stored: Float32, interval: Interval, share: float) -> Int64:
    """Return the origins (n, 2) of a share of a field's tiles, others for each field; none where the image has none."""
    grid = TileGrid.of(*stored.shape[:2])
    if not len(grid.origins):
        return grid.origins
    return grid.sample(share, int(flow_rate_hz(interval.stream)), interval.row)


def _tiles_at(
    frames: FramePair, stored: Float32, origins: Int64, visible_pixels: Mask, *, by_depth: bool
) -> FieldTiles:
    flow_px, is_valid = known_patches(stored, origins, TILE_PX, HALO_PX, LARGEST_FLOW_PX)
    usable = is_valid & visible_pixels
    if frames.optics.H_rgb_flow is not None:
        # The colour camera may see less than the depth camera, on whose grid flow lies.
        columns, rows = (places.astype(np.float32) for places in pixels_of(origins, halo_px=0))
        u_px, v_px = np.moveaxis(flow_px[:, HALO_PX:-HALO_PX, HALO_PX:-HALO_PX], -1, 0)
        usable &= frames.are_within(columns, rows) & frames.are_within(columns + u_px, rows + v_px)
    return FieldTiles(origins, flow_px, usable, frames.noise_variances_dn2(origins), by_depth)


def textured(residuals: TileResiduals) -> Mask:
    """Return which tiles (n,) determine their flow: enough valid pixels, and enough texture for their noise."""
    of_u, of_v, both = (residuals.noise_covariances_px2[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1)))
    # Along an edge one direction is undetermined: the least determined direction decides (aperture problem).
    worst_variance = 0.5 * (of_u + of_v) + np.hypot(0.5 * (of_u - of_v), both)  # the larger eigenvalue
    return np.asarray((worst_variance < TEXTURED_PX**2) & (residuals.valid_share >= FEWEST_VALID))


def measure_field(frames: FramePair, interval: Interval, share: float) -> FieldResidual | None:
    """Measure the residual flow of a share of a field's tiles.

    Tiles of which too few pixels are visible are only counted.

    Parameters
    ----------
    frames
        The frames at both ends of the interval.
    interval
        Of the field.
    share
        Share of the field's tiles that is taken, 0 to 1; large frames take ``_OF_LARGE_FRAMES`` of it.

    Returns
    -------
    FieldResidual or None
        None where the image has no tile.
    """
    window, stored = frames.window, frames.window.flow_px(interval.stream, interval.row)
    is_thinned = is_large(stored.shape[0] * stored.shape[1], window)
    origins = _sampled(stored, interval, _OF_LARGE_FRAMES * share if is_thinned else share)
    if not len(origins):
        return None
    tiles_of_field = len(TileGrid.of(*stored.shape[:2]).origins)
    fewest = ceil(FEWEST_VALID * TILE_PX**2)
    visible_pixels, by_depth = visible(window, interval, origins, fewest)
    enough = np.count_nonzero(visible_pixels.reshape(len(origins), -1), axis=1) >= fewest
    if not enough.any():
        return FieldResidual(interval, frames.before, len(origins), 0, 0, tiles_of_field=tiles_of_field)
    tiles = _tiles_at(frames, stored, origins[enough], visible_pixels[enough], by_depth=by_depth)
    residuals = tiles.residuals(frames)
    is_textured = textured(residuals)
    matched = is_textured & (residuals.unexplained < UNMATCHED)
    errors_px, covariances_px2 = residuals.flow_errors_px, residuals.covariances_px2
    far = matched & (np.abs(errors_px).max(axis=1) > _SECOND_STEP_PX)
    if far.any():
        # The linearisation holds near the true flow only: it is repeated about the corrected flow.
        relinearised = tiles.residuals(frames, np.where(far[:, None], errors_px, 0.0))
        # A second step from a wrong match may diverge: it counts only where the frames then match better.
        better = far & (relinearised.unexplained < residuals.unexplained)
        errors_px = errors_px + np.where(better[:, None], relinearised.flow_errors_px, 0.0)
        covariances_px2 = np.where(better[:, None, None], relinearised.covariances_px2, covariances_px2)
    counts = FieldResidual(
        interval, frames.before, len(origins), int(np.count_nonzero(is_textured)),
        int(np.count_nonzero(is_textured & ~matched)), tiles_of_field=tiles_of_field,
    )  # fmt: skip
    if tiles.by_depth and is_textured.any():
        least = int(np.argmax(np.where(is_textured, residuals.unexplained, -1.0)))
        counts = replace(
            counts,
            least_matched=float(residuals.unexplained[least]),
            least_matched_tile=_tile_at(tiles.origins[least]),
        )
    if np.count_nonzero(matched) < FEWEST_TILES:
        return counts
    tiles = tiles if matched.all() else tiles.chosen(matched)
    geometric = tile_templates(window, interval, tiles.origins, tiles.usable)
    templates = templates_of_flow(*means_slopes_sines(tiles.flow_px, tiles.usable, HALO_PX, _EVERY_PX), geometric)
    errors_px = errors_px[matched]
    fit = fit_field(errors_px, covariances_px2[matched], templates)
    worst = int(np.argmax(fit.deviations))
    worst_px = float(np.linalg.norm(errors_px[worst] - fit.mean_px))
    variances_px2 = np.linalg.eigvalsh(covariances_px2[matched])
    return replace(
        counts,
        mean_px=(float(fit.mean_px[0]), float(fit.mean_px[1])),
        mean_error_px=(float(fit.mean_error_px[0]), float(fit.mean_error_px[1])),
        spread=fit.spread,
        freedom=fit.freedom,
        mean_locking=float(lock_in(fit.evidence, MEAN).max()),
        evidence=fit.evidence,
        worst_tile=_tile_at(tiles.origins[worst]),
        worst_px=worst_px,
        worst_error_px=worst_px / max(float(fit.deviations[worst]), 1e-12),
        tile_errors_px=(float(np.sqrt(variances_px2.min())), float(np.sqrt(variances_px2.max()))),
    )


def _tile_at(origin: Int64) -> tuple[int, int, int, int]:
    left, top = (int(side) for side in origin)
    return left, top, left + TILE_PX, top + TILE_PX


def tile_templates(window: Window, interval: Interval, origins: Int64, usable: Mask) -> Float64 | None:
    """Return how small faults of camera, mounting and time would change the flow of tiles.

    Parameters
    ----------
    window, interval
        A window of the sequence, and the interval of the field.
    origins
        (n, 2) left and top of the tiles, px on the flow's grid.
    usable
        (n, 32, 32) pixels that count.

    Returns
    -------
    ndarray of float64 or None
        (n, 2, 8), columns as in ``GEOMETRIC``: stored minus true flow, px per unit of a fault in the generation of the
        flow. The same fault of a declaration has the opposite sign. None where depth or motion is not known. The
        template of time, a difference of poses 2 ms apart, is zero where poses are noisy.
    """
    geometry = geometry_of(window, interval)
    if geometry is None:
        return None
    motion = geometry.corrected
    depth_m = window.depth_m(geometry.frames[0])
    K, stride_px = geometry.track.camera.K, _TEMPLATE_STRIDE_PX
    derivatives = mean_derivatives(depth_m, origins, usable, stride_px // 2, stride_px, K, motion.R, motion.t_m)
    by_twist, by_focal, by_centre = derivatives[..., :6], derivatives[..., 6:7], derivatives[..., 7:]
    # Derivative of the motion by time, as a twist per interval, by a central difference; zero where it is not known.
    by_time = np.zeros((6, 1))
    if not is_noisy(window.facts.declared.pose):
        later, earlier = (motion_over(window, interval.moved(by)) for by in (DELAY_NS, -DELAY_NS))
        if later is not None and earlier is not None:
            by_time = _twist_between(earlier, later)[:, None] * (interval.length_ns / (2 * DELAY_NS))
    twists = np.concatenate((by_mounting(motion), by_time, _ABOUT_OPTICAL_AXIS), axis=1)
    # Units of the columns: 1 degree about X, Y, Z of the mounting, 1% of the interval, 1 degree about the optical axis.
    twists *= np.array([_DEG, _DEG, _DEG, _PERCENT, _DEG])
    return np.concatenate((_PERCENT * by_focal, by_centre, by_twist @ twists), axis=2)


def by_mounting(motion: RigidMotion) -> Float64:
    """Return the twists by which a camera's motion changes as the camera is turned about its axes.

    Turned by w, points move by ``Exp(w)^T (R, t) Exp(w)``, which is the motion followed by the twist
    ``(R w - w, t x R w)``.

    Parameters
    ----------
    motion
        Of points in the camera frame (Z forward, X right, Y down).

    Returns
    -------
    ndarray of float64
        (6, 3) per rad about X, Y and Z: rotation in rad, translation in m.
    """
    return np.concatenate((motion.R - np.eye(3), cross_matrices(motion.t_m) @ motion.R))


def _twist_between(motion: RigidMotion, other: RigidMotion) -> Float64:
    """Return ``motion.twist_from(other)`` (6,), in a tenth of the time where the rotation between them is small.

    By Rodrigues' formula a rotation less its reverse is twice its sine times its axis.
    """
    dR = motion.R @ other.R.T
    if dR[0, 0] + dR[1, 1] + dR[2, 2] < _NARROW:
        return motion.twist_from(other)
    # Rodrigues: R - R^T = 2 sin(angle) [axis]x.
    x, y, z = 0.5 * (dR[2, 1] - dR[1, 2]), 0.5 * (dR[0, 2] - dR[2, 0]), 0.5 * (dR[1, 0] - dR[0, 1])
    sine = min(hypot(x, y, z), 1.0)
    scale = asin(sine) / sine if sine > 0 else 1.0
    return np.concatenate(((scale * x, scale * y, scale * z), motion.t_m - dR @ other.t_m))
