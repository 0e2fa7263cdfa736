"""Shared by the checks of clocks: streams that can be fitted, extents, coverage, and patterns of their timestamps."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.estimators.clocks.regular_clock import FEWEST_TIMESTAMPS, RegularClock, fit_regular_clock
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Clock, EventScan, Facts
from fedora_qa.views.clock_resets import UNIT_FACTORS, UNIT_WITHIN

_FEWEST_STEPS: Final = 3
"""Steps of a part of the stream that must agree in another unit: a single long one is a gap."""

_BEHIND: Final = 2
"""Least ratio of timestamps behind an earlier one to steps back. k samples in reverse order have k - 1 steps back and k
- 1 timestamps behind; a clock that was set back has one step back and many timestamps behind."""


@dataclass(frozen=True, slots=True)
class ClockSetBack(Feature):
    """A clock that was set back, so that runs of samples have earlier timestamps than the samples before.

    Attributes
    ----------
    offset_ms
        Clock offset of the wrong part, ms: of the part before the step back if a step forwards of the same length
        precedes it, else of the part after it.
    """

    offset_ms: float


@dataclass(frozen=True, slots=True)
class PartInOtherUnit(Feature):
    """Successive steps that are all too long or too short by a factor of units.

    Attributes
    ----------
    factor
        The factor.
    first_row, last_row
        First and last row of the part, both included.
    """

    factor: float
    first_row: int
    last_row: int


def clocks_of(facts: Facts) -> Iterator[tuple[str, Clock]]:
    """Yield each sampled stream and its clock, by name."""
    for stream in sorted(facts.clocks):
        yield stream, facts.clocks[stream]


def fits_of(facts: Facts) -> Iterator[tuple[str, RegularClock]]:
    """Yield each sampled stream that has three timestamps in order, and the regular clock fitted to them."""
    for stream, clock in clocks_of(facts):
        fit = fit_regular_clock(clock.times_ns[clock.advancing]) if clock.usable else None
        if fit is not None:
            yield stream, fit


def placed_streams(facts: Facts) -> list[str]:
    """Return the sampled streams that have three timestamps in order, which are those that ``fits_of`` can fit."""
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
    """Return the timestamp of a row on the clock of the file, us; None where there is no such row.

    Parameters
    ----------
    facts
        With the file's origin.
    times_ns
        (n,) timestamps of a stream, ns from the file's origin.
    row
        Row of the stream.

    Returns
    -------
    float or None
        Us.
    """
    return None if row is None or row >= len(times_ns) else facts.to_file_us(float(times_ns[row]))


def all_timestamps(facts: Facts) -> Coverage:
    """Return the coverage of checks that read every timestamp of the file."""
    count = sum(len(clock.times_ns) for clock in facts.clocks.values())
    count += facts.events.count if facts.events else 0
    return Coverage(count, count, "stamps")


def event_scan(facts: Facts) -> EventScan:
    """Return the scan of the event timestamps.

    Raises
    ------
    ValueError
        The file has no events.
    """
    if facts.events is None:
        raise ValueError("Expected the file to have events, got none; the check needs them")
    return facts.events


def clock_set_back(clock: Clock, backward: NDArray[np.intp]) -> ClockSetBack | None:
    """Return the offset of a clock that was set back at one of its steps ``backward``; None where samples moved.

    Timestamps of samples in another order, such as that of text (10 before 9), are those of an even clock once they are
    sorted: each sample has a period of its own. A clock that was set back counts some time twice, or leaves some out.

    Parameters
    ----------
    clock
        Of a sampled stream.
    backward
        (k,) rows before the steps back.

    Returns
    -------
    ClockSetBack or None
        None without steps back, and where samples were exchanged.
    """
    # Exchanged samples have few timestamps behind for each step back; a clock that was set back has many (_BEHIND).
    if not len(backward) or int(np.count_nonzero(~clock.advancing)) <= _BEHIND * len(backward):
        return None
    if _is_even(np.sort(clock.times_ns)):
        return None
    first = int(backward[0])
    steps_ns = np.diff(clock.times_ns)
    period_ns = float(np.median(steps_ns))
    ahead_ns, back_ns = float(steps_ns[: first + 1].max()) - period_ns, float(steps_ns[first]) - period_ns
    # If a step forwards of about the same length precedes the step back, the clock was ahead between both steps.
    # Otherwise the clock is behind from the step back on.
    return ClockSetBack((ahead_ns if abs(ahead_ns + back_ns) <= period_ns else back_ns) / NS_PER_MS)


def _is_even(times_ns: NDArray[np.int64]) -> bool:
    """Whether all steps are one period, to half of it: no period has two samples, and none has no sample."""
    steps_ns = np.diff(times_ns)
    period_ns = float(np.median(steps_ns))
    return bool(np.all(np.abs(steps_ns - period_ns) < period_ns / 2))


def durations_ns(facts: Facts) -> dict[str, float]:
    """Return the time from first to last timestamp of every stream that has one, the events last."""
    extents_ns = {stream: extent_ns(facts.clocks[stream]) for stream in placed_streams(facts)}
    if facts.events is not None and facts.events.count > 1:
        first_ns, last_ns = facts.events.first_ns, facts.events.last_ns
        if extents_ns:
            first_ns, last_ns = facts.events.extent_ns(*np.median(list(extents_ns.values()), axis=0).tolist())
        extents_ns["events"] = first_ns, last_ns
    return {stream: float(stop - start) for stream, (start, stop) in extents_ns.items()}


def reference_duration_ns(facts: Facts, durations: dict[str, float]) -> float | None:
    """Return the duration that the rates of flow imply, else the median of all; None with fewer than two.

    Only durations above zero count for the median.

    Parameters
    ----------
    facts
        With the clocks of flow.
    durations
        Duration of each stream, ns, as by ``durations_ns``.

    Returns
    -------
    float or None
        Ns.
    """
    # Intervals of flow abut, so n fields of a rate f last n / f.
    promised_ns = [
        len(facts.clocks[stream].times_ns) * NS_PER_S / flow_rate_hz(stream)
        for stream in facts.flow_streams
        if stream in durations
    ]
    if promised_ns:
        return float(np.median(promised_ns))
    positive = [duration for duration in durations.values() if duration > 0]
    return float(np.median(positive)) if len(positive) > 1 else None


def part_in_other_unit(facts: Facts, stream: str) -> PartInOtherUnit | None:
    """Return the longest run of steps of a stream that are all too long or too short by one factor of units.

    The correct length of a step is the duration that all streams share over the number of steps. The first factor with
    a run of ``_FEWEST_STEPS`` counts.

    Parameters
    ----------
    facts
        With the clocks of all streams.
    stream
        A sampled stream.

    Returns
    -------
    PartInOtherUnit or None
        None where no run is long enough, and where all steps are one: the whole stream is no part.
    """
    times_ns = facts.clocks[stream].times_ns
    reference_ns = reference_duration_ns(facts, durations_ns(facts))
    if reference_ns is None or len(times_ns) <= _FEWEST_STEPS:
        return None
    with np.errstate(over="ignore"):
        ratios = np.diff(times_ns) / (reference_ns / (len(times_ns) - 1))
    for factor in UNIT_FACTORS:
        near = np.flatnonzero(np.abs(ratios / factor - 1) <= UNIT_WITHIN)
        runs = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
        longest = max(runs, key=len)
        if factor != 1.0 and _FEWEST_STEPS <= len(longest) < len(ratios):
            return PartInOtherUnit(factor, int(longest[0]), int(longest[-1]) + 1)
    return None
