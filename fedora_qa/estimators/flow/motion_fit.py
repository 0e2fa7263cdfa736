"""Fit the motion of the camera to a flow field.

The flow is computed from the noise-free pose, while the file holds a noisy pose. Therefore each field may correct the
relative pose by a twist whose covariance follows from the declared noise. The residual must then be rounding, and the
twist must be as large as the noise.
"""

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
    pixels = sample_pixels(K, sample)
    for _ in range(_ITERATIONS):
        residual, jacobian = linearised(K, fitted, pixels)
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


class SamplePixels(NamedTuple):
    """Pixels of a sample for compiled loops: as ``FlowSample``, with the slopes x and y (n,) of their rays."""

    columns: Float64
    rows: Float64
    x: Float64
    y: Float64
    depths_m: Float64
    flow_px: Float64
    lens: CompiledLens


def sample_pixels(K: Float64, sample: FlowSample) -> SamplePixels:
    """Return the pixels of a sample for ``linearised``, whose intrinsics are K (3, 3), px."""
    x, y = rays_of_pixels(K, sample.lens, sample.columns, sample.rows)
    columns, rows, x, y, depths_m, flow_px = (
        np.ascontiguousarray(values, np.float64)
        for values in (sample.columns, sample.rows, x, y, sample.depths_m, sample.flow_px)
    )
    return SamplePixels(columns, rows, x, y, depths_m, flow_px, compiled(sample.lens))


def linearised(K: Float64, motion: RigidMotion, pixels: SamplePixels) -> tuple[Float64, Float64]:
    """Return the residual (2 n,) of the flow, px, and the derivative (2 n, 6) of the flow by a twist.

    Both are zero where a point lies behind the camera. Rows are u and v of each pixel in turn.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    motion
        Motion of points, from the first to the second camera frame, which the twist (rotation vector, rad, then
        translation, m) follows.
    pixels
        n of them, from ``sample_pixels``.
    """
    n = len(pixels.columns)
    residual, jacobian = np.empty((n, 2)), np.empty((n, 2, 6))
    K, R, t_m = (np.ascontiguousarray(values) for values in (K, motion.R, motion.t_m))
    _linearise(K, R, t_m, pixels, residual, jacobian)
    return residual.reshape(-1), jacobian.reshape(-1, 6)


@njit(cache=True, error_model="numpy")
def _linearise(
    K: Float64, R: Float64, t_m: Float64, pixels: SamplePixels, residual: Float64, jacobian: Float64
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
