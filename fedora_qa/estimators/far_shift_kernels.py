"""Compiled loop that sums what frames and events say over blocks of 2 x 2 pixels."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]


@njit(cache=True)
def sum_blocks(change: Float64, events: Float64, usable: NDArray[np.bool_], one: Float64, other: Float64) -> float:
    """Write sums of both images (h, w) beyond their means over blocks, (h // 2, w // 2); other pixels count nothing.

    Return what a block of usable pixels holds in which nothing fires.
    """
    count, change_sum, event_sum = 0, 0.0, 0.0
    for row in range(usable.shape[0]):
        for column in range(usable.shape[1]):
            if usable[row, column]:
                count += 1
                change_sum += change[row, column]
                event_sum += events[row, column]
    change_mean, event_mean = change_sum / max(count, 1), event_sum / max(count, 1)
    for row in range(one.shape[0]):
        for column in range(one.shape[1]):
            pixels, changed, fired = 0, 0.0, 0.0
            for y in range(2 * row, 2 * row + 2):
                for x in range(2 * column, 2 * column + 2):
                    if usable[y, x]:
                        pixels += 1
                        changed += change[y, x]
                        fired += events[y, x]
            one[row, column], other[row, column] = changed - pixels * change_mean, fired - pixels * event_mean
    return -4 * event_mean
