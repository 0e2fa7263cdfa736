"""Counts of imaginary sequences whose statistics are known."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

EDGES = np.linspace(-8.0, 8.0, 65)
VALUES_A_BLOCK = 200


def blocks_around(centres: Float64, random: np.random.Generator) -> Int64:
    """Counts (b, 64) of normal values about the centre of each block."""
    below = ndtr(EDGES[None] - centres[:, None])
    below[:, [0, -1]] = 0.0, 1.0
    return np.asarray(random.multinomial(VALUES_A_BLOCK, np.diff(below, axis=1)), np.int64)


def autoregression(count: int, memory: float, random: np.random.Generator) -> Float64:
    """A stationary series of unit variance whose neighbours are correlated by ``memory``."""
    steps = random.standard_normal(count) * np.sqrt(1 - memory**2)
    series = np.empty(count)
    series[0] = random.standard_normal()
    for k in range(1, count):
        series[k] = memory * series[k - 1] + steps[k]
    return series
