"""Compiled loops that sort events by pixel.

Sorting is done twice over: into bands of a few rows, whose counters stay in the cache, and within a band by pixel. Both
keep the order of time. An event becomes one number, twice its instant plus its polarity.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int64 = NDArray[np.int64]
Columns = NDArray[np.uint16]
Polarities = NDArray[np.uint8]

BAND_PIXELS = 1 << 13
"""Pixels of a band, about: a counter each, and what a few hundred milliseconds bring, fit into a second-level cache."""


@njit(cache=True)
def sort_by_pixel(
    x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int], starts: Int64, stamped: Int64
) -> None:
    """Write 2 t + p of each event to ``stamped`` (m,), by pixel, and to ``starts`` (h * w + 1,) where each begins."""
    height, width = shape
    rows = max(BAND_PIXELS // width, 1)
    bands = (height + rows - 1) // rows
    band_of = np.empty(height, np.int32)
    for row in range(height):
        band_of[row] = row // rows
    stops = np.zeros(bands + 1, np.int64)
    for i in range(len(t)):
        stops[band_of[np.uint64(y[i])] + 1] += 1
    for band in range(bands):
        stops[band + 1] += stops[band]
    # Moved up by one while events are dealt out: at the start of a band first, at its stop at last.
    pixels, dealt = np.empty(len(t), np.int32), np.empty(len(t), np.int64)
    for i in range(len(t)):
        its_band = np.uint64(band_of[np.uint64(y[i])])
        to = np.uint64(stops[its_band])
        stops[its_band] += 1
        pixels[to] = np.int32(y[i]) * np.int32(width) + np.int32(x[i])
        dealt[to] = 2 * t[i] + p[i]
    cursors, begin = np.empty(rows * width, np.int64), np.int64(0)
    for band in range(bands):
        first, stop = band * rows * width, stops[band]
        cursors[:] = 0
        for i in range(begin, stop):
            cursors[np.uint64(pixels[i] - first)] += 1
        before = begin
        for j in range(min(rows * width, height * width - first)):
            count = cursors[j]
            starts[first + j], cursors[j] = before, before
            before += count
        for i in range(begin, stop):
            own = np.uint64(pixels[i] - first)
            stamped[np.uint64(cursors[own])] = dealt[i]
            cursors[own] += 1
        begin = stop
    starts[height * width] = len(t)


@njit(cache=True)
def choose_pixels(x: Columns, y: Columns, shape: tuple[int, int], every: int, chosen: NDArray[np.int64]) -> int:
    """Write which events lie at pixels of which the column and three times the row are a multiple of ``every``.

    ``chosen`` (m + 1,) has one to spare; return how many they are.
    """
    height, width = shape
    before, taken = np.empty(height, np.int64), np.empty(width + every, np.bool_)
    for row in range(height):
        before[row] = 3 * row % every
    for place in range(len(taken)):
        taken[place] = place % every == 0
    count = 0
    for i in range(len(x)):
        chosen[count] = i
        count += taken[np.uint64(before[np.uint64(y[i])] + x[i])]
    return count


@njit(cache=True)
def count_within(stamped: Int64, after: int, until: int) -> int:
    """Return how many of sorted events are later than ``after`` and not later than ``until``."""
    count, least, most = 0, 2 * after + 1, 2 * until + 1
    for i in range(len(stamped)):
        count += (stamped[i] > least) & (stamped[i] <= most)
    return count
