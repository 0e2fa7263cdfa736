"""Fit one parameter of two depth frames, the camera's motion between them being known up to its noise.

The residual of each pixel is linear in the parameter and in the error of the motion's twist to good accuracy
(point-to-plane registration: Y. Chen, G. Medioni, "Object modelling by registration of multiple range images", Image
and Vision Computing 10 (1992)). The twist is held by its declared covariance, so that what the file's pose noise can
explain is not taken for a fault.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import DepthImage
from fedora_qa.estimators.depth.warp import (
    DepthLattice,
    DepthModel,
    ModelNumber,
    WarpedLattice,
    residuals_after,
    warp,
)
from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.geometry import so3
from fedora_qa.geometry.camera import RigidMotion

Float64 = NDArray[np.float64]

Family = Callable[[float], DepthModel | None]
"""A parameter's value -> the model that it makes; None where there is none (no pose covers the instant)."""

FEWEST_PIXELS: Final = 50
"""Pixels below which two frames are not compared."""

_ITERATIONS: Final = 12
_CONVERGED: Final = 1e-3
"""A step of less than this share of its standard error, and of what residuals scatter by, is the last.

Each is a hundredth to a thousandth of the one before, so that no more than 1e-5 of the error is left; what the last one
changes in the residuals is not computed. (Where nothing holds a direction its error is large, and means little.)
"""


@dataclass(frozen=True, slots=True)
class DepthFit:
    """Two frames after the best correction.

    Attributes
    ----------
    value, standard_error, bound
        The parameter; its error where every pixel errs on its own; how far it may err where all err to their bounds
        in the worst direction. 0, infinite and 0 where no parameter was asked for.
    twist, coefficients
        (6,) correction of the motion, and (k,) its coefficients along the directions of the noise, in sigmas.
    warped
        The lattice after the correction.
    typical, typical_bound
        Median absolute residual, and the median of the residuals' bounds.
    noise_square, noise_dof
        The twist against its declared covariance (chi-square), and how many of its directions the depth constrains.
    """

    value: float
    standard_error: float
    bound: float
    twist: Float64
    coefficients: Float64
    warped: WarpedLattice
    typical: float
    typical_bound: float
    noise_square: float
    noise_dof: float

    @property
    def agrees(self) -> bool:
        """Whether most pixels deviate by no more than they may."""
        return self.typical <= self.typical_bound


def noise_directions(covariance: Float64) -> Float64:
    """Return the twist (6, k) of each independent direction of the noise, one standard deviation long.

    Parameters
    ----------
    covariance
        (6, 6) of the twist: rad, then m. Directions without variance, to 1e-12 of the largest, are left out.
    """
    if not covariance.any():
        return np.empty((len(covariance), 0))
    variances, directions = np.linalg.eigh(covariance)
    positive = variances > 1e-12 * max(float(variances.max(initial=0.0)), 1e-300)
    # S = V diag(s^2) V^T: coefficients along the columns V s have unit variance.
    return np.asarray(directions[:, positive] * np.sqrt(variances[positive]))


def fit_depth(
    family: Family,
    lattice: DepthLattice,
    image1: DepthImage,
    noise: Float64,
    *,
    start: float,
    step: float | ModelNumber | None,
    coefficients: Float64 | None = None,
) -> DepthFit | None:
    """Fit a parameter from ``start`` on, and the twist within its noise, by Gauss-Newton steps.

    Parameters
    ----------
    family
        The models of the frames by the parameter.
    lattice, image1
        Pixels of the first frame, and the second frame.
    noise
        (6, k) as ``noise_directions`` gives them; (6, 0) where the motion is exact.
    step
        By which the parameter is changed to differentiate by it, or the number of the model that it is; None where
        only the twist is to be fitted.
    coefficients
        (k,) of the twist at the beginning, along the directions of the noise; 0 where None.

    Returns
    -------
    DepthFit | None
        None where the frames share too few pixels, or the fit ends where no depth could be.

    Notes
    -----
    Where little holds some directions of the twist (one plane, no noise declared) the steps along them need not end:
    so far off, the twist is less linear than the depths are rounded. Then the best of all twists is taken.
    """
    problem = _FitProblem(family, lattice, image1, noise, step)
    value, z = start, np.zeros(noise.shape[1]) if coefficients is None else coefficients
    # Far from the solution a convex loss has one minimum only; Cauchy's is robust near it.
    convex = True
    visited: list[tuple[float, float, Float64]] = []
    for _ in range(_ITERATIONS if step is not None or len(z) else 0):
        solution = problem.step_from(value, z, convex=convex)
        if solution is None:
            return None
        if not convex:
            visited.append((solution.typical, value, z))
        change = np.abs(solution.change)
        value, z = value + solution.change[0] * (step is not None), z + solution.change[1:]
        if not convex and solution.moved <= _CONVERGED and np.all(change <= _CONVERGED * solution.errors):
            return _fit_from(solution, value, z, noise, step)
        convex = convex and bool(np.any(change > solution.errors))
    last = problem.step_from(value, z)
    best = min(visited, key=lambda visit: visit[0], default=None)
    if best is not None and last is not None and best[0] < last.typical:
        _, value, z = best
        last = problem.step_from(value, z)
    return None if last is None else _fit_from(last, value, z, noise, step)


