"""Fit the motion of the camera to a flow field, with templates of small changes of parameters.

The flow is computed from the noise-free pose, while the file holds a noisy pose. Therefore each field may correct the
relative pose by a twist whose covariance follows from the declared noise. The residual must then be rounding, and the
twist must be as large as the noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.lens import CompiledLens, compiled, imaged_at, rays_of_pixels
from fedora_qa.geometry.rigid_flow import moved_points, rigid_flow, twist_jacobian, twist_slopes
from fedora_qa.sequence.declared import Lens

Float64 = NDArray[np.float64]

_PERCENT, _DEG, _MS = 0.01, np.pi / 180, 1e-3

_ITERATIONS: Final = 6
"""Most steps of Gauss-Newton."""

_CONCENTRATIONS: Final = 10
"""Most concentration steps from a start."""

_FIRST_CONCENTRATIONS: Final = 2
_KEPT_STARTS: Final = 2
"""After two steps from each start, only the best starts are followed: of FAST-LTS (Rousseeuw, Van Driessen 2006,
section 3), whose steps reduce the sum of squares most at first."""

_CONVERGED_PX: Final = 1e-6
"""Iterations stop at a step whose components, each times the root sum of squares of the flow's derivatives over all
pixels, add up to less than this: convergence is quadratic."""

_LARGEST_TURN_RAD: Final = 0.3
"""Largest rotation of a correction. Beyond it the linearisation does not hold, and the motion is not the cause of the
residual."""


@dataclass(frozen=True, slots=True)
class FlowSample:
    """Pixels of one field; all values are finite.

    Attributes
    ----------
    columns, rows
        (n,) px.
    depths_m
        (n,) z-depth at the start of the interval, m.
    flow_px
        (n, 2) stored flow, px.
    sigma_px
        Standard deviation of rounding by which residuals are weighted, px.
    lens
        Of the camera that the pixels belong to; None for a pinhole.
    """

    columns: Float64
    rows: Float64
    depths_m: Float64
    flow_px: Float64
    sigma_px: float
    lens: Lens | None = None

    def rigid_flow(self, K: Float64, motion: RigidMotion) -> Float64:
        """Return the flow (n, 2) of the pixels where all is static, px.

        Parameters
        ----------
        K
            (3, 3) intrinsics, px.
        motion
            Of points, from the camera frame at the start of the interval to that at its end.
        """
        return rigid_flow(K, motion, self.columns, self.rows, self.depths_m, self.lens)

    def moved_points_m(self, K: Float64, motion: RigidMotion) -> Float64:
        """Return the points (n, 3) of the pixels in the second camera frame, m; parameters as of ``rigid_flow``."""
        return np.stack(moved_points(K, motion, self.columns, self.rows, self.depths_m, self.lens), axis=-1)

    def twist_jacobian(self, K: Float64, points1_m: Float64) -> Float64:
        """Return the derivative (n, 2, 6) of the flow by a twist, at points (n, 3) of the second camera frame, m."""
        return twist_jacobian(K, points1_m, self.lens)

    def chosen(self, pixels: NDArray[np.intp]) -> "FlowSample":
        """Return the pixels at the indices (k,)."""
        return replace(
            self,
            columns=self.columns[pixels],
            rows=self.rows[pixels],
            depths_m=self.depths_m[pixels],
            flow_px=self.flow_px[pixels],
        )


@dataclass(frozen=True, slots=True)
class MotionFit:
    """The relative pose that fits a field best.

    Attributes
    ----------
    motion
        The corrected motion.
    twist
        (6,) correction of the given motion: rotation vector, rad, then translation, m.
    information
        (6, 6) of the twist, from the flow alone, 1/rad^2, 1/(rad m) and 1/m^2.
    residual_px
        (n, 2) stored minus recomputed flow after the correction, px; NaN where the point lies behind the camera.
    """

    motion: RigidMotion
    twist: Float64
    information: Float64
    residual_px: Float64


def fit_motion(
    K: Float64, motion: RigidMotion, sample: FlowSample, start: RigidMotion | None = None
) -> MotionFit | None:
    """Return the motion, corrected by Gauss-Newton steps, that fits the flow best.

    Directions that the sample does not determine (distant or few points) are not changed.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    motion
        Motion of points, from the camera frame at the start of the interval to that at its end; the twist corrects it.
    sample
        Pixels of the field.
    start
        Motion from which the steps begin; ``motion`` where None.

    Returns
    -------
    MotionFit or None
        None where the steps do not stay within the linearisation, or where most points lie behind the camera.
    """
    fitted = start or motion
    pixels = _pixels_of(K, sample)
    for _ in range(_ITERATIONS):
        residual, jacobian = _linearised(K, fitted, pixels)
        # Gauss-Newton: (J^T J) step = J^T r, with J the derivative of the flow by the twist.
        information = jacobian.T @ jacobian
        scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
        gradient = jacobian.T @ residual
        # Columns of J are scaled to unit norm, so that radians and metres are of the same size in the system.
        step: Float64 = np.linalg.lstsq(information / np.outer(scale, scale), gradient / scale, rcond=1e-12)[0] / scale
        if not np.all(np.isfinite(step)) or np.linalg.norm(step[:3]) > _LARGEST_TURN_RAD:
            return None
        fitted = fitted.corrected(step)
        if float(np.abs(step) @ scale) < _CONVERGED_PX:
            break
    twist = fitted.twist_from(motion)
    if np.linalg.norm(twist[:3]) > _LARGEST_TURN_RAD:
        return None
    residual_px = sample.flow_px - sample.rigid_flow(K, fitted)
    if 2 * np.count_nonzero(np.isfinite(residual_px[:, 0])) < len(residual_px):
        return None
    return MotionFit(fitted, twist, information / sample.sigma_px**2, residual_px)


def fit_most(K: Float64, motion: RigidMotion, sample: FlowSample, fit: MotionFit) -> MotionFit:
    """Return the motion that fits the best half of the sample, so that a deviating part of the image has no effect.

    Concentration steps of least trimmed squares (P. J. Rousseeuw, K. Van Driessen, Data Min. Knowl. Discov. 12 (2006)
    29) never increase the sum of squares of the best half. They start from the fit to the whole sample and from a fit
    to each half of the image. If a quarter of the image deviates, two of these halves contain none of it.

    Parameters
    ----------
    K, motion, sample
        As of ``fit_motion``.
    fit
        Of the whole sample, from ``fit_motion``.

    Returns
    -------
    MotionFit
        The best fit, with the residuals of the whole sample.
    """
    starts = [fit]
    for coordinates in (sample.columns, sample.rows):
        middle = float(np.median(coordinates))
        halves = (np.flatnonzero(coordinates <= middle), np.flatnonzero(coordinates > middle))
        starts += [start for half in halves if (start := _fit_part(K, motion, sample, half)) is not None]
    begun = sorted(
        (_concentrated(K, motion, sample, start, _FIRST_CONCENTRATIONS) for start in starts), key=_trimmed_squares
    )
    rest = _CONCENTRATIONS - _FIRST_CONCENTRATIONS
    followed = [_concentrated(K, motion, sample, start, rest) for start in begun[:_KEPT_STARTS]]
    return min(followed, key=_trimmed_squares)


def _concentrated(K: Float64, motion: RigidMotion, sample: FlowSample, fit: MotionFit, most: int) -> MotionFit:
    """Return a fit after concentration steps, ``most`` at most: each fits the half with the least residuals."""
    for _ in range(most):
        half = np.argsort(_squares(fit))[: len(sample.columns) // 2]
        better = _fit_part(K, motion, sample, half, fit.motion)
        if better is None or not _trimmed_squares(better) < _trimmed_squares(fit):
            break
        fit = better
    return fit


def _fit_part(
    K: Float64, motion: RigidMotion, sample: FlowSample, part: NDArray[np.intp], start: RigidMotion | None = None
) -> MotionFit | None:
    fit = fit_motion(K, motion, sample.chosen(part), start) if len(part) else None
    if fit is None:
        return None
    residual_px = sample.flow_px - sample.rigid_flow(K, fit.motion)
    return replace(fit, residual_px=residual_px)


def _squares(fit: MotionFit) -> Float64:
    squares = np.sum(fit.residual_px**2, axis=1)
    return np.where(np.isfinite(squares), squares, np.inf)


def _trimmed_squares(fit: MotionFit) -> float:
    """Return the sum of the smaller half of the squared residuals, px^2."""
    return float(np.sum(np.sort(_squares(fit))[: len(fit.residual_px) // 2]))


class _SamplePixels(NamedTuple):
    """Pixels of a sample for compiled loops, with the slopes (n,) of their rays and their lens."""

    columns: Float64
    rows: Float64
    x: Float64
    y: Float64
    depths_m: Float64
    flow_px: Float64
    lens: CompiledLens


def _pixels_of(K: Float64, sample: FlowSample) -> _SamplePixels:
    x, y = rays_of_pixels(K, sample.lens, sample.columns, sample.rows)
    columns, rows, x, y, depths_m, flow_px = (
        np.ascontiguousarray(values, np.float64)
        for values in (sample.columns, sample.rows, x, y, sample.depths_m, sample.flow_px)
    )
    return _SamplePixels(columns, rows, x, y, depths_m, flow_px, compiled(sample.lens))


def _linearised(K: Float64, motion: RigidMotion, pixels: _SamplePixels) -> tuple[Float64, Float64]:
    """Return the residual (2 n,), px, and its Jacobian by the twist (2 n, 6).

    Both are zero where a point lies behind the camera.
    """
    n = len(pixels.columns)
    residual, jacobian = np.empty((n, 2)), np.empty((n, 2, 6))
    K, R, t_m = (np.ascontiguousarray(values) for values in (K, motion.R, motion.t_m))
    _linearise(K, R, t_m, pixels, residual, jacobian)
    return residual.reshape(-1), jacobian.reshape(-1, 6)


@njit(cache=True, error_model="numpy")
def _linearise(
    K: Float64, R: Float64, t_m: Float64, pixels: _SamplePixels, residual: Float64, jacobian: Float64
) -> None:
    """Write the residual (n, 2), px, and its Jacobian by the twist (n, 2, 6)."""
    for i in range(len(pixels.columns)):
        x, y, Z0 = pixels.x[i], pixels.y[i], pixels.depths_m[i]
        # X1 = Z0 R ray + t.
        X1 = Z0 * (R[0, 0] * x + (R[0, 1] * y + R[0, 2])) + t_m[0]
        Y1 = Z0 * (R[1, 0] * x + (R[1, 1] * y + R[1, 2])) + t_m[1]
        Z1 = Z0 * (R[2, 0] * x + (R[2, 1] * y + R[2, 2])) + t_m[2]
        column1, row1 = imaged_at(K, pixels.lens, X1, Y1, Z1)
        u = pixels.flow_px[i, 0] - (column1 - pixels.columns[i])
        v = pixels.flow_px[i, 1] - (row1 - pixels.rows[i])
        if np.isfinite(u) and np.isfinite(v):
            residual[i, 0], residual[i, 1] = u, v
            twist_slopes(K, pixels.lens, X1, Y1, Z1, jacobian[i])
        else:
            residual[i] = 0.0
            jacobian[i] = 0.0


@dataclass(frozen=True, slots=True)
class Evidence:
    """Normal equations of templates against the residuals of fields, with the pose correction eliminated.

    Evidence of several fields is added.

    Attributes
    ----------
    matrix, vector
        (m, m) and (m,) for m templates, weighted by the inverse variance of the residuals.
    total
        Weighted sum of squares of the residuals.
    count
        Number of the residuals, two for each pixel or tile.
    """

    matrix: Float64
    vector: Float64
    total: float
    count: int

    def __add__(self, other: "Evidence") -> "Evidence":
        return Evidence(
            self.matrix + other.matrix, self.vector + other.vector, self.total + other.total, self.count + other.count
        )

    def along(self, direction: Float64) -> "Evidence":
        """Return the evidence for the one template that is the sum of all templates times ``direction`` (m,)."""
        matrix, vector = direction @ self.matrix @ direction, direction @ self.vector
        return Evidence(np.array([[matrix]]), np.array([vector]), self.total, self.count)

    def explained_by(self, columns: slice) -> tuple[Float64, float]:
        """Return the sizes (k,) of some templates fitted alone, and the share of the squares that they explain."""
        matrix, vector = self.matrix[columns, columns], self.vector[columns]
        sizes: Float64 = np.asarray(np.linalg.lstsq(matrix, vector, rcond=1e-9)[0], dtype=np.float64)
        share = float(vector @ sizes) / self.total if self.total > 0 else 0.0
        return sizes, share

    def fit(self, columns: slice) -> "TemplateFit":
        """Return the fit of some templates alone; its error is larger where much of the residuals remains."""
        sizes, share = self.explained_by(columns)
        remaining = float(np.clip(1.0 - share, 0.0, 1.0))
        information = np.diag(self.matrix[columns, columns])
        by_rounding = float(np.max(1.0 / np.sqrt(np.maximum(information, 1e-300))))
        # Residuals beyond the stated sigma enlarge the error; smaller ones do not reduce it.
        error = by_rounding * max(1.0, float(np.sqrt(remaining * self.total / self.count)))
        # The rms falls with the square root of the share of the squares that remains.
        return TemplateFit(sizes, 1.0 - float(np.sqrt(remaining)), error)


class TemplateFit(NamedTuple):
    """Templates fitted to residuals.

    Attributes
    ----------
    sizes
        (m,) in the units of the templates.
    removed_share
        Share of the rms residual that the templates remove, 0 to 1.
    standard_error
        The largest standard error of a size.
    """

    sizes: Float64
    removed_share: float
    standard_error: float


def sum_of(evidences: Sequence[Evidence]) -> Evidence:
    """Return the sum of the evidence of all fields, of which there is at least one."""
    total = evidences[0]
    for evidence in evidences[1:]:
        total = total + evidence
    return total


def weigh_templates(
    K: Float64,
    motion: RigidMotion,
    sample: FlowSample,
    templates: Float64,
    fit: MotionFit | None,
    twist_covariance: Float64 | None,
) -> Evidence:
    """Return the normal equations of templates for one field.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    motion
        Given motion of points, from the camera frame at the start of the interval to that at its end.
    sample
        Pixels of the field.
    templates
        (n, 2, m) px per unit of each; NaN where the point lies behind the camera.
    fit
        Of the same sample, from ``fit_motion``; None where the motion is not corrected.
    twist_covariance
        (6, 6) prior covariance of the twist of the motion, rad and m; None where the motion is exact.

    Returns
    -------
    Evidence
        With 2 n residuals.

    Notes
    -----
    Without ``twist_covariance`` the pose is exact and nothing is eliminated. With it, the twist x of prior covariance S
    is eliminated: the minimum of ``|e - J x - G a|^2 / sigma^2 + x^T S^-1 x`` over x leaves normal equations in a
    (Schur's complement). The residual ``e = r + J t`` is linearised about the fitted motion of twist t, where its
    second-order terms are below rounding. There r is small, and nothing of the size of J t, which may be a million
    times larger, is subtracted from another: with A = J^T J / sigma^2, the remaining squares are
    ``|r|^2 / sigma^2 + t^T (A^-1 + S)^-1 t`` and terms in J^T r, which is zero where the steps have converged.
    """
    pixels = _pixels_of(K, sample)
    columns = np.nan_to_num(templates.reshape(len(templates) * 2, -1))
    if twist_covariance is None or fit is None:
        return _normal_equations(_linearised(K, motion, pixels)[0], columns, sample.sigma_px)
    residual, jacobian = _linearised(K, fit.motion, pixels)
    plain = _normal_equations(residual, columns, sample.sigma_px)
    weight = 1.0 / sample.sigma_px**2
    information = weight * jacobian.T @ jacobian
    cross, gradient = weight * jacobian.T @ columns, weight * jacobian.T @ residual
    # Schur's complement: (A + S^-1)^-1, with S possibly singular.
    eliminated = parallel_sum(twist_covariance, information)
    left = fit.twist - eliminated @ (information @ fit.twist)
    by_prior = fit.twist @ parallel_sum(information, twist_covariance) @ fit.twist
    return Evidence(
        plain.matrix - cross.T @ eliminated @ cross,
        plain.vector + cross.T @ (left - eliminated @ gradient),
        max(plain.total + float(2 * gradient @ left - gradient @ eliminated @ gradient + by_prior), 0.0),
        plain.count,
    )


def parallel_sum(covariance: Float64, information: Float64) -> Float64:
    """Return ``(covariance^-1 + information)^-1``.

    With ``covariance = L L^T`` it is ``L (1 + L^T information L)^-1 L^T``. The bracket is inverted by its eigenvalues,
    none of which is less than 1, so that matrices of any size can be inverted.

    Parameters
    ----------
    covariance, information
        (p, p) symmetric, without negative eigenvalues; either may be singular. Their units are inverse to each
        other.

    Returns
    -------
    ndarray of float64
        (p, p) in the unit of ``covariance``.
    """
    # L (1 + L^T information L)^-1 L^T with L = V sqrt(eigenvalues).
    eigenvalues, directions = np.linalg.eigh(covariance)
    L = directions * np.sqrt(np.maximum(eigenvalues, 0.0))
    gains, rotation = np.linalg.eigh(L.T @ information @ L)
    rotated = L @ rotation
    combined: Float64 = (rotated / (1.0 + np.maximum(gains, 0.0))) @ rotated.T
    return combined


def twist_statistic(fit: MotionFit, twist_covariance: Float64) -> tuple[float, float]:
    """Return ``x^T (S + A^-1)^-1 x`` of the fitted twist x, and its expectation.

    A is the information of the fit. The expectation, ``trace((S + A^-1)^-1 S)``, counts the directions that the fit
    determines. Under the prior the statistic is chi-square with about that number of degrees of freedom.

    Parameters
    ----------
    fit
        Of one field.
    twist_covariance
        (6, 6) prior covariance S of the twist, rad and m.

    Returns
    -------
    statistic, expectation
        Both without unit.
    """
    weight = parallel_sum(fit.information, twist_covariance)  # (S + A^-1)^-1
    return float(fit.twist @ weight @ fit.twist), float(np.trace(weight @ twist_covariance))


def _normal_equations(residual: Float64, columns: Float64, sigma_px: float) -> Evidence:
    """Return the evidence for templates, columns of (2 n, m), in a residual (2 n,), px."""
    weight = 1.0 / sigma_px**2
    return Evidence(
        weight * columns.T @ columns, weight * columns.T @ residual, weight * float(residual @ residual), len(residual)
    )


@dataclass(frozen=True, slots=True)
class ParameterTemplate:
    """A parameter of the recomputed flow and the columns of its templates.

    Attributes
    ----------
    parameter, unit
        Its name, and the unit of its error.
    columns
        Of ``parameter_templates``.
    largest
        Error, in that unit, above which the template, a derivative, no longer approximates the change of the flow.
    """

    parameter: str
    unit: str
    columns: slice
    largest: float

    def size(self, fitted: Float64) -> float:
        """Return the norm of an error (k,) of several components, with the sign of the largest one."""
        return float(np.copysign(np.linalg.norm(fitted), fitted[np.argmax(np.abs(fitted))]))


FLOW_GAIN: Final = ParameterTemplate("flow_gain", "percent", slice(0, 1), np.inf)
FOCAL: Final = ParameterTemplate("intrinsics_focal", "percent", slice(1, 2), 30.0)
CENTRE: Final = ParameterTemplate("intrinsics_centre", "px", slice(2, 4), 100.0)
MOUNTING: Final = ParameterTemplate("extrinsic_rotation", "deg", slice(4, 7), 15.0)
LEVER_ARM: Final = ParameterTemplate("lever_arm", "m", slice(7, 10), 3.0)
TIME_OFFSET: Final = ParameterTemplate("time_offset", "ms", slice(10, 11), 50.0)

PARAMETER_TEMPLATES: Final = (FLOW_GAIN, FOCAL, CENTRE, MOUNTING, LEVER_ARM, TIME_OFFSET)


def parameter_templates(
    K: Float64,
    motion: RigidMotion,
    sample: FlowSample,
    remounted: Callable[[Float64, Float64], RigidMotion],
    delayed: Callable[[float], RigidMotion | None],
) -> Float64:
    """Return the templates of all parameters: stored minus recomputed flow per unit of each error.

    Parameters
    ----------
    K, motion
        (3, 3) intrinsics, px, and motion of points between the camera frames, as declared.
    sample
        Pixels of the field.
    remounted
        Gives the motion if the true mounting is ``R_body_camera Exp(-rotation)`` and the true centre of the camera
        lies ``shift`` less along the axes of the body, for a rotation vector (3,), rad, and a shift (3,), m.
    delayed
        Gives the motion if the timestamps of the poses are too late by a number of seconds; None where no pose
        covers it.

    Returns
    -------
    ndarray of float64
        (n, 2, 11) px per unit of each of ``PARAMETER_TEMPLATES``; 0 for a time offset that no pose covers.
    """

    def flow(changed_K: Float64, changed_motion: RigidMotion) -> Float64:
        return sample.rigid_flow(changed_K, changed_motion)

    def refocused(ratio: float) -> Float64:
        # The declared focal length is ``ratio`` times the true one; skew scales with it, the centre stays.
        scaled: Float64 = K * np.array([[1 / ratio, 1 / ratio, 1.0], [1.0, 1 / ratio, 1.0], [1.0, 1.0, 1.0]])
        return scaled

    def recentred(axis: int, shift_px: float) -> Float64:
        changed = K.copy()
        changed[axis, 2] -= shift_px
        return changed

    # Central differences (f(x + h) - f(x - h)) / 2 h: their error is of second order in steps of a thousandth.
    step, step_s = 1e-3, 1e-3
    columns = [
        # A gain G adds G times the flow: the template needs no difference.
        flow(K, motion) * _PERCENT,
        _slope(flow(refocused(1 + step), motion), flow(refocused(1 - step), motion), step / _PERCENT),
    ]
    for axis in (0, 1):
        columns.append(_slope(flow(recentred(axis, step), motion), flow(recentred(axis, -step), motion), step))
    unchanged = np.zeros(3)
    for turn in np.eye(3) * step:
        columns.append(_slope(flow(K, remounted(turn, unchanged)), flow(K, remounted(-turn, unchanged)), step / _DEG))
    for shift in np.eye(3) * step:
        columns.append(_slope(flow(K, remounted(unchanged, shift)), flow(K, remounted(unchanged, -shift)), step))
    later, earlier = delayed(step_s), delayed(-step_s)
    if later is None or earlier is None:
        columns.append(np.zeros_like(columns[0]))
    else:
        columns.append(_slope(flow(K, later), flow(K, earlier), step_s / _MS))
    return np.stack(columns, axis=-1)


def _slope(ahead: Float64, behind: Float64, step: float) -> Float64:
    return (ahead - behind) / (2 * step)
