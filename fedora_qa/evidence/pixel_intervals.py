"""A compiled loop over events: how long each comes after the one before it of the same pixel."""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]

_NEVER: Final = np.iinfo(np.int64).min


@njit(cache=True)
def intervals_ns(pixels: Int32, times_ns: Int64, count: int, start_ns: int, longest_ns: int) -> Int64:
    """Return the times (m,) between successive events of a pixel, that end from ``start_ns`` on.

    Parameters
    ----------
    pixels
        (N,) numbers from 0 to ``count`` of events in the order of time.
    longest_ns
        Longer times are left out.
    """
    latest_ns = np.full(count, _NEVER)
    first = np.searchsorted(times_ns, start_ns)
    for i in range(first):
        latest_ns[pixels[i]] = times_ns[i]
    found, m = np.empty(len(pixels) - first, np.int64), 0
    for i in range(first, len(pixels)):
        pixel, time_ns = pixels[i], times_ns[i]
        if latest_ns[pixel] >= time_ns - longest_ns:
            found[m] = time_ns - latest_ns[pixel]
            m += 1
        latest_ns[pixel] = time_ns
    return found[:m]
