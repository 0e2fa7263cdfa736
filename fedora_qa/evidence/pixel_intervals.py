"""A compiled loop over events: how long each comes after the one before it of the same pixel."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int64 = NDArray[np.int64]


@njit(cache=True)
def intervals_ns(pixels: Int64, times_ns: Int64, count: int, start_ns: int, longest_ns: int) -> Int64:
    """Return the times (m,) between successive events of a pixel, that end from ``start_ns`` on.

    Parameters
    ----------
    pixels
        (N,) numbers from 0 to ``count`` of events in the order of time.
    longest_ns
        Longer times are left out.
    """
    latest_ns, known = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    found, m = np.empty(len(pixels), np.int64), 0
    for i in range(len(pixels)):
        pixel, time_ns = pixels[i], times_ns[i]
        step_ns = time_ns - latest_ns[pixel]
        if known[pixel] and time_ns >= start_ns and step_ns <= longest_ns:
            found[m] = step_ns
            m += 1
        latest_ns[pixel], known[pixel] = time_ns, True
    return found[:m]