@dataclass(frozen=True, slots=True)
class _FitStep:
    """A step of (parameter, z), their standard errors, and the bound of the parameter's systematic error.

    ``typical`` is the median absolute residual before the step, ``moved`` by how many sigmas of theirs it moves
    residuals on average.
    """

    warped: WarpedLattice
    change: Float64
    errors: Float64
    bound: float
    typical: float
    moved: float


@dataclass(frozen=True, slots=True)
class _FitProblem:
    """The arguments of ``fit_depth``."""

    family: Family
    lattice: DepthLattice
    image1: DepthImage
    noise: Float64
    step: float | ModelNumber | None

    def step_from(self, value: float, z: Float64, *, convex: bool = False) -> _FitStep | None:
        """Return the step from a parameter and a twist; None where there is none.

        Residuals far beyond the typical one weigh less (Cauchy's weights), so that single places do not lead. Far from
        the solution these may hold on to a part of the image; Huber's (``convex``) have one minimum only.
        """
        twist = self.noise @ z
        if not np.all(np.isfinite(twist)):
            return None
        correct = _correction(twist)
        model = self.family(value)
        if model is None or not model.conceivable:
            return None
        number = self.step if isinstance(self.step, str) else None
        warped = warp(correct(model), self.lattice, self.image1, number)
        if warped.compared < FEWEST_PIXELS:
            return None
        # The residual's derivative by the parameter (n,): 0 where none is fitted.
        value_derivatives = warped.number_derivatives
        if self.step is not None and not isinstance(self.step, str):
            # Central differences.
            ahead, behind = (
                residuals_after(correct(side), self.lattice, self.image1)
                if side is not None and side.conceivable
                else None
                for side in (self.family(value + sign * self.step) for sign in (1, -1))
            )
            if ahead is None or behind is None:
                return None
            value_derivatives = (ahead - behind) / (2 * self.step)
        residuals, bounds, columns = _compared_rows(
            warped.residuals, warped.bounds, value_derivatives, warped.twist_derivatives, self.noise
        )
        if len(residuals) < FEWEST_PIXELS:
            return None
        # z has unit variance before the fit; the parameter is free, or fixed where nothing depends on it.
        prior = np.ones(columns.shape[1])
        prior[0] = 0.0 if np.any(columns[:, 0]) else 1.0
        prior_gradient = np.concatenate(([0.0], z))
        step = _weighted_step(residuals, bounds, columns, prior, prior_gradient, MAD_TO_SIGMA, convex)
        return _FitStep(warped, *step[1:]) if step[0] else None


def _fit_from(last: _FitStep, value: float, z: Float64, noise: Float64, step: float | ModelNumber | None) -> DepthFit:
    return DepthFit(
        value=value,
        standard_error=float(last.errors[0]) if step is not None else np.inf,
        bound=last.bound if step is not None else 0.0,
        twist=noise @ z,
        coefficients=z,
        warped=last.warped,
        typical=last.typical,
        typical_bound=median_of(last.warped.bounds[np.isfinite(last.warped.bounds)]),
        noise_square=float(z @ z),
        # Of each direction the depth constrains what it takes off the unit variance before the fit.
        noise_dof=float(np.sum(1.0 - last.errors[1:] ** 2)),
    )


def _correction(twist: Float64) -> Callable[[DepthModel], DepthModel]:
    """Return how a model is corrected by a twist (6,): ``RigidMotion.corrected``, its rotation computed once."""
    if not twist.any():
        return lambda model: model
    dR, shift_m = so3.exp(twist[:3]), twist[3:]

    def corrected(model: DepthModel) -> DepthModel:
        motion = RigidMotion(dR @ model.motion.R, dR @ model.motion.t_m + shift_m)
        return replace(model, motion=motion)

    return corrected


