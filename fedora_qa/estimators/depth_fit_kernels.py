"""A compiled step of the fit of two depth frames: robust equations of a few numbers, from thousands of pixels."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

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
) -> tuple[bool, Float64, Float64, float, float]:
    """Return whether there is a step, the step (k,), its standard errors (k,) and the bound of the first number.

    Last comes the median absolute residual.

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
    middle = np.median(np.abs(residuals))
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
    scale = np.sqrt(np.diag(matrix))
    if not np.all(np.isfinite(matrix)) or np.any(scale <= 0.0):
        return False, gradient, gradient, 0.0, middle
    inverse = np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
    errors = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    bound = 0.0
    for i in range(n):
        slope = 0.0
        for a in range(k):
            slope += columns[i, a] * inverse[0, a]
        bound += abs(slope) * weights[i] * bounds[i]
    return True, -(inverse @ gradient), errors, bound, middle


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
            medians[group], others[group] = np.median(of_first[start:stop]), np.median(of_second[start:stop])
    return medians, others
