"""Compiled fit of a field's tiles: their robust mean, and the normal equations of templates."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.quantile_kernels import median_of

Float64 = NDArray[np.float64]


@njit(cache=True)
def robust_mean(
    errors_px: Float64, covariances_px2: Float64, most: float, iterations: int
) -> tuple[Float64, Float64, Float64, Float64]:
    """Return the mean (2,) of errors (n, 2), its information (2, 2), that of each (n, 3), and deviations (n,) from it.

    Covariances are (n, 2, 2). Errors that deviate by more than ``most`` standard errors are weighted down after Huber,
    from the median on, so many times. The information of each, of u, of both and of v, is so weighted; deviations are
    from the mean before the last.
    """
    count = len(errors_px)
    stated, weighted = np.empty((count, 3)), np.empty((count, 3))
    for i in range(count):
        of_u, of_v, both = covariances_px2[i, 0, 0], covariances_px2[i, 1, 1], covariances_px2[i, 0, 1]
        determinant = of_u * of_v - both * both
        stated[i, 0], stated[i, 1], stated[i, 2] = of_v / determinant, -both / determinant, of_u / determinant
    mean_px = np.array([median_of(errors_px[:, 0].copy()), median_of(errors_px[:, 1].copy())])
    deviations, matrix = np.zeros(count), np.zeros((2, 2))
    for _ in range(iterations):
        uu = uv = vv = to_u = to_v = 0.0
        for i in range(count):
            u, v = errors_px[i, 0] - mean_px[0], errors_px[i, 1] - mean_px[1]
            square = stated[i, 0] * u * u + 2 * stated[i, 1] * u * v + stated[i, 2] * v * v
            deviations[i] = np.sqrt(max(square, 0.0))
            weight = min(1.0, most / max(deviations[i], 1e-12))
            for k in range(3):
                weighted[i, k] = weight * stated[i, k]
            uu += weighted[i, 0]
            uv += weighted[i, 1]
            vv += weighted[i, 2]
            to_u += weighted[i, 0] * errors_px[i, 0] + weighted[i, 1] * errors_px[i, 1]
            to_v += weighted[i, 1] * errors_px[i, 0] + weighted[i, 2] * errors_px[i, 1]
        matrix[0, 0], matrix[0, 1], matrix[1, 0], matrix[1, 1] = uu, uv, uv, vv
        determinant = uu * vv - uv * uv
        mean_px[0], mean_px[1] = (vv * to_u - uv * to_v) / determinant, (uu * to_v - uv * to_u) / determinant
    return mean_px, matrix, weighted, deviations


@njit(cache=True)
def normal_equations(errors_px: Float64, information: Float64, templates: Float64) -> tuple[Float64, Float64, float]:
    """Return the matrix (m, m), the vector (m,) and the squares of the least squares of templates (n, 2, m).

    Of errors (n, 2) with information (n, 3): of u, of both, and of v.
    """
    size = templates.shape[2]
    matrix, vector, total = np.zeros((size, size)), np.zeros(size), 0.0
    for i in range(len(errors_px)):
        uu, uv, vv = information[i, 0], information[i, 1], information[i, 2]
        of_u, of_v, u, v = templates[i, 0], templates[i, 1], errors_px[i, 0], errors_px[i, 1]
        by_u, by_v = uu * u + uv * v, uv * u + vv * v
        total += u * by_u + v * by_v
        for a in range(size):
            vector[a] += of_u[a] * by_u + of_v[a] * by_v
            along_u, along_v, line = uu * of_u[a] + uv * of_v[a], uv * of_u[a] + vv * of_v[a], matrix[a]
            for b in range(size):
                line[b] += along_u * of_u[b] + along_v * of_v[b]
    return matrix, vector, total
