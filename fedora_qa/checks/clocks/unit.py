"""The unit of timestamps."""

from typing import Final

import numpy as np

from fedora_qa.checks.clocks.streams import (
    all_timestamps,
    durations_ns,
    file_us,
    part_in_other_unit,
    reference_duration_ns,
)
from fedora_qa.checks.protocol import FactsCheck, Observation, Statistic
from fedora_qa.conventions import NS_PER_US
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.clock_resets import TICK_FACTORS, UNIT_FACTORS, tick_factor, unit_factor

_COINCIDE: Final = 0.9
"""Least share of timestamps that must coincide with those of another stream once they are divided by a factor."""

_MEANINGS: Final = {**UNIT_FACTORS, **TICK_FACTORS}


class ClocksUnit(FactsCheck):
    """Are all timestamps in microseconds of one clock?

    For each stream, the factor by which its timestamps are too large, estimated from the duration of the stream.

    Why it matters
    --------------
    Every loader that assumes the unit places the whole stream at another time, and velocities are wrong by the factor.

    How
    ---
    The time from a stream's first to its last timestamp is compared with the median over all streams. Where there is
    flow, it is compared with the duration that the rates in the names of flow imply (number of fields over Hz). The
    factors considered are those of seconds, milliseconds and nanoseconds written as microseconds, and 32: a simulation
    that runs 32 times slower than real time, with timestamps of the wall clock. Ticks of 100 ns and of 90 kHz are
    considered where a sampled stream, divided by their factor, has the timestamps of another stream, and for events.
    Timestamps that increase by exactly one, while other streams last more than twice as long, are sample numbers; their
    factor is one microsecond over the period. Three or more successive steps that are too long or too short by one of
    the factors are a part in another unit.

    Noise model
    -----------
    No random error. A factor is assigned where the ratio of durations is within 20% of it: the factors differ by 30 and
    more, and ``clocks.span`` detects streams that end early by less than a fifth. Ticks are assigned within 5%: streams
    of one second begin and end within a few hundredths. Any other ratio counts as 1.

    Cannot detect
    -------------
    A unit error of all streams together, unless flow implies the duration. A file with a single stream and no flow.

    Sources
    -------
    First principles. The factors are errors of unit in real files; 32 is from the simulation of the dataset's paper.
    """

    name = "clocks.unit"

    def examine(self, facts: Facts) -> Observation:
        """Measure the factor of each stream."""
        durations = durations_ns(facts)
        reference = reference_duration_ns(facts, durations)
        if reference is None:
            return Observation(all_timestamps(facts), unobservable="fewer than two streams have a duration")
        factors: list[Statistic] = []
        for stream, duration_ns in durations.items():
            ratio = duration_ns / reference
            # Timestamps that count up by one of the file's microseconds are numbers of samples.
            clock = facts.clocks.get(stream)
            counts = (
                ratio < 1 / 2
                and clock is not None
                and len(clock.times_ns) > 2
                and bool(np.all(np.diff(clock.times_ns) == NS_PER_US))
            )
            factor = ratio if counts else unit_factor(ratio)
            ticks = tick_factor(ratio) if factor == 1.0 else 1.0
            # A still scene lets events end early, and nothing lets them end late.
            if ticks != 1.0 and (ticks > 1.0 if clock is None else _coincides(facts, stream, ticks)):
                factor = ticks
            clause = "are sample numbers, not times" if counts else _MEANINGS[factor]
            text = f"The timestamps of {stream} span {ratio:.6g} times as long as the other streams: they {clause}."
            factors.append(_factor(f"{stream}.unit_factor", factor, text, "clocks.unit.factor", Where(stream=stream)))
        # A stream in another unit as a whole has no part in another unit besides.
        agreeing = {statistic.where.stream for statistic in factors if statistic.value == 1.0}
        for stream in (stream for stream in facts.clocks if stream in agreeing):
            part = part_in_other_unit(facts, stream)
            if part is not None:
                first, last = part.first_row, part.last_row
                start_us = file_us(facts, facts.clocks[stream].times_ns, first)
                where = Where(stream, start_us, None, index_start=first, index_stop=last + 1)
                text = (
                    f"From row {first} to {last} the timestamps of {stream} {UNIT_FACTORS[part.factor]}: the steps "
                    f"between them are {part.factor:g} times as long as elsewhere."
                )
                factors.append(_factor(f"{stream}.unit_factor_of_a_part", part.factor, text, "clocks.unit.part", where))
        return Observation(all_timestamps(facts), tuple(factors))


def _coincides(facts: Facts, stream: str, factor: float) -> bool:
    """Whether a stream whose timestamps are divided by a factor has, from its first on, those of another stream.

    Streams of one clock share their times. A stream that was cut off would have them without the division.
    """
    times_ns = facts.clocks[stream].times_ns
    # Rounding to whole ticks, and to microseconds.
    within_ns = NS_PER_US * (1 / factor + 1)
    elapsed_ns = (times_ns - times_ns[0]) / factor
    for name, other in facts.clocks.items():
        if name == stream or not other.usable or len(other.times_ns) < 2:
            continue
        others_ns = np.unique(other.times_ns - other.times_ns[0])
        after = np.clip(np.searchsorted(others_ns, elapsed_ns), 1, len(others_ns) - 1)
        apart_ns = np.minimum(np.abs(others_ns[after] - elapsed_ns), np.abs(others_ns[after - 1] - elapsed_ns))
        if np.mean(apart_ns <= within_ns) >= _COINCIDE:
            return True
    return False


def _factor(name: str, factor: float, statement: str, code: str, where: Where) -> Statistic:
    return Statistic(
        name=name,
        value=factor,
        unit="1",
        expected=1.0,
        standard_error=0.0,
        # Half of the least difference of a factor from 1, that of 0.09.
        resolution=0.45,
        statement=statement,
        code=code,
        where=where,
        severity="critical",
    )
