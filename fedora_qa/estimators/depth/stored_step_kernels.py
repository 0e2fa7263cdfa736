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
    octave, least_m, most_m = 0, 1.0, 2.0  # of the depth before, which is that of the next one as a rule
    for axis in range(2):
        below, right = (1, 0) if axis else (0, 1)
        for row in range(below, height - below):
            for column in range(right, width - right):
                middle = values[row, column]
                bend = values[row + below, column + right] - 2 * middle + values[row - below, column - right]
                if abs(bend) < edge * middle:  # False where NaN
                    bends[n], middles[n], amid_m[n] = bend, middle, depths_m[row, column]
                    if not least_m <= amid_m[n] < most_m:
                        octave = frexp(amid_m[n])[1] - 1
                        least_m, most_m = 2.0**octave, 2.0 ** (octave + 1)
                    octaves[n] = octave
                    n += 1
    return bends[:n], middles[:n], amid_m[:n], octaves[:n]


@njit(cache=True)
def bent_octaves(bends: Float64, middles: Float64, octaves: Int64, finest: float) -> tuple[Int64, Float64, Int64]:
    """Count second differences by octave, from the lowest on, (k,), and find those (m,) that say anything.

    They do where they are larger than a share ``finest`` of the octave's largest value: these limits (k,) come second.
    Neighbours lie in one octave as a rule, so that each stretch of one is gone through without a look at the others.
    """
    if not len(octaves):
        return np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64)
    lowest = octaves.min()
    size = octaves.max() - lowest + 1
    counts, limits, stop = np.zeros(size, np.int64), np.zeros(size), 0
    while stop < len(octaves):
        start, octave, largest = stop, octaves[stop], 0.0
        while stop < len(octaves) and octaves[stop] == octave:
            largest = max(largest, middles[stop])
            stop += 1
        counts[octave - lowest] += stop - start
        limits[octave - lowest] = max(limits[octave - lowest], finest * largest)
    telling, m, i = np.empty(len(octaves), np.int64), 0, 0
    while i < len(octaves):
        octave = octaves[i]
        limit = limits[octave - lowest]
        while i < len(octaves) and octaves[i] == octave:
            telling[m] = i
            m += abs(bends[i]) > limit
            i += 1
    return counts, limits, telling[:m]
