"""Compiled passes over events: counts, bursts and repeats by pixel, and events sorted by pixel and time.

Events are arrays (m,) in the order of time: ``x``, ``y`` (columns and rows, px), ``t`` (ns) and ``p`` (1 brighter, 0
darker). All of them lie on the sensor. An event with the timestamp of a frame belongs to the time before the frame,
because a timestamp is the first tick that is not before the crossing. Sorted by pixel, an event is stored as one
number: twice its timestamp plus its polarity.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Columns = NDArray[np.uint16]
Polarities = NDArray[np.uint8]
Bool = NDArray[np.bool_]

FIRST, LAST, EVENT, RUN = 1, 2, 1 << 2, 1 << 33
"""Layout of the number of a pixel in ``tally_events``: bit 0 is the polarity of its first event, bit 1 that of its last
event; bits 2 to 32 are the number of events, bits from 33 on the number of runs of one polarity."""


@dataclass(frozen=True, slots=True)
class PixelEvents:
    """m events by pixel.

    Attributes
    ----------
    starts
        (h * w + 1,) index of the first event of each pixel, row * width + column; the last value is m.
    timestamped
        (m,) twice the timestamp of each event, ns, plus its polarity (1 brighter, 0 darker).
    """

    starts: NDArray[np.int32]
    timestamped: Int64

    def __len__(self) -> int:
        return len(self.timestamped)

    def later_than(self, after_ns: int, until_ns: int) -> int:
        """Return the number of events in an interval.

        Parameters
        ----------
        after_ns, until_ns
            The interval (after, until], ns.

        Returns
        -------
        int
            Events of all pixels.
        """
        return int(_count_within(self.timestamped, after_ns, until_ns))


def by_pixel(
    x: NDArray[np.uint16], y: NDArray[np.uint16], times_ns: Int64, p: NDArray[np.uint8], shape: tuple[int, int]
) -> PixelEvents:
    """Sort events by pixel.

    Parameters
    ----------
    x, y
        (m,) columns and rows, px; all events lie on the sensor.
    times_ns
        (m,) sorted timestamps, ns.
    p
        (m,) polarities: 1 brighter, 0 darker.
    shape
        Rows and columns of the sensor.

    Returns
    -------
    PixelEvents
        The events of each pixel in the order of time.
    """
    starts, timestamped = np.empty(shape[0] * shape[1] + 1, np.int32), np.empty(len(times_ns), np.int64)
    _sort_by_pixel(x, y, times_ns, p, shape, starts, timestamped)
    return PixelEvents(starts, timestamped)


@njit(cache=True)
def _sort_by_pixel(
    x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int], starts: Int32, timestamped: Int64
) -> None:
    """Write the fields of ``PixelEvents``: ``starts`` (h * w + 1,), and ``timestamped`` (m,), 2 t + p of each event.

    Events are counted, then distributed in the order of time. Indices are unsigned, because Numba tests signed ones for
    negative values at each access.
    """
    height, width = shape
    row_px = np.uint64(width)
    # Distribution counting (D. E. Knuth, TAOCP vol. 3, algorithm 5.2D): stable, so that time order is kept.
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
    # Each start has advanced to that of the next pixel.
    for pixel in range(height * width, 0, -1):
        starts[pixel] = starts[pixel - 1]
    starts[0] = 0


@njit(cache=True)
def _count_within(timestamped: Int64, after: int, until: int) -> int:
    """Return the number of events that are later than ``after`` and not later than ``until``, ns."""
    # 2 t + p > 2 after + 1 exactly if t > after, for both polarities p; likewise for ``until``.
    count, least, most = 0, 2 * after + 1, 2 * until + 1
    for i in range(len(timestamped)):
        count += (timestamped[i] > least) & (timestamped[i] <= most)
    return count


@njit(cache=True)
def count_between_frames(
    x: Columns,
    y: Columns,
    t: Int64,
    p: Polarities,
    frame_times: Int64,
    counts: Int32,
) -> None:
    """Count the events of each pixel in (frame i, frame i + 1].

    Parameters
    ----------
    x, y, t, p
        (m,) events: columns, rows, timestamps (ns) and polarities, as the module describes them.
    frame_times
        (n,) strictly increasing timestamps of the frames, ns.
    counts
        (n - 1, 2, h, w) is added to: darker events first, then brighter ones.
    """
    start = _first_after(t, frame_times[0]) if len(counts) else 0
    for interval in range(len(counts)):
        stop, between = _first_after(t, frame_times[interval + 1]), counts[interval]
        for i in range(start, stop):
            between[p[i], y[i], x[i]] += 1
        # The next interval begins with the first event after the frame.
        start = stop


@njit(cache=True)
def add_counts(counts: Int32, events: Int32) -> None:
    """Add the events of intervals, of both polarities, to the events of each pixel, in place.

    Parameters
    ----------
    counts
        (n, 2, h, w) darker and brighter events of n intervals.
    events
        (h, w) is added to.
    """
    for interval in range(len(counts)):
        for row in range(events.shape[0]):
            for column in range(events.shape[1]):
                events[row, column] += counts[interval, 0, row, column] + counts[interval, 1, row, column]


@njit(cache=True)
def _first_after(t: Int64, instant: int) -> int:
    """Return the index of the first event that is later than an instant, ns, by bisection."""
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
    """Count events, as stored, that lie outside of the sensor or have an unknown polarity.

    Parameters
    ----------
    x, y, p
        (m,) columns, rows and polarities as stored, in any order, with any values.
    shape
        Rows and columns of the sensor.
    counts
        (8,) receives: the number of events outside; the number of events whose polarity is neither 0 nor 1; the index
        of the first event of each kind (-1: none); the largest column and the largest row; the numbers of events with
        p = 0 and with p = 1.
    """
    height, width = shape
    outside, unknown, off, on, first_outside, first_unknown = 0, 0, 0, 0, -1, -1
    column, row = np.int64(0), np.int64(0)
    for i in range(len(x)):
        beyond = (x[i] < 0) | (x[i] >= width) | (y[i] < 0) | (y[i] >= height)
        strange = (p[i] != 0) & (p[i] != 1)
        if beyond and first_outside < 0:
            first_outside = i
        if strange and first_unknown < 0:
            first_unknown = i
        outside += beyond
        unknown += strange
        off += p[i] == 0
        on += p[i] == 1
        column, row = max(column, np.int64(x[i])), max(row, np.int64(y[i]))
    counts[0], counts[1], counts[2], counts[3] = outside, unknown, first_outside, first_unknown
    counts[4], counts[5], counts[6], counts[7] = column, row, off, on


@njit(cache=True)
def count_repeats(x: Columns, y: Columns, t: Int64, shape: tuple[int, int], near: int) -> tuple[int, int]:
    """Count the events that share pixel and timestamp with an event before, and those that follow one closely.

    Parameters
    ----------
    x, y, t
        (m,) columns, rows and timestamps (ns) of events, as the module describes them.
    shape
        Rows and columns of the sensor.
    near
        Longest interval of close events, ns.

    Returns
    -------
    tuple[int, int]
        Number of repeats, of any polarity; number of events whose last one at the pixel, of any polarity, is earlier by
        ``near`` at most.
    """
    # Half the least int64: long before every event, and the difference does not overflow.
    last, repeats, close = np.full(shape, np.iinfo(np.int64).min // 2), 0, 0
    for i in range(len(t)):
        between = t[i] - last[y[i], x[i]]
        repeats += between == 0
        close += 0 < between <= near
        last[y[i], x[i]] = t[i]
    return repeats, close


@njit(cache=True)
def mark_repeats(x: Columns, y: Columns, t: Int64, shape: tuple[int, int]) -> Bool:
    """Return which events share pixel and timestamp with an event before.

    Parameters
    ----------
    x, y, t
        (m,) columns, rows and timestamps (ns) of events, as the module describes them.
    shape
        Rows and columns of the sensor.

    Returns
    -------
    NDArray[np.bool_]
        (m,) True for repeats, of any polarity.
    """
    last, marked = np.full(shape, np.iinfo(np.int64).min), np.zeros(len(t), np.bool_)
    for i in range(len(t)):
        marked[i] = last[y[i], x[i]] == t[i]
        last[y[i], x[i]] = t[i]
    return marked


@njit(cache=True)
def tally_events(x: Columns, y: Columns, p: Polarities, packed: Int64) -> None:
    """Update the numbers of events and runs of each pixel by the events that come next.

    A run that continues counts once. One number holds all counts of a pixel, so that each event needs one access to
    memory: successive events lie anywhere on the sensor.

    Parameters
    ----------
    x, y, p
        (m,) columns, rows and polarities of events, as the module describes them.
    packed
        (h, w) is updated, in the layout of ``FIRST``, ``LAST``, ``EVENT`` and ``RUN``; 0 for a pixel without events.
    """
    for i in range(len(x)):
        state, sign = packed[y[i], x[i]], np.int64(p[i])
        if state == 0:
            state = sign * (FIRST | LAST) + RUN
        elif (state & LAST) >> 1 != sign:
            state = (state ^ LAST) + RUN
        packed[y[i], x[i]] = state + EVENT


@njit(cache=True)
def tally_run_lengths(x: Columns, y: Columns, p: Polarities, pairs: Int64, squares: Int64) -> None:
    """Add the differences between the lengths of successive runs of equal polarity of each pixel.

    The first and the last run of a pixel are left out: other events may belong to them.

    Parameters
    ----------
    x, y, p
        (m,) columns, rows and polarities of events, as the module describes them.
    pairs, squares
        (h, w) the number of pairs and the sum of the squared differences are added.
    """
    lengths = np.zeros((*pairs.shape, 3), np.int32)
    runs = np.zeros(pairs.shape, np.int32)
    polarities = np.empty(pairs.shape, np.uint8)
    for i in range(len(x)):
        row, column = y[i], x[i]
        last = lengths[row, column]
        if runs[row, column] == 0 or polarities[row, column] != p[i]:
            # A run ends: it is compared with the one before the last, of the same polarity.
            if runs[row, column] > 3:
                pairs[row, column] += 1
                squares[row, column] += np.int64(last[0] - last[2]) ** 2
            last[2], last[1], last[0] = last[1], last[0], 0
            runs[row, column] += 1
            polarities[row, column] = p[i]
        last[0] += 1


@njit(cache=True)
def find_repeats(x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Count the events that share pixel and timestamp with an event before, and the doubled ticks.

    A tick is doubled where every pixel has an even number of events of each polarity, at least eight events in all: a
    packet that was written twice.

    Parameters
    ----------
    x, y, t, p
        (m,) events: columns, rows, timestamps (ns) and polarities, as the module describes them.
    shape
        Rows and columns of the sensor.

    Returns
    -------
    tuple[int, int, int, int]
        Number of repeats; index of the first one (-1: none); number of doubled ticks; index of the first event of the
        first doubled tick (-1: none).
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
        # Number of pixels and polarities with an odd number of events in this tick; 0 at its end if all form pairs.
        unpaired += 1 if odd[p[i], y[i], x[i]] else -1
        if i + 1 == len(t) or t[i + 1] != t[i]:
            # Eight events form pairs by chance with a small probability; two or four do not.
            if unpaired == 0 and i + 1 - begin >= 8:
                doubled += 1
                first_doubled = begin if first_doubled < 0 else first_doubled
            for j in range(begin, i + 1):
                odd[p[j], y[j], x[j]] = False
            begin, unpaired = i + 1, 0
    return repeats, first, doubled, first_doubled


@njit(cache=True)
def mark_bursts(x: Columns, y: Columns, t: Int64, least_gap: int, marked: Bool) -> None:
    """Mark the pixels with two successive events that are closer than a gap.

    Parameters
    ----------
    x, y, t
        (m,) columns, rows and timestamps (ns) of events, as the module describes them.
    least_gap
        The gap, ns.
    marked
        (h, w) is set to True at these pixels.
    """
    # Half the least int64: long before every event, and the difference does not overflow.
    last = np.full(marked.shape, np.iinfo(np.int64).min // 2)
    for i in range(len(t)):
        if t[i] - last[y[i], x[i]] < least_gap:
            marked[y[i], x[i]] = True
        last[y[i], x[i]] = t[i]
