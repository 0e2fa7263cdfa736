"""Fit one parameter of how two depth frames hang together, the camera's motion being known up to its noise.

The residual of each pixel is linear in the parameter and in the error of the motion's twist to good accuracy
(point-to-plane registration: Y. Chen, G. Medioni, "Object modelling by registration of multiple range images", Image
and Vision Computing 10 (1992)). The twist is held by its declared covariance, so that what the file's pose noise can
explain is not taken for a fault.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import DepthImage
from fedora_qa.estimators.depth.pair_fit_kernels import known_rows, weighted_step
from fedora_qa.estimators.depth.warp import DepthModel, Lattice, ModelNumber, Warped, residuals_after, warp
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
changes in the residuals is not looked at. (Where nothing holds a direction its error is large, and tells little.)
"""


@dataclass(frozen=True, slots=True)
class DepthFit:
    """Two frames after the best correction.

    Attributes
    ----------
    value, standard_error, bound
        The parameter; its error where every pixel errs on its own; how far it may err where all err to their bounds
        in the worst direction. 0, infinite and 0 where no parameter was asked for.
    twist, parts
        (6,) correction of the motion, and (k,) how much of each direction of its noise it has.
    warped
        The lattice after the correction.
    typical, typical_bound
        Median absolute residual, and the median of what it may honestly be.
    noise_square, noise_dof
        The twist against its declared covariance (chi-square), and how many of its directions the depth tells of.
    """

    value: float
    standard_error: float
    bound: float
    twist: Float64
    parts: Float64
    warped: Warped
    typical: float
    typical_bound: float
    noise_square: float
    noise_dof: float

    @property
    def agrees(self) -> bool:
        """Whether most pixels deviate by no more than they may."""
        return self.typical <= self.typical_bound


def noise_directions(covariance: Float64) -> Float64:
    """Return the twist (6, k) of each independent direction of the noise, one standard deviation long."""
    if not covariance.any():
        return np.empty((len(covariance), 0))
    variances, directions = np.linalg.eigh(covariance)
    real = variances > 1e-12 * max(float(variances.max(initial=0.0)), 1e-300)
    return np.asarray(directions[:, real] * np.sqrt(variances[real]))


def fit_depth(
    family: Family,
    lattice: Lattice,
    image1: DepthImage,
    noise: Float64,
    *,
    start: float,
    step: float | ModelNumber | None,
    parts: Float64 | None = None,
) -> DepthFit | None:
    """Fit a parameter from ``start`` on, and the twist within its noise.

    Parameters
    ----------
    family
        What the parameter does.
    noise
        (6, k) as ``noise_directions`` gives them; (6, 0) where the motion is exact.
    step
        By which the parameter is changed to see its effect, or the number of the model that it is; None where only the
        twist is to be fitted.
    parts
        (k,) how much of each direction of the noise the twist begins with; none of any where None.

    Returns
    -------
    DepthFit | None
        None where the frames share too few pixels, or the fit ends where no depth could be.

    Notes
    -----
    Where little holds some directions of the twist (one plane, no noise declared) the steps along them need not end:
    so far off, the twist is less linear than the depths are rounded. Then the best of all twists is taken.
    """
    problem = _Problem(family, lattice, image1, noise, step)
    value, z, convex = start, np.zeros(noise.shape[1]) if parts is None else parts, True
    visited: list[tuple[float, float, Float64]] = []
    for _ in range(_ITERATIONS if step is not None or len(z) else 0):
        solved = problem.solved(value, z, convex=convex)
        if solved is None:
            return None
        if not convex:
            visited.append((solved.typical, value, z))
        change = np.abs(solved.change)
        value, z = value + solved.change[0] * (step is not None), z + solved.change[1:]
        if not convex and solved.moved <= _CONVERGED and np.all(change <= _CONVERGED * solved.errors):
            return _concluded(solved, value, z, noise, step)
        convex = convex and bool(np.any(change > solved.errors))
    last = problem.solved(value, z)
    best = min(visited, key=lambda one: one[0], default=None)
    if best is not None and last is not None and best[0] < last.typical:
        _, value, z = best
        last = problem.solved(value, z)
    return None if last is None else _concluded(last, value, z, noise, step)


