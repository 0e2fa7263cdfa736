"""How noisy patches of an image are at most, from what is left of them at the finest scale.

J. Immerkaer, Fast Noise Variance Estimation, Comput. Vis. Image Underst. 64 (1996) 300: the difference of two discrete
Laplacians answers to white noise of variance s^2 with variance 36 s^2, and not at all to anything that bends along one
axis only. Fine texture answers as well, so that this is an upper bound.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

_OF_WHITE_NOISE: Final = 36.0
"""Sum of the squares of the operator's weights, 1 -2 1 by 1 -2 1."""


def noise_variances(patches: Float32) -> Float64:
    """Return the variance (n,) of white noise that patches (n, h, w), h and w at least 3, may hold; in their unit^2.

    From the mean of the absolute answers, sqrt(2 / pi) times the standard deviation for normal noise: few large
    answers, at edges, count less than by their squares.
    """
    across = patches[:, :, :-2] - 2 * patches[:, :, 1:-1] + patches[:, :, 2:]
    answers = across[:, :-2] - 2 * across[:, 1:-1] + across[:, 2:]
    typical = np.abs(answers).mean(axis=(1, 2), dtype=np.float64)
    variances: Float64 = np.pi / 2 * typical**2 / _OF_WHITE_NOISE
    return variances
