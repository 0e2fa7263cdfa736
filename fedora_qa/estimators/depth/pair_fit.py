"""Fit one parameter of two depth frames, where the motion of the camera between them is known up to its noise.

The residual of each pixel is nearly linear in the parameter and in the error of the twist of the motion (point-to-plane
registration: Y. Chen, G. Medioni, "Object modelling by registration of multiple range images", Image and Vision
Computing 10 (1992)). The declared covariance of the twist is its prior, so that deviations which the pose noise of the
file can explain do not count as a fault.
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
"""Returns the model for a value of the parameter; None where there is none (no pose covers the instant)."""

FEWEST_PIXELS: Final = 50
"""Least number of pixels that can be compared. Two frames with fewer are not compared."""

_ITERATIONS: Final = 24
_CONVERGED: Final = 1e-3
"""Largest last step, as a share of its standard error; also the largest change of the residuals by it, in sigmas.

Each step is a hundredth to a thousandth of the step before, so that at most 1e-5 of the error remains. The residuals
are not computed again after the last step. Their change counts as well, because the standard error of a direction that
the data do not constrain is large.
"""


@dataclass(frozen=True, slots=True)
class DepthFit:
    """Two depth frames after the best correction.

    Attributes
    ----------
    value, standard_error, bound
        The parameter; its standard error where the errors of the pixels are independent; its error where all pixels err
        by their bounds in the worst direction. In the unit of the parameter. Without a parameter they are the start,
        infinite and 0.
    twist, coefficients
        (6,) correction of the motion (rad, then m), and (k,) its coefficients along the directions of the noise, in
        standard deviations.
    warped
        The lattice in the second frame after the correction; its last step, which is below ``_CONVERGED``, is left out.
    typical, typical_bound
        Median absolute residual, and median of the bounds of the residuals; shares of the depth.
    noise_square, noise_dof
        Chi squared of the twist under its declared covariance, and the number of its directions that the depths
        constrain.
    value_by_twist
        (6,) change of the parameter by an error of the motion (rad, then m) that the fit does not know; 0 without a
        parameter.
    motion_left
        (6, 6) what the fit leaves of a further error of the motion (rad, then m): the identity where it fits less than
        all six directions.
    converged
        Whether the steps ended.
    twist_step
        (6,) last step of the twist (rad, then m), which ``warped`` does not include: how far a fit that did not
        converge may be from the solution.
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
    value_by_twist: Float64
    motion_left: Float64
    converged: bool
    twist_step: Float64

    @property
    def agrees(self) -> bool:
        """Whether the median residual is within the median of its bounds."""
        return self.typical <= self.typical_bound

    @property
    def agreeing(self) -> int:
        """Number of pixels whose residual is within its bound."""
        return int(np.count_nonzero(np.abs(self.warped.residuals) <= self.warped.bounds))


def noise_directions(covariance: Float64) -> Float64:
    """Return the independent directions of the noise of a twist, each one standard deviation long.

    Parameters
    ----------
    covariance
        (6, 6) covariance of the twist: rad, then m.

    Returns
    -------
    Float64
        (6, k) one direction in each column. Directions whose variance is at most 1e-12 of the largest are left out.
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
) -> DepthFit | None:
    """Fit a parameter, and the twist of the motion within its noise, by Gauss-Newton steps.

    Parameters
    ----------
    family
        Returns the model of the frames for a value of the parameter.
    lattice, image1
        Pixels of the first frame, and the second frame.
    noise
        (6, k) directions of the noise, from ``noise_directions``; (6, 0) where the motion is exact.
    start
        First value of the parameter.
    step
        Change of the parameter for central differences, in its unit; or the name of the number of the model that the
        parameter is, for which derivatives are known. None where only the twist is fitted.

    Returns
    -------
    DepthFit | None
        None where the frames share too few pixels, or the fit leaves the models that are conceivable.

    Notes
    -----
    Where the depths hardly constrain some directions of the twist (one plane, no noise declared), the steps along them
    need not converge: so far from the solution, the nonlinearity of the twist exceeds the rounding of the depths. Then
    the twist with the least median residual is taken.

    A twist of several pixels changes which surface a pixel meets: then the steps of the linearised equations may lead
    back and forth across the solution. Those that do are relaxed.
    """
    problem = _FitProblem(family, lattice, image1, noise, step)
    value, z = start, np.zeros(noise.shape[1])
    # Far from the solution: Huber's convex loss, which has only one minimum. Near it: Cauchy's, which is more robust.
    convex = True
    visited: list[tuple[float, float, Float64]] = []
    previous = np.zeros(1 + len(z))
    iterations = _ITERATIONS if step is not None or len(z) else 0
    for _ in range(iterations):
        solution = problem.step_from(value, z, convex=convex)
        if solution is None:
            return None
        if not convex:
            visited.append((solution.typical, value, z))
        taken = _relaxed(solution.change, previous, solution.errors)
        previous, change = taken, np.abs(solution.change)
        value, z = value + taken[0] * (step is not None), z + taken[1:]
        if not convex and solution.moved <= _CONVERGED and np.all(change <= _CONVERGED * solution.errors):
            return _fit_from(solution, value, z, noise, step, converged=True)
        convex = convex and bool(np.any(change > solution.errors))
    last = problem.step_from(value, z)
    best = min(visited, key=lambda visit: visit[0], default=None)
    if best is not None and last is not None and best[0] < last.typical:
        _, value, z = best
        last = problem.step_from(value, z)
    return None if last is None else _fit_from(last, value, z, noise, step, converged=iterations == 0)


@dataclass(frozen=True, slots=True)
class _FitStep:
    """A Gauss-Newton step of the parameter and of the coefficients z (k,) of the twist.

    Attributes
    ----------
    warped
        The lattice before the step.
    change, covariance
        (1 + k,) the step and (1 + k, 1 + k) the covariance, the parameter first.
    bound
        Bound on the systematic error of the parameter.
    by_twist
        (6,) change of the parameter by an error of the motion.
    typical
        Median absolute residual before the step.
    moved
        Mean absolute change of the residuals by the step, in their sigmas.
    """

    warped: WarpedLattice
    change: Float64
    covariance: Float64
    bound: float
    by_twist: Float64
    typical: float
    moved: float

    @property
    def errors(self) -> Float64:
        """(1 + k,) standard errors, the parameter first."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))