@njit(cache=True)
def _weighted_step(
    residuals: Float64,
    bounds: Float64,
    columns: Float64,
    prior: Float64,
    prior_gradient: Float64,
    to_sigma: float,
    convex: bool,
) -> tuple[bool, Float64, Float64, float, float, float]:
    """Return whether there is a step, the step (k,), its standard errors (k,) and the bound of the first number.

    Then come the median absolute residual, and by how much the step moves residuals, in their sigmas, on average.
    A loop of its own: robust normal equations of a few numbers, from thousands of pixels.

    Parameters
    ----------
    residuals, bounds
        (n,) of the pixels.
    columns
        (n, k) derivatives of the residuals.
    prior
        (k,) reciprocal of each number's variance before the fit; 0 where it is free.
    prior_gradient
        (k,) gradient of the prior at the present numbers.
    to_sigma
        From the median absolute residual to a standard deviation.
    convex
        Whether residuals far out weigh less by Huber's weights instead of Cauchy's.
    """
    n, k = columns.shape
    median = median_of(np.abs(residuals))
    typical = to_sigma * median
    weights = np.empty(n)
    matrix, gradient = np.diag(prior), prior_gradient.copy()
    # Normal equations (J^T W J + prior) step = -(J^T W r + gradient of the prior); the lower triangle only.
    for i in range(n):
        sigma, size = max(bounds[i], typical), abs(residuals[i])
        # Huber: 1 / (sigma max(sigma, |r|)), Cauchy: 1 / (sigma^2 + r^2).
        weight = 1.0 / (sigma * max(sigma, size) if convex else sigma * sigma + size * size)
        weights[i] = weight
        row = columns[i]
        for a in range(k):
            weighted = weight * row[a]
            gradient[a] += weighted * residuals[i]
            for b in range(a + 1):
                matrix[a, b] += weighted * row[b]
    for a in range(k):
        for b in range(a):
            matrix[b, a] = matrix[a, b]
    if not inverted(matrix):
        return False, gradient, gradient, 0.0, median, 0.0
    inverse, errors, change = matrix, np.empty(k), np.zeros(k)
    for a in range(k):
        errors[a] = np.sqrt(max(inverse[a, a], 0.0))
        for b in range(k):
            change[a] -= inverse[a, b] * gradient[b]
    # Row 0 of (J^T W J)^-1 J^T W gives the first number from the residuals: all of them at their bounds is the worst.
    bound, moved = 0.0, 0.0
    for i in range(n):
        slope, move = 0.0, 0.0
        for a in range(k):
            slope += columns[i, a] * inverse[0, a]
            move += columns[i, a] * change[a]
        bound += abs(slope) * weights[i] * bounds[i]
        moved += abs(move) / max(bounds[i], typical)
    return True, change, errors, bound, median, moved / n


@njit(cache=True)
def inverted(matrix: Float64) -> bool:
    """Invert a symmetric matrix (k, k) in place; return whether it is positive definite, to rounding.

    It is scaled to a diagonal of ones first. Gauss and Jordan's steps by the diagonal, which such matrices need no
    exchange of rows for; numba's own inverse takes five seconds to compile.
    """
    k = len(matrix)
    scale = np.empty(k)
    for a in range(k):
        if not 0.0 < matrix[a, a] < np.inf:
            return False
        scale[a] = np.sqrt(matrix[a, a])
    for a in range(k):
        for b in range(k):
            matrix[a, b] /= scale[a] * scale[b]
    for step in range(k):
        pivot = matrix[step, step]
        if not pivot > 0.0:  # also where it is NaN
            return False
        matrix[step, step] = 1.0
        for b in range(k):
            matrix[step, b] /= pivot
        for a in range(k):
            if a != step:
                factor = matrix[a, step]
                matrix[a, step] = 0.0
                for b in range(k):
                    matrix[a, b] -= factor * matrix[step, b]
    for a in range(k):
        for b in range(k):
            matrix[a, b] /= scale[a] * scale[b]
    return True


@njit(cache=True)
def _compared_rows(
    residuals: Float64, bounds: Float64, by_value: Float64, by_twist: Float64, noise: Float64
) -> tuple[Float64, Float64, Float64]:
    """Return residuals (m,), bounds (m,) and derivatives by value and noise (m, 1 + k) of the compared pixels."""
    n, k = len(residuals), noise.shape[1]
    kept, limits, columns = np.empty(n), np.empty(n), np.empty((n, 1 + k))
    m = 0
    for i in range(n):
        if not (np.isfinite(residuals[i]) and np.isfinite(by_value[i])):
            continue
        kept[m], limits[m], columns[m, 0] = residuals[i], bounds[i], by_value[i]
        for a in range(k):
            along = 0.0
            for axis in range(6):
                along += by_twist[i, axis] * noise[axis, a]
            columns[m, 1 + a] = along
        m += 1
    return kept[:m], limits[:m], columns[:m]
