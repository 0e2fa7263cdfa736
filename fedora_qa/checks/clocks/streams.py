"""What the checks of clocks share: streams that can be fitted, extents, coverage."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.clocks.regular_clock import FEWEST_TIMESTAMPS, RegularClock, fit_regular_clock
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Clock, EventScan, Facts


def clocks_of(facts: Facts) -> Iterator[tuple[str, Clock]]:
    """Yield each sampled stream and its clock, by name."""
    for stream in sorted(facts.clocks):
        yield stream, facts.clocks[stream]


def fits_of(facts: Facts) -> Iterator[tuple[str, RegularClock]]:
    """Yield each sampled stream that has three stamps in order, and the regular clock fitted to them."""
    for stream, clock in clocks_of(facts):
        fit = fit_regular_clock(clock.times_ns[clock.advancing]) if clock.usable else None
        if fit is not None:
            yield stream, fit


def placed_streams(facts: Facts) -> list[str]:
    """Return the sampled streams that have three stamps in order, which are those that ``fits_of`` can fit."""
    return [
        stream
        for stream, clock in clocks_of(facts)
        if clock.usable and np.count_nonzero(clock.advancing) >= FEWEST_TIMESTAMPS
    ]


def extent_ns(clock: Clock) -> tuple[int, int]:
    """Return the first and last instant; for flow from the start of the first interval to the end of the last."""
    times = clock.times_ns[clock.advancing]
    last = times[-1] if clock.ends_ns is None else clock.ends_ns[clock.advancing][-1]
    return int(times[0]), int(last)


def file_us(facts: Facts, times_ns: NDArray[np.int64], row: int | None) -> float | None:
    """Return the stamp of a row on the file's own clock, None where there is no such row."""
    return None if row is None or row >= len(times_ns) else facts.to_file_us(float(times_ns[row]))


def all_timestamps(facts: Facts) -> Coverage:
    """Return the coverage of checks that look at every stamp of the file."""
    count = sum(len(clock.times_ns) for clock in facts.clocks.values())
    count += facts.events.count if facts.events else 0
    return Coverage(count, count, "stamps")


def event_scan(facts: Facts) -> EventScan:
    """Return what the scan saw of the events.

    Raises
    ------
    ValueError
        The file has no events.
    """
    if facts.events is None:
        raise ValueError("Expected the file to have events, got none; the check needs them")
    return facts.events
