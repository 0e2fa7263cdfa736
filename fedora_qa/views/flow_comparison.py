"""Stored flow against the flow recomputed from depth and pose: its deviation, its shift, and fit features."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M, NS_PER_S
from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.flow.motion_fit import FlowSample, MotionFit, fit_most, fit_motion, twist_statistic
from fedora_qa.estimators.flow.parameter_templates import Evidence, parameter_templates, weigh_templates
from fedora_qa.estimators.flow.shift_fit import ShiftFit, ShiftSample, fit_shift
from fedora_qa.features import Feature
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.rigid_flow import moved_points, rigid_flow, rounding_px, twist_jacobian
from fedora_qa.geometry.so3 import exp
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.stored_step import SINGLE_ROUNDOFF, StoredStep
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Interval, PoseTrack, motion_between
from fedora_qa.views.pixel_lattice import (
    FEWEST_PIXELS,
    FlowLattice,
    Region,
    lattice_of,
    region_of,
    static_depth_m,
    thinned,
)

Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

_LARGEST_BOUND_PX: Final = 1.0
"""Pixels with a larger rounding bound, px, are not compared: their points end too near the camera's plane."""

_USUAL_RATIO: Final = 2.0
"""Corrections with a chi^2 of up to this multiple of the degrees of freedom are not fitted further: 93% of corrections
by noise alone lie below."""

_FIT_SIGMAS: Final = 5.5
"""Standard errors of a fit that are allowed for: normal errors exceed them in one of 3e7 pixels, as many as a file of a
thousand fields compares."""

_PIXELS: Final = 4000
"""Pixels that a shift is fitted to: some hundred lie on smooth surfaces even where most of an image is foliage."""

_SIGNIFICANT: Final = 3.0
"""Least length of a shift, in its standard errors: chance exceeds it in 1% of fits of two components, exp(-9 / 2). It
proposes a cause and raises no alarm. Under another fault each field imitates a shift of its own."""

_LINEARISATIONS: Final = 4
"""Fits of a shift about poses that are corrected by the fit before: a correction turns the flow by parts of a pixel."""


@dataclass(frozen=True, slots=True)
class FieldError:
    """Difference of one field from the recomputed one, after the correction that declared pose noise permits.

    Attributes
    ----------
    interval
        Of the field.
    frame
        Row of the depth frame at the start of the interval.
    pixels
        Number of compared pixels.
    pixels_read, pixels_of_field
        Number of pixels that were read, whether they could be compared or not, and of all pixels of the field.
    squares, bound_squares
        Sums over pixels of the squared endpoint error and of the square of its rounding bound, px^2.
    worst_px, worst_bound_px, worst_pixel
        Endpoint error and bound, px, and (column, row) of the pixel where the error exceeds its bound most.
    twist_chi2, twist_dof
        chi^2 of the correction under the declared noise, and its degrees of freedom; 0 without declared noise, or
        between poses.
    free_squares, free_pixels
        As ``squares`` and ``pixels``, for the pixels of the fit only, after the best correction without regard to the
        noise; NaN and 0 if not computed.
    free_twist
        That correction: rotation vector in rad and translation in m; empty if not computed.
    region
        Left, top, right, bottom, px, of the deviating part of the image; None where the whole image, no pixel, or
        scattered pixels deviate.
    repeats
        ``flow`` or ``depth`` where the deviating part of the field, or of the depth at its start, equals that of the
        row before bit for bit.
    evidence
        Normal equations of the parameter templates; None where the field lies within its bounds.
    """

    interval: Interval
    frame: int
    pixels: int
    squares: float
    bound_squares: float
    worst_px: float
    worst_bound_px: float
    worst_pixel: tuple[int, int]
    twist_chi2: float = 0.0
    twist_dof: float = 0.0
    free_squares: float = float("nan")
    free_pixels: int = 0
    pixels_read: int = 0
    pixels_of_field: int = 0
    free_twist: tuple[float, ...] = ()
    region: Region | None = None
    repeats: Literal["", "flow", "depth"] = ""
    evidence: Evidence | None = None

    @property
    def suspicion(self) -> float:
        """Above 1 where the error exceeds the rounding bound, or the correction ten times the variance of the noise."""
        by_noise = self.twist_chi2 / (10 * self.twist_dof) if self.twist_dof > 0 else 0.0
        return max(self.worst_px / self.worst_bound_px, by_noise)


