"""A compiled step of the fit of two depth frames: robust equations of a few numbers, from thousands of pixels."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.quantile_kernels import median_of

Float64 = NDArray[np.float64]


@njit(cache=True)
def weighted_step(
    residuals: Float64,
    bounds: Float64,
    columns: Float64,
    held: Float64,
    pull: Float64,
    to_sigma: float,
    convex: bool,
) -> tuple[bool, Float64, Float64, float, float, float]:
    """Return whether there is a step, the step (k,), its standard errors (k,) and the bound of the first number.

    Then come the median absolute residual, and by how much the step moves residuals, in their sigmas, on average.

    Parameters
    ----------
    residuals, bounds
        (n,) of the pixels.
    columns
        (n, k) derivatives of the residuals.
    held
        (k,) by how much each number is held, as the reciprocal of a variance.
    pull
        (k,) gradient of what holds it.
    to_sigma
        From the median absolute residual to a standard deviation.
    convex
        Whether residuals far out weigh less by Huber's weights instead of Cauchy's.
    """
    n, k = columns.shape
    middle = median_of(np.abs(residuals))
    typical = to_sigma * middle
    weights = np.empty(n)
    matrix, gradient = np.diag(held), pull.copy()
    for i in range(n):
        sigma, size = max(bounds[i], typical), abs(residuals[i])
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
        return False, gradient, gradient, 0.0, middle, 0.0
    inverse, errors, change = matrix, np.empty(k), np.zeros(k)
    for a in range(k):
        errors[a] = np.sqrt(max(inverse[a, a], 0.0))
        for b in range(k):
            change[a] -= inverse[a, b] * gradient[b]
    bound, moved = 0.0, 0.0
    for i in range(n):
        slope, move = 0.0, 0.0
        for a in range(k):
            slope += columns[i, a] * inverse[0, a]
            move += columns[i, a] * change[a]
        bound += abs(slope) * weights[i] * bounds[i]
        moved += abs(move) / max(bounds[i], typical)
    return True, change, errors, bound, middle, moved / n


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
def known_rows(
    residuals: Float64, bounds: Float64, by_value: Float64, by_twist: Float64, noise: Float64
) -> tuple[Float64, Float64, Float64]:
    """Return residuals (m,), bounds (m,) and derivatives by value and noise (m, 1 + k) of the pixels that are known."""
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


@njit(cache=True)
def medians_by_group(
    first: Float64, second: Float64, groups: NDArray[np.uint8], count: int, fewest: int
) -> tuple[Float64, Float64]:
    """Return the medians (count,) of two columns (n,) by group; NaN in groups of fewer than ``fewest``."""
    ends = np.zeros(count + 1, np.int64)
    for group in groups:
        ends[group + 1] += 1
    ends = np.cumsum(ends)
    places, of_first, of_second = ends[:-1].copy(), np.empty(len(first)), np.empty(len(first))
    for i in range(len(groups)):
        place = places[groups[i]]
        of_first[place], of_second[place] = first[i], second[i]
        places[groups[i]] = place + 1
    medians, others = np.full(count, np.nan), np.full(count, np.nan)
    for group in range(count):
        start, stop = ends[group], ends[group + 1]
        if stop - start >= max(fewest, 1):
            medians[group], others[group] = median_of(of_first[start:stop]), median_of(of_second[start:stop])
    return medians, others
