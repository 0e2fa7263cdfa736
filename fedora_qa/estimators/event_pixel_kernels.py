"""Compiled loops that sort events by pixel, and follow each pixel through its own.

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

_FIRST, _LAST, _EVENT, _RUN = 1, 2, 4, 1 << 33
"""What ``follow_sorted`` packs: bits of the first and the last polarity, events, and sequences of one polarity."""


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
def count_within(stamped: Int64, after: int, until: int) -> int:
    """Return how many of sorted events are later than ``after`` and not later than ``until``."""
    count, least, most = 0, 2 * after + 1, 2 * until + 1
    for i in range(len(stamped)):
        count += (stamped[i] > least) & (stamped[i] <= most)
    return count


@njit(cache=True)
def count_sorted(starts: Int64, stamped: Int64, frame_times: Int64, counts: NDArray[np.int32]) -> None:
    """Count the events in (frame i, frame i + 1] into ``counts`` (n - 1, 2, h * w): darker first, then brighter."""
    least, most = 2 * frame_times[0] + 1, 2 * frame_times[-1] + 1
    for at in range(len(starts) - 1):
        interval = 0
        for i in range(starts[at], starts[at + 1]):
            now = stamped[i]
            if now <= least or now > most:
                continue
            while now > 2 * frame_times[interval + 1] + 1:
                interval += 1
            counts[interval, now & 1, at] += 1


@njit(cache=True)
def follow_sorted(starts: Int64, stamped: Int64, start: int, stop: int, followed: Int64) -> int:
    """Follow every pixel through its events in [start, stop); return how many share pixel and stamp with one before.

    ``followed`` (h * w,) receives, packed for ``add_followed``, what was counted: sequences of one polarity, events,
    and the polarities of the last and the first one; 0 where there is none.
    """
    repeats, least, most = 0, 2 * start, 2 * stop
    for at in range(len(followed)):
        packed, last = np.int64(0), np.int64(0)
        for i in range(starts[at], starts[at + 1]):
            now = stamped[i]
            if now < least or now >= most:
                continue
            if packed == 0:
                packed = _EVENT + _RUN + (now & 1)
            else:
                repeats += now >> 1 == last >> 1
                packed += _EVENT + _RUN * ((now ^ last) & 1)
            last = now
        followed[at] = packed + _LAST * (last & 1)
    return repeats


@njit(cache=True)
def add_followed(followed: Int64, events: Int64, runs: Int64, first: NDArray[np.int8], last: NDArray[np.int8]) -> None:
    """Add what ``follow_sorted`` found to ``events``, and sequences of one polarity to ``runs``, (h * w,) each.

    ``first`` and ``last`` (h * w,) hold the polarity of each pixel's first and last event, negative where there is
    none. A sequence that goes on is one.
    """
    for at in range(len(events)):
        packed = followed[at]
        if packed:
            began = packed & _FIRST
            events[at] += (packed & (_RUN - 1)) >> 2
            runs[at] += (packed >> 33) - (1 if last[at] == began else 0)
            if first[at] < 0:
                first[at] = began
            last[at] = (packed & _LAST) >> 1