def is_noisy(noise: PoseModel | None) -> bool:
    """Whether the relative pose of a field may be corrected: pose noise is declared, or no declaration exists."""
    return noise is None or noise.position_sigma_m > 0 or noise.rotation_sigma_rad > 0


def compare_field(
    window: Window, track: PoseTrack, interval: Interval, frame: int, motion: RigidMotion
) -> FieldError | None:
    """Compare a field with the one recomputed from depth and pose, on a lattice of pixels.

    Parameters
    ----------
    track
        Poses, with the depth camera.
    interval
        Of the field.
    frame
        Row of the depth frame at the start of the interval.
    motion
        Of points in the depth camera's frame (Z forward, X right, Y down), from the start of the interval to its end,
        as declared.

    Returns
    -------
    FieldError or None
        None where too few pixels are valid, or flow and depth have different sizes.
    """
    K, noise = track.camera.K, window.facts.declared.pose
    lattice = lattice_of(window, interval, frame)
    sample = None if lattice is None else thinned(lattice)
    if lattice is None or sample is None:
        return None
    columns, rows = lattice.columns, lattice.rows
    steps = window.facts.steps
    flow_step_px = steps.get(f"path/{interval.stream}", StoredStep())
    depth_step_m = steps.get("path/depth", StoredStep()).scaled(1.0 / MM_PER_M)
    bound = rounding_px(K, motion, columns, rows, lattice.depths_m, lattice.flow_px, flow_step_px, depth_step_m,
                        lattice.lens)  # fmt: skip
    twist = np.zeros(6)
    if not is_noisy(noise):
        twist = track.interpolation_twist(interval.start_ns, interval.end_ns) + _storage_twist(window, track, motion)
    if twist.any():  # interpolated or rounded poses move pixels by up to |J| |twist|
        points1_m = sample.moved_points_m(K, motion)
        before_camera_m = points1_m[points1_m[:, 2] > 0]
        bound = bound + float(np.max(np.abs(sample.twist_jacobian(K, before_camera_m)) @ twist, initial=0.0))
    # The fit weighs by rounding: its residuals are held against the typical bound, in px.
    sample = replace(sample, sigma_px=median_of(bound[~np.isnan(bound)]))
    bound = _lengths(bound)
    fit = fit_motion(K, motion, sample) if is_noisy(noise) else None
    if fit and (flow_step_px.is_coarse or depth_step_m.is_coarse):
        bound = bound + _fit_error_px(K, fit, sample)
    error, compared = _errors(K, fit.motion if fit else motion, lattice, bound)
    if np.count_nonzero(compared) < FEWEST_PIXELS:
        return None
    if fit and np.any(error[compared] > bound[compared]):
        # The deviation of a part of the image must not enter the correction of the rest.
        of_most = fit_most(K, motion, sample, fit)
        error_of_most, _ = _errors(K, of_most.motion, lattice, bound)
        if 2 * np.count_nonzero(error_of_most[compared] <= bound[compared]) > np.count_nonzero(compared):
            fit, error = of_most, error_of_most
    worst = np.unravel_index(np.argmax(np.where(compared, error / bound, -1.0)), error.shape)
    result = FieldError(
        interval=interval,
        frame=frame,
        pixels=int(np.count_nonzero(compared)),
        squares=float(np.sum(error[compared] ** 2)),
        bound_squares=float(np.sum(bound[compared] ** 2)),
        worst_px=float(error[worst]),
        worst_bound_px=float(bound[worst]),
        worst_pixel=(int(columns[0, worst[1]]), int(rows[worst[0], 0])),
        pixels_read=error.size,
        pixels_of_field=int(np.prod(window.flow_px(interval.stream, interval.row).shape[:2])),
    )
    # Between pose samples interpolation reduces the noise: there the correction is not compared with it.
    if fit and noise and track.on_samples(interval.start_ns, interval.end_ns):
        covariance = field_covariance(track, interval, noise)
        if covariance is not None:
            chi2, dof = twist_statistic(fit, covariance)
            result = replace(result, twist_chi2=chi2, twist_dof=dof)
    is_usual = result.suspicion <= 1 and result.twist_chi2 <= _USUAL_RATIO * result.twist_dof
    if is_usual or not window.sampling.features:
        return result
    region = region_of(lattice, np.where(compared, error / bound, np.nan))
    if region is not None:  # the motion by the rest of the image is taken as exact
        sample = replace(thinned(lattice.within(region)) or sample, sigma_px=sample.sigma_px)
        motion, fit = (fit.motion, None) if fit else (motion, None)
    # Whether the field, or the depth at its start, equals its predecessor bit for bit in the deviating part.
    left, top, right, bottom = region or (0, 0, None, None)
    part = (slice(top, bottom), slice(left, right))
    stream, row = interval.stream, interval.row
    repeats: Literal["", "flow", "depth"] = ""
    if row and equal_bits(window.flow_px(stream, row)[part], window.flow_px(stream, row - 1)[part]):
        repeats = "flow"
    elif frame and equal_bits(window.depth_m(frame)[part], window.depth_m(frame - 1)[part]):
        repeats = "depth"
    # The evidence of the parameter templates, and the best correction of the motion without regard to the noise.
    covariance = None if region else field_covariance(track, interval, noise)
    templates = templates_of(track, interval, motion, sample, fit.twist if fit else np.zeros(6))
    evidence = weigh_templates(K, motion, sample, templates, fit, covariance)
    result = replace(result, region=region, repeats=repeats, evidence=evidence)
    # The fit does not converge from poses with large errors. The motion over a field is small, so the identity is a
    # second start.
    starts = (motion, RigidMotion(np.eye(3), np.zeros(3)))
    free = fit or next(filter(None, (fit_motion(K, start, sample) for start in starts)), None)
    if free is None:
        return result
    return replace(
        result,
        free_squares=float(np.nansum(free.residual_px**2)),
        free_pixels=len(sample.columns),
        free_twist=tuple(free.motion.twist_from(motion).tolist()),
    )


