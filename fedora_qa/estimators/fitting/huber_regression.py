"""Robust regression by Huber's M-estimate (P. J. Huber, "Robust estimation of a location parameter", 1964)."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA

Float64 = NDArray[np.float64]

HUBER_K = 1.345
"""Standard deviations beyond which a residual has a smaller weight. The estimate is 95% efficient for normal errors
(P. W. Holland and R. E. Welsch, Commun. Stat. A 6 (1977) 813)."""

_ITERATIONS = 8
_FEW_ROWS = 4096
"""Number of rows beyond which NumPy computes the median faster than the compiled loop."""

_SINGULAR = 1e-13
"""Ratio of a pivot to its diagonal element below which the pivot is rounding, and the equations are singular."""


def huber_regression_weights(X: Float64, y: Float64) -> Float64:
    """Return the weights of Huber's M-estimate of y = X theta, by iterated least squares.

    Parameters
    ----------
    X
        (m, k) regressors.
    y
        (m,) values.

    Returns
    -------
    Float64
        (m,) weights from 0 to 1; 1 where the residual is within ``HUBER_K`` standard deviations. The standard deviation
        is 1.4826 times the median absolute residual.
    """
    weights, residual = np.ones(len(y)), np.empty(len(y))
    if not len(y) or (len(y) <= _FEW_ROWS and huber(X, y, HUBER_K, _ITERATIONS, weights)):
        return weights
    weights[:], middle = 1.0, len(y) // 2
    matrix, vector = np.empty((X.shape[1], X.shape[1])), np.empty(X.shape[1])
    weigh(X, y, weights, matrix, vector)
    for iteration in range(_ITERATIONS):
        theta = np.empty(len(vector))
        if not solve(matrix, vector, theta):
            # Singular equations have many solutions: the one of least norm is taken.
            theta = np.asarray(np.linalg.lstsq(matrix, vector, rcond=None)[0], np.float64)
        residuals(X, y, theta, residual)
        # numpy.median partitions at both middle values, which takes eight times as long.
        parted = np.partition(residual, middle)
        below = parted[middle] if len(y) % 2 else parted[:middle].max()
        # sigma = MAD_TO_SIGMA times the median of |r| (Hampel 1974): the mean of both middle values if m is even.
        scale = MAD_TO_SIGMA * 0.5 * float(below + parted[middle])
        # Half of the rows or more fit exactly: residuals have no scale, and the weights stay as they are.
        if scale == 0.0:
            break
        # w = min(1, k sigma / |r|) (Huber 1964).
        np.minimum(1.0, HUBER_K * scale / np.maximum(residual, 1e-300), out=weights)
        if iteration + 1 < _ITERATIONS:
            weigh(X, y, weights, matrix, vector)
    return weights


@njit(cache=True)
def huber(X: Float64, y: Float64, tuning: float, iterations: int, weights: Float64) -> bool:
    """Compute the weights of Huber's M-estimate of y = X theta, by iterated least squares.

    Parameters
    ----------
    X
        (m, k) regressors.
    y
        (m,) values.
    tuning
        Residuals within so many standard deviations have the weight 1. The standard deviation is 1.4826 times the
        median absolute residual.
    iterations
        Number of weighted fits.
    weights
        (m,) receives the weights, 0 to 1.

    Returns
    -------
    bool
        False where the equations are singular: the weights are then undefined.
    """
    parameters = X.shape[1]
    matrix, vector, theta = np.empty((parameters, parameters)), np.empty(parameters), np.empty(parameters)
    residual = np.empty(len(y))
    weights[:] = 1.0
    for _ in range(iterations):
        weigh(X, y, weights, matrix, vector)
        if not solve(matrix, vector, theta):
            return False
        residuals(X, y, theta, residual)
        scale = MAD_TO_SIGMA * median_of(residual)
        if scale == 0.0:
            return True
        for i in range(len(y)):
            # w = min(1, k sigma / |r|) (Huber 1964).
            weights[i] = min(1.0, tuning * scale / max(residual[i], 1e-300))
    return True


@njit(cache=True)
def weigh(X: Float64, y: Float64, weights: Float64, matrix: Float64, vector: Float64) -> None:
    """Compute the weighted normal equations of y = X theta.

    Parameters
    ----------
    X
        (m, k) regressors.
    y
        (m,) values.
    weights
        (m,) weights, the diagonal of W.
    matrix
        (k, k) receives X'WX.
    vector
        (k,) receives X'Wy.
    """
    parameters = X.shape[1]
    matrix[:], vector[:] = 0.0, 0.0
    for i in range(len(y)):
        for j in range(parameters):
            weighted = weights[i] * X[i, j]
            vector[j] += weighted * y[i]
            for k in range(j + 1):
                matrix[j, k] += weighted * X[i, k]
    for j in range(parameters):
        for k in range(j):
            matrix[k, j] = matrix[j, k]


@njit(cache=True)
def residuals(X: Float64, y: Float64, theta: Float64, residual: Float64) -> None:
    """Compute the absolute residuals of y = X theta.

    Parameters
    ----------
    X
        (m, k) regressors.
    y
        (m,) values.
    theta
        (k,) parameters.
    residual
        (m,) receives |y - X theta|.
    """
    for i in range(len(y)):
        difference = y[i]
        for j in range(X.shape[1]):
            difference -= X[i, j] * theta[j]
        residual[i] = abs(difference)


@njit(cache=True)
def solve(matrix: Float64, vector: Float64, theta: Float64) -> bool:
    """Solve normal equations by Gaussian elimination.

    Parameters
    ----------
    matrix
        (k, k) symmetric, positive definite; not changed.
    vector
        (k,) right side.
    theta
        (k,) receives the solution.

    Returns
    -------
    bool
        False where the equations are singular; ``theta`` is then undefined.
    """
    k = len(vector)
    reduced = matrix.copy()
    # Element by element: of two slices Numba compiles a message for unequal sizes, which takes it seconds.
    for i in range(k):
        theta[i] = vector[i]
    # Without pivoting, which positive definite matrices do not need (N. J. Higham, Accuracy and Stability of Numerical
    # Algorithms, ch. 10).
    for i in range(k):
        if not reduced[i, i] > _SINGULAR * matrix[i, i]:
            return False
        for j in range(i + 1, k):
            factor = reduced[j, i] / reduced[i, i]
            for m in range(i, k):
                reduced[j, m] -= factor * reduced[i, m]
            theta[j] -= factor * theta[i]
    for i in range(k - 1, -1, -1):
        for j in range(i + 1, k):
            theta[i] -= reduced[i, j] * theta[j]
        theta[i] /= reduced[i, i]
    return True
