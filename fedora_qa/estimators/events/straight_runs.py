"""Events of a pixel that lie on a straight line in time.

A simulator that interpolates its signal linearly between two renders gives each pixel events at equal spacings from one
render to the next: with a change of the signal by D in an interval of length T, a threshold of C is crossed every
T C / |D|. The pixel has events of one polarity only. The last of them is less than one spacing from the end of the
interval, and the first one less than one from its start, or less than (C+ + C-) / C where the polarity changes there.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.pixels import PixelEvents

Int64 = NDArray[np.int64]

FEWEST_EVENTS: Final = 3
"""Two events lie on a line always."""

LEAST_SPACING_TICKS: Final = 10
"""Least spacing of a line, in steps of the timestamps. A line of three events then occurs by chance in a tenth of the
runs at most (``chance_of_line``)."""


def chance_of_line(tick_ns: int, spacing_ns: float) -> float:
    """Return the probability that three events lie on a line by chance.

    The second of them lies anywhere between the others, 2 s apart with a spacing of s, and on the line within one tick
    either way: 2 tick / (2 s). More events lie on a line less often.

    Parameters
    ----------
    tick_ns
        Step of the timestamps, ns.
    spacing_ns
        Spacing s, ns.
    """
    return tick_ns / spacing_ns


def straight_runs(events: PixelEvents, parts_ns: Sequence[Int64], tick_ns: int, first_spacings: float) -> Int64:
    """Count the runs of events of a pixel within intervals, and those that lie on one line through all of an interval.

    A run is all events of one pixel in an interval, three at least, as few as to be ten ticks apart on average.

    Parameters
    ----------
    events
        By pixel; timestamps in ns.
    parts_ns
        k arrays (n, 2) of intervals (start, stop], ns. Those of an array ascend and do not overlap.
    tick_ns
        Step of the timestamps, ns: a timestamp is the first tick not before the crossing.
    first_spacings
        Largest time from the start of an interval to the first event of a line, in spacings.

    Returns
    -------
    ndarray of int64
        (k, 3) number of runs, of runs on a line, and of events in all runs.
    """
    counts = np.zeros((len(parts_ns), 3), np.int64)
    if len(parts_ns):
        ends = np.cumsum([len(part) for part in parts_ns])
        _count_runs(events.starts, events.timestamped, np.concatenate(parts_ns), ends, tick_ns, first_spacings, counts)
    return counts


@njit(cache=True)
def _count_runs(
    starts: NDArray[np.int32],
    timestamped: Int64,
    intervals: Int64,
    ends: Int64,
    tick: int,
    first_spacings: float,
    counts: Int64,
) -> None:
    """Add to ``counts`` (k, 3), as of ``straight_runs``; ``ends`` (k,) are the indices after each part's intervals."""
    for pixel in range(len(starts) - 1):
        begin, end = starts[pixel], starts[pixel + 1]
        # Most pixels have too few events for any interval.
        if end - begin < FEWEST_EVENTS:
            continue
        for part in range(len(ends)):
            event, interval = begin, ends[part - 1] if part else 0
            while event < end and interval < ends[part]:
                start, stop = intervals[interval, 0], intervals[interval, 1]
                time = timestamped[event] >> 1
                if time > stop:
                    interval += 1
                    continue
                if time <= start:
                    event += 1
                    continue
                first = event
                while event < end and timestamped[event] >> 1 <= stop:
                    event += 1
                count = event - first
                if count < FEWEST_EVENTS or stop - start < count * LEAST_SPACING_TICKS * tick:
                    continue
                counts[part, 0] += 1
                counts[part, 1] += _is_straight(timestamped, first, event, start, stop, tick, first_spacings)
                counts[part, 2] += count


@njit(cache=True)
def _is_straight(
    timestamped: Int64, first: int, end: int, start: int, stop: int, tick: int, first_spacings: float
) -> bool:
    """Return whether the events of a pixel from ``first`` to before ``end`` lie on one line in (start, stop], ns."""
    first_time, last_time = timestamped[first] >> 1, timestamped[end - 1] >> 1
    spacing = (last_time - first_time) / (end - first - 1)
    straight = first_time - start <= first_spacings * spacing + 2 * tick and stop - last_time <= spacing + 2 * tick
    for i in range(first + 1, end):
        # Timestamps are up to a tick late: so is the event, and so is the line through first and last event.
        off = (timestamped[i] >> 1) - (first_time + spacing * (i - first))
        straight &= abs(off) <= tick and (timestamped[i] & 1) == (timestamped[first] & 1)
    return bool(straight)