@dataclass(frozen=True, slots=True)
class _Solved:
    """A step of (parameter, z), their standard errors, and the bound of the parameter's systematic error.

    ``typical`` is the median absolute residual before the step, ``moved`` by how many sigmas of theirs it moves
    residuals on average.
    """

    warped: Warped
    change: Float64
    errors: Float64
    bound: float
    typical: float
    moved: float


@dataclass(frozen=True, slots=True)
class _Problem:
    """What ``fit_depth`` is asked for."""

    family: Family
    lattice: Lattice
    image1: DepthImage
    noise: Float64
    step: float | ModelNumber | None

    def solved(self, value: float, z: Float64, *, convex: bool = False) -> _Solved | None:
        """Return the step from a parameter and a twist; None where there is none."""
        linear = _linearised(self.family, value, self.step, self.noise @ z, self.lattice, self.image1)
        return None if linear is None else _solve(*linear, self.noise, z, convex=convex)


def _concluded(last: _Solved, value: float, z: Float64, noise: Float64, step: float | ModelNumber | None) -> DepthFit:
    return DepthFit(
        value=value,
        standard_error=float(last.errors[0]) if step is not None else np.inf,
        bound=last.bound if step is not None else 0.0,
        twist=noise @ z,
        parts=z,
        warped=last.warped,
        typical=last.typical,
        typical_bound=median_of(last.warped.bounds[np.isfinite(last.warped.bounds)]),
        noise_square=float(z @ z),
        noise_dof=float(np.sum(1.0 - last.errors[1:] ** 2)),
    )


def _linearised(
    family: Family,
    value: float,
    step: float | ModelNumber | None,
    twist: Float64,
    lattice: Lattice,
    image1: DepthImage,
) -> tuple[Warped, Float64] | None:
    """Return the warped lattice, and the residual's derivative by the parameter (n,): 0 where none is to be fitted."""
    if not np.all(np.isfinite(twist)):
        return None
    correct = _correction(twist)
    model = family(value)
    if model is None or not model.conceivable:
        return None
    known = step if isinstance(step, str) else None
    warped = warp(correct(model), lattice, image1, known)
    if warped.seen < FEWEST_PIXELS:
        return None
    if step is None or isinstance(step, str):
        return warped, warped.by_number
    sides = [family(value + side * step) for side in (1, -1)]
    ahead, behind = (
        residuals_after(correct(side), lattice, image1) if side is not None and side.conceivable else None
        for side in sides
    )
    if ahead is None or behind is None:
        return None
    return warped, (ahead - behind) / (2 * step)


def _correction(twist: Float64) -> Callable[[DepthModel], DepthModel]:
    """Return how a model is corrected by a twist (6,): ``RigidMotion.corrected``, its rotation reckoned once."""
    if not twist.any():
        return lambda model: model
    dR, shift_m = so3.exp(twist[:3]), twist[3:]

    def corrected(model: DepthModel) -> DepthModel:
        motion = RigidMotion(dR @ model.motion.R, dR @ model.motion.t_m + shift_m)
        return replace(model, motion=motion)

    return corrected


def _solve(warped: Warped, by_value: Float64, noise: Float64, z: Float64, *, convex: bool = False) -> _Solved | None:
    """Return the step of (parameter, z) with its errors.

    Residuals far beyond the typical one weigh less (Cauchy's weights), so that single places do not lead. Far from the
    solution these may hold on to a part of the image; Huber's (``convex``) have one minimum only.
    """
    residuals, bounds, columns = known_rows(warped.residuals, warped.bounds, by_value, warped.by_twist, noise)
    if len(residuals) < FEWEST_PIXELS:
        return None
    held = np.ones(columns.shape[1])
    held[0] = 0.0 if np.any(columns[:, 0]) else 1.0
    pull = np.concatenate(([0.0], z))
    step = weighted_step(residuals, bounds, columns, held, pull, MAD_TO_SIGMA, convex)
    return _Solved(warped, *step[1:]) if step[0] else None