def _errors(K: Float64, motion: RigidMotion, lattice: FlowLattice, bound_px: Float64) -> tuple[Float64, Mask]:
    """Return the endpoint error (h, w) of a lattice, px, and where it can be compared."""
    predicted = rigid_flow(K, motion, lattice.columns, lattice.rows, lattice.depths_m, lattice.lens)
    error = _lengths(lattice.flow_px - predicted)
    return error, np.isfinite(error) & (bound_px < _LARGEST_BOUND_PX)


def _storage_twist(window: Window, track: PoseTrack, motion: RigidMotion) -> Float64:
    """Return a bound (6,) on the twist, rad and m, by the steps in which poses are stored; 0 for float64."""
    steps = window.facts.steps
    position_step_m = steps.get("path/pose/position", StoredStep())
    orientation_step = steps.get("path/pose/orientation", StoredStep())
    if max(position_step_m.roundoff, orientation_step.roundoff) < SINGLE_ROUNDOFF and not (
        position_step_m.size or orientation_step.size
    ):
        return np.zeros(6)
    # Four components that err by h_i make an angle of 2 |h|, and both poses one of 4 |h| at most. Coordinates that err
    # by h_i make a shift of |h|; an angle shifts the camera by its arm and the baseline, which is no longer than the
    # motion and two arms.
    angle_rad = 4 * float(np.linalg.norm([orientation_step.component(i).error_bounds(1.0) for i in range(4)]))
    largest_m = float(np.abs(track.poses.positions_world_m).max(initial=0.0))
    arm_m = float(np.linalg.norm(track.camera.T_body_camera[:3, 3]))
    shift_m = 2 * float(np.linalg.norm([position_step_m.component(i).error_bounds(largest_m) for i in range(3)]))
    shift_m += angle_rad * (3 * arm_m + float(np.linalg.norm(motion.t_m)))
    return np.array([angle_rad] * 3 + [shift_m] * 3)


def _fit_error_px(K: Float64, fit: MotionFit, sample: FlowSample) -> float:
    """Return a bound on the error that a fit to rounded flow makes at any pixel of its sample, px.

    Rounding is uniform within its bound b and has the variance b^2/3. The fit of information A, which takes b for the
    standard deviation, errs at a pixel by the covariance ``J A^-1 J^T / 3``.
    """
    points1_m = sample.moved_points_m(K, fit.motion)
    jacobian = sample.twist_jacobian(K, points1_m[points1_m[:, 2] > 0])
    variances = np.einsum("nki,ij,nkj->n", jacobian, np.linalg.pinv(fit.information, hermitian=True), jacobian) / 3
    return _FIT_SIGMAS * float(np.sqrt(max(variances.max(initial=0.0), 0.0)))


