"""Compiled loops that sort events by pixel. An event becomes one number, twice its instant plus its polarity."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Columns = NDArray[np.uint16]
Polarities = NDArray[np.uint8]


@njit(cache=True)
def sort_by_pixel(
    x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int], starts: Int32, timestamped: Int64
) -> None:
    """Write 2 t + p of each event to ``stamped`` (m,), by pixel, and to ``starts`` (h * w + 1,) where each begins.

    Events are counted, then dealt out, in the order of time. Indices are unsigned: a negative one would be asked for.
    """
    height, width = shape
    row_px = np.uint64(width)
    starts[:] = 0
    for i in range(len(t)):
        starts[np.uint64(y[i]) * row_px + np.uint64(x[i])] += 1
    before = np.int32(0)
    for pixel in range(height * width):
        count = starts[pixel]
        starts[pixel] = before
        before += count
    for i in range(len(t)):
        pixel_of_event = np.uint64(y[i]) * row_px + np.uint64(x[i])
        timestamped[np.uint64(starts[pixel_of_event])] = 2 * t[i] + p[i]
        starts[pixel_of_event] += 1
    # Each has moved on to where the next begins.
    for pixel in range(height * width, 0, -1):
        starts[pixel] = starts[pixel - 1]
    starts[0] = 0


@njit(cache=True)
def count_within(timestamped: Int64, after: int, until: int) -> int:
    """Return how many of sorted events are later than ``after`` and not later than ``until``."""
    count, least, most = 0, 2 * after + 1, 2 * until + 1
    for i in range(len(timestamped)):
        count += (timestamped[i] > least) & (timestamped[i] <= most)
    return count
