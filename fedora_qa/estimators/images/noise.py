"""How noisy patches of an image are at most, from their changes at the finest scale.

J. Immerkaer, Fast Noise Variance Estimation, Comput. Vis. Image Underst. 64 (1996) 300: the difference of two discrete
Laplacians of white noise of variance s^2 has the variance 36 s^2, and is zero for anything that bends along one axis
only. Fine texture adds to it, so that this is an upper bound.
"""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

_WHITE_NOISE_GAIN: Final = 36.0
"""Sum of the squares of the operator's weights, 1 -2 1 by 1 -2 1."""


def noise_variances(patches: Float32) -> Float64:
    """Estimate the variance of white noise that patches of an image may hold.

    From the mean of the absolute responses, sqrt(2 / pi) times the standard deviation for normal noise: few large
    responses, at edges, count less than by their squares.

    Parameters
    ----------
    patches
        (n, h, w), h and w at least 3.

    Returns
    -------
    (n,), in the square of their unit.
    """
    mean_responses = _mean_responses(patches)
    variances: Float64 = np.pi / 2 * mean_responses**2 / _WHITE_NOISE_GAIN  # Immerkaer's sqrt(pi / 2) mean / 6, squared
    return variances


@njit(cache=True, fastmath={"reassoc"})
def _mean_responses(patches: Float32) -> Float64:
    """Return the mean absolute response (n,) of the difference of two Laplacians to each patch (n, h, w)."""
    height, width = patches.shape[1] - 2, patches.shape[2] - 2
    means, down = np.empty(len(patches)), np.empty(width + 2, np.float32)
    for i in range(len(patches)):
        total = 0.0
        for j in range(height):
            above, here, below, of_row = patches[i, j], patches[i, j + 1], patches[i, j + 2], np.float32(0)
            for k in range(width + 2):
                # The operator is separable: 1 -2 1 down the columns, then 1 -2 1 along the row.
                down[k] = above[k] - np.float32(2) * here[k] + below[k]
            for k in range(width):
                of_row += abs(down[k] - np.float32(2) * down[k + 1] + down[k + 2])
            total += np.float64(of_row)
        means[i] = total / (height * width)
    return means
