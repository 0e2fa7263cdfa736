"""Compiled loops over events.

Events come as columns in the order of time: ``x``, ``y`` (px), ``t`` (int64, ns) and ``p`` (1 brighter, 0 darker), all
of them inside the sensor. An event with the timestamp of a frame belongs before the frame: a timestamp is the first
tick not before the crossing.
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


@njit(cache=True)
def count_between_frames(
    x: Columns,
    y: Columns,
    t: Int64,
    p: Polarities,
    frame_times: Int64,
    counts: Int32,
) -> None:
    """Count the events in (frame i, frame i+1] of each pixel.

    Parameters
    ----------
    x, y, t, p
        (m,) events, as the module describes them.
    frame_times
        (n,) ns, advancing.
    counts
        (n - 1, 2, h, w) that are added to: darker first, then brighter.
    """
    start = _first_after(t, frame_times[0]) if len(counts) else 0
    for interval in range(len(counts)):
        stop, between = _first_after(t, frame_times[interval + 1]), counts[interval]
        for i in range(start, stop):
            between[p[i], y[i], x[i]] += 1
        # Intervals meet: the first event after one frame is where the next interval begins.
        start = stop


@njit(cache=True)
def add_counts(counts: Int32, events: Int32) -> None:
    """Add darker and brighter events ``counts`` (n, 2, h, w) of n intervals to ``events`` (h, w), in place."""
    for interval in range(len(counts)):
        for row in range(events.shape[0]):
            for column in range(events.shape[1]):
                events[row, column] += counts[interval, 0, row, column] + counts[interval, 1, row, column]


@njit(cache=True)
def _first_after(t: Int64, instant: int) -> int:
    """Return the first event that is later than an instant, by halving."""
    low, high = 0, len(t)
    while low < high:
        middle = (low + high) // 2
        if t[middle] > instant:
            high = middle
        else:
            low = middle + 1
    return low


@njit(cache=True)
def survey_columns(
    x: NDArray[np.integer], y: NDArray[np.integer], p: NDArray[np.integer], shape: tuple[int, int], counts: Int64
) -> None:
    """Count events, as stored, that lie beyond the sensor or have an unknown polarity.

    Parameters
    ----------
    x, y, p
        (m,) as stored, in any order; nothing is assumed of their values.
    shape
        Rows and columns of the sensor.
    counts
        (7,) that receive: events outside; events whose polarity is neither 0 nor 1; the first of either (-1: none);
        the largest column and row; the events of p = 0 and of p = 1.
    """
    height, width = shape
    outside, unknown, off, on, first = 0, 0, 0, 0, -1
    column, row = np.int64(0), np.int64(0)
    for i in range(len(x)):
        beyond = (x[i] < 0) | (x[i] >= width) | (y[i] < 0) | (y[i] >= height)
        strange = (p[i] != 0) & (p[i] != 1)
        if (beyond | strange) and first < 0:
            first = i
        outside += beyond
        unknown += strange
        off += p[i] == 0
        on += p[i] == 1
        column, row = max(column, np.int64(x[i])), max(row, np.int64(y[i]))
    counts[0], counts[1], counts[2], counts[3], counts[4], counts[5], counts[6] = (
        outside,
        unknown,
        first,
        column,
        row,
        off,
        on,
    )


@njit(cache=True)
def count_repeats(x: Columns, y: Columns, t: Int64, shape: tuple[int, int]) -> int:
    """Return how many events share pixel and timestamp with one before; ``shape`` is rows and columns."""
    # No timestamp equals the least int64: the first event of a pixel repeats none.
    last, repeats = np.full(shape, np.iinfo(np.int64).min), 0
    for i in range(len(t)):
        repeats += last[y[i], x[i]] == t[i]
        last[y[i], x[i]] = t[i]
    return repeats


FIRST, LAST, EVENT, RUN = 1, 2, 1 << 2, 1 << 33
"""Layout of a pixel's number in ``tally_events``: bit 0 and 1 are the polarities of its first and last event, bits 2 to
32 count events, those from 33 on runs of one polarity."""


@njit(cache=True)
def tally_events(x: Columns, y: Columns, p: Polarities, packed: Int64) -> None:
    """Add the events that come next to what is ``packed`` (h, w) of each pixel; 0 where there was none.

    A run that goes on counts once. One number holds all of a pixel: successive events lie anywhere on the sensor, and
    each then costs one access to memory.

    Parameters
    ----------
    x, y, p
        (m,) events, as the module describes them.
    packed
        (h, w) that are updated, in the layout of ``FIRST``, ``LAST``, ``EVENT`` and ``RUN``.
    """
    for i in range(len(x)):
        state, sign = packed[y[i], x[i]], np.int64(p[i])
        if state == 0:
            state = sign * (FIRST | LAST) + RUN
        elif (state & LAST) >> 1 != sign:
            state = (state ^ LAST) + RUN
        packed[y[i], x[i]] = state + EVENT


@njit(cache=True)
def find_repeats(x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Count the events that share pixel and timestamp with one before, and doubled ticks.

    A tick is doubled when each pixel that fires in it does so an even number of times with each polarity, at least
    eight events in all: a packet written twice.

    Parameters
    ----------
    x, y, t, p
        (m,) events, as the module describes them.
    shape
        Rows and columns of the sensor.

    Returns
    -------
    tuple[int, int, int, int]
        Repeats; the first of them (-1: none); doubled ticks; the event at which the first of these begins (-1: none).
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
        # Pixels and polarities with an odd number of events so far in this tick: 0 at its end if all are in pairs.
        unpaired += 1 if odd[p[i], y[i], x[i]] else -1
        if i + 1 == len(t) or t[i + 1] != t[i]:
            # Eight events that pair up by chance are improbable; two or four are not.
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
    # Half the least int64: far before every event, and the difference does not overflow.
    last = np.full(marked.shape, np.iinfo(np.int64).min // 2)
    for i in range(len(t)):
        if t[i] - last[y[i], x[i]] < least_gap:
            marked[y[i], x[i]] = True
        last[y[i], x[i]] = t[i]
