"""The unit of the timestamps."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from fedora_qa.checks.clocks.streams import all_timestamps, extent_ns, file_us, placed_streams
from fedora_qa.checks.protocol import FactsCheck, Observation, Statistic, Suspect
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.timestamp_unit import UNIT_FACTORS, UNIT_WITHIN, unit_factor

_FEWEST_STEPS: Final = 3
"""Steps of a part of the stream that must agree in another unit: a single long one is a gap."""


class ClocksUnit(FactsCheck):
    """Are all stamps in microseconds of one clock?

    The factor by which each stream's stamps are too large, told from how long the stream lasts.

    Why it matters
    --------------
    Every loader that trusts the unit places the whole stream elsewhere in time, and velocities are off by the factor.

    How
    ---
    The time from a stream's first to its last stamp is held against the median of all streams, or against what the
    names of the flow rates promise (fields over Hz) where there is flow. The factors that real files hold are told
    apart: seconds, milliseconds and nanoseconds written as microseconds, and the 32 of a simulation that was stamped
    by the wall clock while it ran 32 times slower. Stamps that count up by exactly one while others span more than
    twice as much are numbers of samples, not times; their factor is one microsecond over the period. Three or more
    successive steps that are too long by one of the factors are a part in another unit.

    Noise model
    -----------
    None at random. A factor is taken where the ratio of durations lies within 20% of it: the factors lie 30 times
    apart and farther, and streams that end early by less than a fifth are for ``clocks.span``. All else counts as 1.

    Cannot see
    ----------
    All streams in one wrong unit, unless flow says how long they should last; a file with a single stream and no
    flow.

    Sources
    -------
    First principles. The factors are from the list of traps that real files hold, the 32 from the simulation of the
    dataset's paper.
    """

    name = "clocks.unit"

    def examine(self, facts: Facts) -> Observation:
        """Name the factor of each stream."""
        durations = dict(_durations_ns(facts))
        reference = _reference_duration_ns(facts, durations)
        if reference is None:
            return Observation(all_timestamps(facts), unobservable="no two streams have a duration to be compared")
        measured = [self._factor(facts, stream, length / reference) for stream, length in durations.items()]
        whole = {one.where.stream for one in measured if one.value == 1.0}
        parts = (self._part(facts, stream) for stream in facts.clocks if stream in whole)
        return Observation(all_timestamps(facts), (*measured, *(one for one in parts if one is not None)))

    def _factor(self, facts: Facts, stream: str, ratio: float) -> Statistic:
        counts = ratio < 1 / 2 and _counts_samples(facts, stream)
        factor = ratio if counts else unit_factor(ratio)
        return Statistic(
            name=f"{stream}.unit_factor",
            value=factor,
            unit="1",
            expected=1.0,
            standard_error=0.0,
            resolution=31.0,
            statement=f"The stamps of {stream} span {ratio:.6g} times as long as the other streams: "
            f"they {'are numbers of samples, not times' if counts else UNIT_FACTORS[factor]}.",
            code="clocks.unit.factor",
            where=Where(stream=stream),
            severity="critical",
            suspects=(Suspect("time_unit", stream, 1.0, factor, "1"),),
        )

    def _part(self, facts: Facts, stream: str) -> Statistic | None:
        found = _part_in_another_unit(facts, stream)
        if found is None:
            return None
        factor, first, last = found
        times_ns = facts.clocks[stream].times_ns
        return Statistic(
            name=f"{stream}.unit_factor_of_a_part",
            value=factor,
            unit="1",
            expected=1.0,
            standard_error=0.0,
            resolution=31.0,
            statement=f"From row {first} to {last} the stamps of {stream} {UNIT_FACTORS[factor]}: the steps between "
            f"them are {factor:g} times as long as elsewhere.",
            code="clocks.unit.part",
            where=Where(stream, file_us(facts, times_ns, first), None, index_start=first, index_stop=last + 1),
            severity="critical",
            suspects=(Suspect("time_unit", stream, 1.0, factor, "1"),),
        )


def suspect_of_part(facts: Facts, stream: str) -> tuple[Suspect, ...]:
    """Suspect another unit of a part of the stamps, with most of the weight, where its steps say so; nothing else."""
    found = _part_in_another_unit(facts, stream)
    return () if found is None else (Suspect("time_unit", stream, 0.96, found[0], "1"),)


def _part_in_another_unit(facts: Facts, stream: str) -> tuple[float, int, int] | None:
    """Return the factor of successive steps that are all too long or short by it, and the rows that they lie between.

    The others tell how long a step should be: the duration that all streams share, over the number of samples.
    """
    times_ns = facts.clocks[stream].times_ns
    reference_ns = _reference_duration_ns(facts, dict(_durations_ns(facts)))
    if reference_ns is None or len(times_ns) <= _FEWEST_STEPS:
        return None
    with np.errstate(over="ignore"):
        ratios = np.diff(times_ns) / (reference_ns / (len(times_ns) - 1))
    for factor in UNIT_FACTORS:
        like = np.flatnonzero(np.abs(ratios / factor - 1) <= UNIT_WITHIN)
        runs = np.split(like, np.flatnonzero(np.diff(like) > 1) + 1)
        longest = max(runs, key=len)
        if factor != 1.0 and len(longest) >= _FEWEST_STEPS:
            return factor, int(longest[0]), int(longest[-1]) + 1
    return None


def _counts_samples(facts: Facts, stream: str) -> bool:
    """Whether all stamps of a stream count up by one of the file's microseconds."""
    clock = facts.clocks.get(stream)
    return clock is not None and len(clock.times_ns) > 2 and bool(np.all(np.diff(clock.times_ns) == NS_PER_US))


def _durations_ns(facts: Facts) -> Iterator[tuple[str, float]]:
    for stream in placed_streams(facts):
        start, stop = extent_ns(facts.clocks[stream])
        yield stream, float(stop - start)
    if facts.events is not None and facts.events.count > 1:
        yield "events", float(facts.events.last_ns - facts.events.first_ns)


def _reference_duration_ns(facts: Facts, durations: dict[str, float]) -> float | None:
    """Median duration, or what the names of the flow rates promise where they disagree with it."""
    flow = [
        len(facts.clocks[stream].times_ns) * NS_PER_S / int(stream.removeprefix("flow/").removesuffix("hz"))
        for stream in facts.flow_streams
        if stream in durations
    ]
    if flow:
        return float(np.median(flow))
    positive = [length for length in durations.values() if length > 0]
    return float(np.median(positive)) if len(positive) > 1 else None
