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
        of_row = _sums_of_row(change[row], events[row], usable[row])
        count, change_sum, event_sum = count + int(of_row[0]), change_sum + of_row[1], event_sum + of_row[2]
    change_mean, event_mean = change_sum / max(count, 1), event_sum / max(count, 1)
    for row in range(one.shape[0]):
        for column in range(one.shape[1]):
            pixels, changed, fired = 0, 0.0, 0.0
            for y in range(2 * row, 2 * row + 2):
                for x in range(2 * column, 2 * column + 2):
                    there = usable[y, x]
                    pixels += there
                    changed += change[y, x] if there else 0.0
                    fired += events[y, x] if there else 0.0
            one[row, column], other[row, column] = changed - pixels * change_mean, fired - pixels * event_mean
    return -4 * event_mean


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _sums_of_row(change: Float64, events: Float64, usable: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Return the number of usable pixels, and their sums; many pixels at a time."""
    count, change_sum, event_sum = 0.0, 0.0, 0.0
    for i in range(len(usable)):
        count += 1.0 if usable[i] else 0.0
        change_sum += change[i] if usable[i] else 0.0
        event_sum += events[i] if usable[i] else 0.0
    return count, change_sum, event_sum
