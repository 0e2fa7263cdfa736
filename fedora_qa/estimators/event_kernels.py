"""Compiled loops over events.

Events come as columns in the order of time: ``x``, ``y`` (px), ``t`` (int64, ns) and ``p`` (1 brighter, 0 darker), all
of them inside the sensor. An event stamped at a frame's own time belongs before the frame: its stamp is the first tick
not before the crossing.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]
Bool = NDArray[np.bool_]
Columns = NDArray[np.uint16]
Polarities = NDArray[np.uint8]
Signs = NDArray[np.int8]


@njit(cache=True)
def count_between_frames(
    x: Columns,
    y: Columns,
    t: Int64,
    p: Polarities,
    frame_times: Int64,
    counts: Int32,
) -> None:
    """Count the events in (frame i, frame i+1] into ``counts`` (n - 1, 2, h, w): darker first, then brighter."""
    interval = -1
    for i in range(len(t)):
        while interval + 1 < len(frame_times) and frame_times[interval + 1] < t[i]:
            interval += 1
        if interval < 0:
            continue
        if interval >= len(counts):
            break
        counts[interval, p[i], y[i], x[i]] += 1


@njit(cache=True)
def follow_polarities(
    x: Columns, y: Columns, p: Polarities, events: Int64, runs: Int64, first: Signs, last: Signs
) -> None:
    """Add events to ``events``, and sequences of one polarity to ``runs``, (h, w) each.

    ``first`` and ``last`` (h, w) hold the polarity of each pixel's first and last event, negative where there is none.
    """
    for i in range(len(x)):
        row, column = y[i], x[i]
        events[row, column] += 1
        if last[row, column] != p[i]:
            runs[row, column] += 1
        if first[row, column] < 0:
            first[row, column] = p[i]
        last[row, column] = p[i]


@njit(cache=True)
def find_repeats(x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return how many events share pixel and stamp with one before, the first such event, and doubled ticks.

    A tick is doubled when each pixel that fires in it does so an even number of times with each polarity, at least
    eight events in all: a packet written twice. The last value is the event at which the first doubled tick begins.
    """
    last = np.full(shape, np.iinfo(np.int64).min)
    odd = np.zeros((2, *shape), np.bool_)
    repeats, first, doubled, first_doubled = 0, -1, 0, -1
    begin, unpaired = 0, 0
    for i in range(len(t)):
        if last[y[i], x[i]] == t[i]:
            repeats += 1
            first = i if first < 0 else first
        last[y[i], x[i]] = t[i]
        odd[p[i], y[i], x[i]] ^= True
        unpaired += 1 if odd[p[i], y[i], x[i]] else -1
        if i + 1 == len(t) or t[i + 1] != t[i]:
            if unpaired == 0 and i + 1 - begin >= 8:
                doubled += 1
                first_doubled = begin if first_doubled < 0 else first_doubled
            for j in range(begin, i + 1):
                odd[p[j], y[j], x[j]] = False
            begin, unpaired = i + 1, 0
    return repeats, first, doubled, first_doubled


@njit(cache=True)
def mark_bursts(x: Columns, y: Columns, t: Int64, least_gap: int, marked: Bool) -> None:
    """Mark in ``marked`` (h, w) the pixels with two events less than ``least_gap`` ns apart."""
    last = np.full(marked.shape, np.iinfo(np.int64).min // 2)
    for i in range(len(t)):
        if t[i] - last[y[i], x[i]] < least_gap:
            marked[y[i], x[i]] = True
        last[y[i], x[i]] = t[i]
