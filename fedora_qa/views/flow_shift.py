"""The shift of stored flow against the one of depth and pose, of single fields and of all of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.shift_fit import ShiftFit, ShiftSample, fit_shift
from fedora_qa.geometry.rigid_flow import moved_points, rigid_flow, rounding_px, twist_jacobian
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_comparison import field_covariance
from fedora_qa.views.flow_intervals import Interval, PoseTrack
from fedora_qa.views.flow_parameter_fit import FlowParameterFit
from fedora_qa.views.pixel_lattice import FEWEST_PIXELS, Region
from fedora_qa.views.static_depth import static_depth_m

Float64 = NDArray[np.float64]

_PIXELS: Final = 4000
"""Pixels that a shift is fitted to: some hundred lie on smooth surfaces even where most of an image is foliage."""

_SIGNIFICANT: Final = 3.0
"""Least length of a shift, in its standard errors: chance exceeds it in 1% of fits of two components, exp(-9 / 2). It
proposes a cause and raises no alarm. Under another fault each field imitates a shift of its own."""

_LINEARISATIONS: Final = 4
"""Fits of a shift about poses that are corrected by the fit before: a correction turns the flow by parts of a pixel."""


@dataclass(frozen=True, slots=True)
class FieldShift:
    """The shift of one field.

    Attributes
    ----------
    rate
        Stream of the field, ``flow/<rate>hz``.
    fit
        Px, to the right and down.
    """

    rate: str
    fit: ShiftFit


def shift_of_field(
    window: Window, track: PoseTrack, interval: Interval, frame: int, region: Region | None = None
) -> FieldShift | None:
    """Fit the shift of a field together with the correction that the declared pose noise permits.

    Parameters
    ----------
    window
        A window of the sequence.
    track
        Poses, with the depth camera.
    interval
        Of the field.
    frame
        Row of the depth frame at the start of the interval.
    region
        Left, top, right, bottom, px, of the deviating part of the image; the whole image if None.

    Returns
    -------
    FieldShift or None
        None where static depth or the motion is not known, and where the field does not determine a shift.
    """
    depth_m, flow_px = static_depth_m(window, frame), window.flow_px(interval.stream, interval.row)
    motion = track.motion(interval.start_ns, interval.end_ns)
    if depth_m is None or depth_m.shape != flow_px.shape[:2] or motion is None:
        return None
    K, lens = track.camera.K, track.camera.lens
    height, width = depth_m.shape
    columns = np.arange(width, dtype=np.float64)[None, :]
    rows = np.arange(height, dtype=np.float64)[:, None]
    depths_m = np.where(depth_m > 0, depth_m, np.nan).astype(np.float64)
    compared = np.isfinite(depths_m) & np.isfinite(flow_px).all(axis=-1)
    if region is not None:
        left, top, right, bottom = region
        compared &= (columns >= left) & (columns < right) & (rows >= top) & (rows < bottom)
    pixels = np.flatnonzero(compared)
    if len(pixels) < FEWEST_PIXELS:
        return None
    row, column = np.unravel_index(pixels[:: max(1, len(pixels) // _PIXELS)], depth_m.shape)
    places = (column.astype(np.float64), row.astype(np.float64), depths_m[row, column])
    stored_px = flow_px[row, column].astype(np.float64)
    bounds_px = rounding_px(K, motion, *places, stored_px, lens=lens)
    if not np.isfinite(bounds_px).any():
        return None
    sigma_px = float(np.median(bounds_px[np.isfinite(bounds_px)]))
    covariance = field_covariance(track, interval, window.facts.declared.pose)
    # S = L L^T: a twist of covariance S is L times independent variables.
    eigenvalues, directions = np.linalg.eigh(np.zeros((0, 0)) if covariance is None else covariance)
    L = directions * np.sqrt(np.maximum(eigenvalues, 0.0))
    variables, fit = np.zeros(len(L)), None
    for _ in range(_LINEARISATIONS if len(L) else 1):
        corrected = motion.corrected(L @ variables) if len(L) else motion
        recomputed_px = rigid_flow(K, corrected, columns, rows, depths_m, lens)
        effects_px = np.zeros((len(row), 2, 0))
        if len(L):
            effects_px = twist_jacobian(K, np.stack(moved_points(K, corrected, *places, lens), axis=-1), lens) @ L
        fit = fit_shift(ShiftSample(column, row, stored_px, recomputed_px, effects_px, variables, sigma_px))
        if fit is None:
            return None
        variables = fit.variables
    return None if fit is None else FieldShift(interval.stream, fit)


def common_shift(shifts: Sequence[FieldShift]) -> FlowParameterFit | None:
    """Return the weighted mean shift of some fields; None without fields, and where they do not share one.

    Whether flow was resampled is the same in all fields: what that changes does not decrease with their number, and
    counts as a standard error. Fields that scatter by more than their own errors enlarge it.
    """
    if not shifts:
        return None
    fits = [shift.fit for shift in shifts]
    squares_px2 = [fit.covariance_px2 + np.outer(fit.resampling_px, fit.resampling_px) for fit in fits]
    weights = np.array([1.0 / np.trace(square) for square in squares_px2])
    weights /= weights.sum()
    shift_px = np.sum([weight * fit.shift_px for weight, fit in zip(weights, fits, strict=True)], axis=0)
    resampling_px = np.sum([weight * fit.resampling_px for weight, fit in zip(weights, fits, strict=True)], axis=0)
    covariance_px2 = np.sum([w**2 * fit.covariance_px2 for w, fit in zip(weights, fits, strict=True)], axis=0)
    covariance_px2 += np.outer(resampling_px, resampling_px)
    if len(fits) > 1:
        differences = [fit.shift_px - shift_px for fit in fits]
        # chi^2 of two components a field, less the two of the mean.
        chi2 = sum(float(d @ np.linalg.pinv(square) @ d) for d, square in zip(differences, squares_px2, strict=True))
        covariance_px2 *= max(1.0, chi2 / (2 * (len(fits) - 1)))
    length_px = float(np.hypot(*shift_px))
    size_px = float(np.copysign(length_px, shift_px[np.argmax(np.abs(shift_px))]))
    # The variance along the shift: d^T C d / |d|^2.
    error_px = float(np.sqrt(shift_px @ covariance_px2 @ shift_px)) / length_px if length_px > 0 else 0.0
    if length_px <= _SIGNIFICANT * error_px:
        return None
    return FlowParameterFit(
        "spatial_offset",
        size_px,
        "px",
        error_px,
        float(np.mean([fit.removed_share_of_all for fit in fits])),
        tuple(float(component) for component in shift_px),
        float(np.mean([fit.removed_share for fit in fits])),
    )