@dataclass(frozen=True, slots=True)
class _FitProblem:
    """The arguments of ``fit_depth``."""

    family: Family
    lattice: DepthLattice
    image1: DepthImage
    noise: Float64
    step: float | ModelNumber | None

    def step_from(self, value: float, z: Float64, *, convex: bool = False) -> _FitStep | None:
        """Return the step from a parameter and a twist.

        Residuals far beyond the typical residual have small weights (Cauchy), so that a few places do not determine the
        step. Far from the solution Cauchy's weights can select a wrong part of the image.

        Parameters
        ----------
        value
            The parameter.
        z
            (k,) coefficients of the twist along the directions of the noise, in standard deviations.
        convex
            Whether Huber's weights replace Cauchy's: their loss has only one minimum.

        Returns
        -------
        _FitStep | None
            None where too few pixels are compared, the model is not conceivable, or the equations are singular.
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
        # Derivative of the residual by the parameter (n,): 0 where no parameter is fitted.
        value_derivatives = warped.number_derivatives
        if self.step is not None and not isinstance(self.step, str):
            # dr/dp = (r(p + h) - r(p - h)) / (2 h)
            ahead, behind = (
                residuals_after(correct(side), self.lattice, self.image1)
                if side is not None and side.conceivable
                else None
                for side in (self.family(value + sign * self.step) for sign in (1, -1))
            )
            if ahead is None or behind is None:
                return None
            value_derivatives = (ahead - behind) / (2 * self.step)
        # The order of axes of the noise depends on where it comes from; the loop is compiled for one.
        residuals, bounds, columns, twists = _compared_rows(
            warped.residuals,
            warped.bounds,
            value_derivatives,
            warped.twist_derivatives,
            np.ascontiguousarray(self.noise),
        )
        if len(residuals) < FEWEST_PIXELS:
            return None
        # The prior variance of z is 1. The parameter is free; it is fixed where no residual depends on it.
        prior = np.ones(columns.shape[1])
        prior[0] = 0.0 if np.any(columns[:, 0]) else 1.0
        prior_gradient = np.concatenate(([0.0], z))
        step = _weighted_step(residuals, bounds, columns, twists, prior, prior_gradient, MAD_TO_SIGMA, convex)
        return _FitStep(warped, *step[1:]) if step[0] else None


def _relaxed(step: Float64, previous: Float64, errors: Float64) -> Float64:
    """Return a step that leads to where the steps vanish, if it goes back by more than half of the previous one.

    Along a line, steps s at 0 and -c s at s vanish at s / (1 + c), by linear interpolation (the secant method). That is
    1 / (1 + c) of the second step.

    Parameters
    ----------
    step, previous
        (k,) the step of the linearised equations, and the one that was taken before; 0 without one.
    errors
        (k,) standard errors of the numbers, by which lengths are measured.
    """
    scaled, scaled_before = step / errors, previous / errors
    length, length_before = np.linalg.norm(scaled), np.linalg.norm(scaled_before)
    # Steps that are halved from one to the next converge.
    if scaled @ scaled_before >= 0 or length <= length_before / 2:
        return step
    return np.asarray(step * length_before / (length_before + length))


def _fit_from(
    last: _FitStep, value: float, z: Float64, noise: Float64, step: float | ModelNumber | None, *, converged: bool
) -> DepthFit:
    return DepthFit(
        value=value,
        standard_error=float(last.errors[0]) if step is not None else np.inf,
        bound=last.bound if step is not None else 0.0,
        twist=noise @ z,
        coefficients=z,
        warped=last.warped,
        typical=last.typical,
        typical_bound=last.warped.typical_bound,
        noise_square=float(z @ z),
        # A direction counts by the part of its prior variance of 1 that the depths remove: sum (1 - error^2).
        noise_dof=float(np.sum(1.0 - last.errors[1:] ** 2)),
        value_by_twist=last.by_twist,
        motion_left=_motion_left(noise, last.covariance[1:, 1:]),
        converged=converged,
        twist_step=noise @ last.change[1:],
    )


def _motion_left(noise: Float64, covariance: Float64) -> Float64:
    """Return what a fit of the twist leaves of a further error e of the motion, to first order, as a (6, 6) matrix.

    With residuals ``J (e + N z)``, weights W and the prior of z, the fit has ``z = -C N^T J^T W J e``, where
    ``C = (N^T J^T W J N + 1)^-1`` is the covariance of z. Where the directions N (6, 6) of the noise span all errors,
    ``e = N f``, so that ``z = -(1 - C) f``, and ``e + N z = N C N^-1 e`` is left.
    """
    if noise.shape != (6, 6):
        return np.eye(6)
    return np.asarray(noise @ covariance @ np.linalg.inv(noise))


def _correction(twist: Float64) -> Callable[[DepthModel], DepthModel]:
    """Return the function that corrects models by a twist (6,), as ``RigidMotion.corrected`` does."""
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
    twists: Float64,
    prior: Float64,
    prior_gradient: Float64,
    to_sigma: float,
    convex: bool,
) -> tuple[bool, Float64, Float64, float, Float64, float, float]:
    """Return a step of robust normal equations of k numbers, from n pixels.

    Parameters
    ----------
    residuals, bounds
        (n,) residuals of the pixels, and bounds of them.
    columns
        (n, k) derivatives of the residuals by the numbers.
    twists
        (n, 6) derivatives of the residuals by the twist of the motion.
    prior
        (k,) reciprocal of the prior variance of each number; 0 where it is free.
    prior_gradient
        (k,) gradient of the prior at the present numbers.
    to_sigma
        Ratio of the standard deviation to the median absolute residual.
    convex
        Whether large residuals have Huber's weights instead of Cauchy's.

    Returns
    -------
    solved
        False where the equations are singular.
    change, covariance
        (k,) the step and (k, k) the covariance of the numbers.
    bound
        Error of the first number where all residuals are at their bounds in the worst direction.
    by_twist
        (6,) change of the first number by an error of the motion.
    median
        Median absolute residual.
    moved
        Mean absolute change of the residuals by the step, in their sigmas.
    """
    n, k = columns.shape
    median, by_twist = median_of(np.abs(residuals)), np.zeros(6)
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
        return False, gradient, matrix, 0.0, by_twist, median, 0.0
    inverse, change = matrix, np.zeros(k)
    for a in range(k):
        for b in range(k):
            change[a] -= inverse[a, b] * gradient[b]
    # The first number is row 0 of (J^T W J + prior)^-1 J^T W times the residuals: bound = sum |row| bounds.
    # An error e of the motion adds J_twist e to the residuals, and moves the number by -row J_twist e.
    bound, moved = 0.0, 0.0
    for i in range(n):
        slope, move = 0.0, 0.0
        for a in range(k):
            slope += columns[i, a] * inverse[0, a]
            move += columns[i, a] * change[a]
        bound += abs(slope) * weights[i] * bounds[i]
        for axis in range(6):
            by_twist[axis] -= slope * weights[i] * twists[i, axis]
        moved += abs(move) / max(bounds[i], typical)
    return True, change, inverse, bound, by_twist, median, moved / n


@njit(cache=True)
def inverted(matrix: Float64) -> bool:
    """Invert a symmetric matrix in place, and return whether it is positive definite.

    The matrix is first scaled to a unit diagonal. Gauss-Jordan elimination with pivots on the diagonal follows:
    positive definite matrices need no exchange of rows. Numba's own inverse takes 5 s to compile.

    Parameters
    ----------
    matrix
        (k, k) symmetric; replaced by its inverse.

    Returns
    -------
    bool
        False where the matrix is not positive definite, to rounding; its values are then undefined.
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
) -> tuple[Float64, Float64, Float64, Float64]:
    """Return residuals (m,), bounds (m,) and derivatives (m, 1 + k) and (m, 6) of the m compared pixels of n.

    The derivatives are those by the parameter, then by the coefficients of the k directions of the noise (6, k); and
    those by the twist.
    """
    n, k = len(residuals), noise.shape[1]
    kept, limits, columns, twists = np.empty(n), np.empty(n), np.empty((n, 1 + k)), np.empty((n, 6))
    m = 0
    for i in range(n):
        if not (np.isfinite(residuals[i]) and np.isfinite(by_value[i])):
            continue
        kept[m], limits[m], columns[m, 0], twists[m] = residuals[i], bounds[i], by_value[i], by_twist[i]
        for a in range(k):
            along = 0.0
            for axis in range(6):
                along += by_twist[i, axis] * noise[axis, a]
            columns[m, 1 + a] = along
        m += 1
    return kept[:m], limits[:m], columns[:m], twists[:m]
