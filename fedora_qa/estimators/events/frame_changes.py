"""By how much frames and events change in the same interval, pixel by pixel, in one compiled pass."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Bools = NDArray[np.bool_]
Images = NDArray[np.floating[Any]]


@njit(cache=True)
def change_and_events(
    before: Images, after: Images, error_before: Images, error_after: Images, counts: NDArray[np.int32]
) -> tuple[Float64, Float64, Bools, Float64]:
    """Return the absolute change of a level and the number of events (h, w), where they can be compared, and sums.

    Parameters
    ----------
    before, after, error_before, error_after
        (h, w) levels at both ends of the interval, and bounds of their errors in the same unit: not finite where the
        level is not known.
    counts
        (2, h, w) darker and brighter events in between; pixels with both are left out, and 0 in the results.

    Returns
    -------
    change
        (h, w) absolute change, in the unit of the levels; 0 where not usable.
    events
        (h, w) events of either polarity; 0 where not usable.
    usable
        (h, w) pixels that can be compared.
    sums
        (4,): change of the pixels that fire, their events, and squares of all pixels' beyond the means.
    """
    height, width = before.shape
    change, events, usable = np.zeros((height, width)), np.zeros((height, width)), np.zeros((height, width), np.bool_)
    count, total_change, total_events, of_firing = 0, 0.0, 0.0, 0.0
    for row in range(height):
        for column in range(width):
            darker, brighter = counts[0, row, column], counts[1, row, column]
            # Events of both signs: the level has turned, and its net change is less than its events sum to.
            if darker > 0 and brighter > 0:
                continue
            # Where an error is not finite, the frame is clipped or the pixel lies outside.
            if not (np.isfinite(error_before[row, column]) and np.isfinite(error_after[row, column])):
                continue
            step = abs(np.float64(after[row, column]) - np.float64(before[row, column]))
            change[row, column], events[row, column], usable[row, column] = step, darker + brighter, True
            count += 1
            total_change += step
            if darker + brighter > 0:
                total_events += darker + brighter
                of_firing += step
    sums = np.array([of_firing, total_events, 0.0, 0.0])
    if count:
        mean_change, mean_events = total_change / count, total_events / count
        # In a second pass: n times the squared mean, taken off a sum of squares, would cancel its digits.
        for row in range(height):
            for column in range(width):
                if usable[row, column]:
                    sums[2] += (change[row, column] - mean_change) ** 2
                    sums[3] += (events[row, column] - mean_events) ** 2
    return change, events, usable, sums
