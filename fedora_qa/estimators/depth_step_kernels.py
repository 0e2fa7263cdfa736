"""Compiled loops: second differences of the values of a depth frame, and which octaves of depth hold any."""

from math import frexp

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]


@njit(cache=True)
def second_differences(values: Float64, depths_m: Float64, edge: float) -> tuple[Float64, Float64, Float64, Int64]:
    """Return second differences along rows and columns, the values and depths amid them, and the octaves of these.

    Parameters
    ----------
    values, depths_m
        (h, w), NaN where invalid. Octave k of depths begins at 2^k.
    edge
        Second differences of more than this share of the value are left out.
    """
    height, width = values.shape
    bends, middles, amid_m = np.empty((3, 2 * height * width))
    octaves, n = np.empty(2 * height * width, np.int64), 0
    for axis in range(2):
        below, right = (1, 0) if axis else (0, 1)
        for row in range(below, height - below):
            for column in range(right, width - right):
                middle = values[row, column]
                bend = values[row + below, column + right] - 2 * middle + values[row - below, column - right]
                if abs(bend) < edge * middle:  # False where NaN
                    bends[n], middles[n], amid_m[n] = bend, middle, depths_m[row, column]
                    octaves[n] = frexp(amid_m[n])[1] - 1
                    n += 1
    return bends[:n], middles[:n], amid_m[:n], octaves[:n]


@njit(cache=True)
def bent_octaves(bends: Float64, middles: Float64, octaves: Int64, finest: float) -> tuple[Int64, Int64, Float64]:
    """Count by octave, from the lowest on, all second differences and those that say anything, (k,) each.

    They do where they are larger than a share ``finest`` of the octave's largest value; last come these limits (k,).
    """
    if not len(octaves):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    lowest = octaves.min()
    size = octaves.max() - lowest + 1
    counts, bent, limits = np.zeros(size, np.int64), np.zeros(size, np.int64), np.zeros(size)
    for i in range(len(octaves)):
        counts[octaves[i] - lowest] += 1
        limits[octaves[i] - lowest] = max(limits[octaves[i] - lowest], finest * middles[i])
    for i in range(len(octaves)):
        bent[octaves[i] - lowest] += abs(bends[i]) > limits[octaves[i] - lowest]
    return counts, bent, limits
