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

from fedora_qa.estimators.depth_image import DepthImage
from fedora_qa.estimators.depth_warp import DepthModel, Lattice, Warped, warp

Float64 = NDArray[np.float64]

Family = Callable[[float], DepthModel | None]
"""A parameter's value -> the model that it makes; None where there is none (no pose covers the instant)."""

FEWEST_PIXELS: Final = 50
"""Pixels below which two frames are not compared."""

_ITERATIONS: Final = 12
_CONVERGED: Final = 1e-4
"""A step of less than this share of its standard error is the last."""

_TO_SIGMA: Final = 1.4826
"""From the median absolute value to the standard deviation of a normal distribution."""


@dataclass(frozen=True, slots=True)
class DepthFit:
    """Two frames after the best correction.

    Attributes
    ----------
    value, standard_error, bound
        The parameter; its error where every pixel errs on its own; how far it may err where all err to their bounds
        in the worst direction. 0, infinite and 0 where no parameter was asked for.
    twist
        (6,) correction of the motion.
    warped
        The lattice after the correction.
    typical
        Median absolute residual.
    noise_square, noise_dof
        The twist against its declared covariance (chi-square), and how many of its directions the depth tells of.
    """

    value: float
    standard_error: float
    bound: float
    twist: Float64
    warped: Warped
    typical: float
    noise_square: float
    noise_dof: float


def noise_directions(covariance: Float64) -> Float64:
    """Return the twist (6, k) of each independent direction of the noise, one standard deviation long."""
    variances, directions = np.linalg.eigh(covariance)
    real = variances > 1e-12 * max(float(variances.max(initial=0.0)), 1e-300)
    return np.asarray(directions[:, real] * np.sqrt(variances[real]))


def fit_depth(
    family: Family, lattice: Lattice, image1: DepthImage, noise: Float64, *, start: float, step: float | None
) -> DepthFit | None:
    """Fit a parameter from ``start`` on, and the twist within its noise.

    Parameters
    ----------
    family
        What the parameter does.
    noise
        (6, k) as ``noise_directions`` gives them; (6, 0) where the motion is exact.
    step
        By which the parameter is changed to see its effect; None where only the twist is to be fitted.

    Returns
    -------
    DepthFit | None
        None where the frames share too few pixels, or the fit ends where no depth could be.
    """
    value, z, convex = start, np.zeros(noise.shape[1]), True
    for _ in range(_ITERATIONS):
        warped = _warped(family, value, noise @ z, lattice, image1)
        if warped is None:
            return None
        by_value = _by_value(family, value, step, noise @ z, lattice, image1)
        solved = _solve(warped, by_value, noise, z, convex=convex)
        if solved is None:
            return None
        change, errors, _ = solved
        value, z = value + change[0] * (step is not None), z + change[1:]
        if not convex and np.all(np.abs(change) <= _CONVERGED * errors):
            break
        convex = convex and bool(np.any(np.abs(change) > errors))
    return _concluded(family, value, step, z, noise, lattice, image1)


def _concluded(
    family: Family, value: float, step: float | None, z: Float64, noise: Float64, lattice: Lattice, image1: DepthImage
) -> DepthFit | None:
    warped = _warped(family, value, noise @ z, lattice, image1)
    if warped is None:
        return None
    solved = _solve(warped, _by_value(family, value, step, noise @ z, lattice, image1), noise, z)
    if solved is None:
        return None
    _, errors, bound = solved
    return DepthFit(
        value=value,
        standard_error=float(errors[0]) if step is not None else np.inf,
        bound=bound if step is not None else 0.0,
        twist=noise @ z,
        warped=warped,
        typical=float(np.nanmedian(np.abs(warped.residuals))),
        noise_square=float(z @ z),
        noise_dof=float(np.sum(1.0 - errors[1:] ** 2)),
    )


def _warped(family: Family, value: float, twist: Float64, lattice: Lattice, image1: DepthImage) -> Warped | None:
    model = family(value)
    if model is None or not model.conceivable or not np.all(np.isfinite(twist)):
        return None
    warped = warp(replace(model, motion=model.motion.corrected(twist)), lattice, image1)
    return warped if np.count_nonzero(np.isfinite(warped.residuals)) >= FEWEST_PIXELS else None


def _by_value(
    family: Family, value: float, step: float | None, twist: Float64, lattice: Lattice, image1: DepthImage
) -> Float64:
    """Return the residual's derivative by the parameter (n,); zero where nothing is to be fitted."""
    if step is None:
        return np.zeros(len(lattice.columns))
    ahead, behind = (_warped(family, value + side * step, twist, lattice, image1) for side in (1, -1))
    if ahead is None or behind is None:
        return np.full(len(lattice.columns), np.nan)
    return np.asarray((ahead.residuals - behind.residuals) / (2 * step))


def _solve(
    warped: Warped, by_value: Float64, noise: Float64, z: Float64, *, convex: bool = False
) -> tuple[Float64, Float64, float] | None:
    """Return the step of (parameter, z), their standard errors, and the bound of the parameter's systematic error.

    Residuals far beyond the typical one weigh less (Cauchy's weights), so that single places do not lead. Far from the
    solution these may hold on to a part of the image; Huber's (``convex``) have one minimum only.
    """
    known = np.isfinite(warped.residuals) & np.isfinite(by_value)
    if np.count_nonzero(known) < FEWEST_PIXELS:
        return None
    residuals, bounds = warped.residuals[known], warped.bounds[known]
    sigmas = np.maximum(bounds, _TO_SIGMA * float(np.median(np.abs(residuals))))
    sizes = np.abs(residuals)
    weights = 1.0 / (sigmas * np.maximum(sigmas, sizes) if convex else sigmas**2 + sizes**2)
    columns = np.column_stack((by_value[known], warped.by_twist[known] @ noise))
    held = np.ones(columns.shape[1])
    held[0] = 0.0 if np.any(columns[:, 0]) else 1.0
    matrix = (columns * weights[:, None]).T @ columns + np.diag(held)
    scale = np.sqrt(np.diag(matrix))
    if not np.all(np.isfinite(matrix)) or np.any(scale <= 0):
        return None
    inverse = np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
    gradient = (columns * weights[:, None]).T @ residuals
    gradient[1:] += z
    errors = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    row = (columns @ inverse[0]) * weights
    return -inverse @ gradient, errors, float(np.sum(np.abs(row) * bounds))