def _lengths(vectors: Float64) -> Float64:
    """Return the lengths (h, w) of vectors (h, w, 2).

    ``np.linalg.norm`` along an axis of two takes four times as long.
    """
    return np.asarray(np.sqrt(np.square(vectors[..., 0]) + np.square(vectors[..., 1])))


def field_covariance(track: PoseTrack, interval: Interval, noise: PoseModel | None) -> Float64 | None:
    """Return the covariance of the motion's twist under declared noise; None where the pose is declared exact.

    Where nothing is declared, standard deviations of 1 m and 1 rad leave the motion free.

    Parameters
    ----------
    track
        Poses, with the camera whose motion is meant.
    interval
        Start and end of the motion.
    noise
        Declared noise of the poses; None where nothing is declared.

    Returns
    -------
    ndarray of float64 or None
        (6, 6): rotation in rad, translation in m. None where the poses are declared exact.
    """
    if not is_noisy(noise):
        return None
    sigma_m, sigma_rad = (noise.position_sigma_m, noise.rotation_sigma_rad) if noise else (1.0, 1.0)
    return track.covariance(interval.start_ns, interval.end_ns, sigma_m, sigma_rad)


def templates_of(
    track: PoseTrack, interval: Interval, motion: RigidMotion, sample: FlowSample, correction: Float64
) -> Float64:
    """Return the templates (n, 2, m) of small errors of the parameters for one field, about a corrected motion.

    Parameters
    ----------
    track, interval
        Poses with the depth camera, and the interval of the field.
    motion
        Of points in the camera frame (Z forward, X right, Y down) over the interval, as declared, or as fitted outside
        a region.
    sample
        n pixels of the field.
    correction
        (6,) twist, rad and m, by which every motion is corrected; zero for none.

    Returns
    -------
    ndarray of float64
        (n, 2, m) px of flow (u, v) per unit of each parameter.
    """
    ends = track.ends(interval.start_ns, interval.end_ns)

    def corrected(declared: RigidMotion) -> RigidMotion:
        return declared.corrected(correction) if correction.any() else declared

    def remounted(rotation_rad: Float64, shift_m: Float64) -> RigidMotion:
        T_body_camera = track.camera.T_body_camera.copy()
        T_body_camera[:3, :3] = T_body_camera[:3, :3] @ _turned_back(*rotation_rad.tolist())
        T_body_camera[:3, 3] -= shift_m
        remounted_motion = motion_between(*ends, replace(track.camera, T_body_camera=T_body_camera)) or motion
        return corrected(remounted_motion)

    def delayed(seconds: float) -> RigidMotion | None:
        shift_ns = round(seconds * NS_PER_S)
        delayed_motion = track.motion(interval.start_ns + shift_ns, interval.end_ns + shift_ns)
        return None if delayed_motion is None else corrected(delayed_motion)

    return parameter_templates(track.camera.K, corrected(motion), sample, remounted, delayed)


@cache
def _turned_back(x_rad: float, y_rad: float, z_rad: float) -> Float64:
    """Return the inverse rotation (3, 3) of a rotation vector; all fields use the same few vectors."""
    return exp(-np.array([x_rad, y_rad, z_rad]))


def equal_bits(image: NDArray[np.float32], other: NDArray[np.float32]) -> bool:
    """Whether two images are equal in every value, without being empty or zero throughout; NaN equals NaN.

    Parameters
    ----------
    image, other
        Of any shape; images of different shapes are not equal.
    """
    return np.array_equal(image, other, equal_nan=True) and bool(np.any(np.nan_to_num(image)))


@dataclass(frozen=True, slots=True)
class FlowParameterFit(Feature):
    """An error of one parameter of the recomputed flow, fitted alone to all fields of one rate.

    Attributes
    ----------
    parameter, unit
        Cause and unit of the parameter's template.
    value, standard_error
        The error of the parameter, and its standard error, in that unit.
    removed_share
        Share of the rms deviation that the error explains, 0 to 1.
    components
        Of the error, of which ``value`` is the norm with the sign of the largest.
    smooth_share
        As ``removed_share``, of the pixels away from breaks of the flow; 0 where these were not fitted on their own.
    """

    parameter: str
    value: float
    unit: str
    standard_error: float
    removed_share: float
    components: tuple[float, ...] = ()
    smooth_share: float = 0.0


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
