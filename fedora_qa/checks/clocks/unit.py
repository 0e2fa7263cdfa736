"""The unit of the timestamps."""

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
from fedora_qa.views.timestamp_unit import UNIT_FACTORS, unit_factor


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
        """Measure the factor of each stream."""
        durations = durations_ns(facts)
        reference = reference_duration_ns(facts, durations)
        if reference is None:
            return Observation(all_timestamps(facts), unobservable="no two streams have a duration to be compared")
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
            clause = "are numbers of samples, not times" if counts else UNIT_FACTORS[factor]
            text = f"The stamps of {stream} span {ratio:.6g} times as long as the other streams: they {clause}."
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
                    f"From row {first} to {last} the stamps of {stream} {UNIT_FACTORS[part.factor]}: the steps "
                    f"between them are {part.factor:g} times as long as elsewhere."
                )
                factors.append(_factor(f"{stream}.unit_factor_of_a_part", part.factor, text, "clocks.unit.part", where))
        return Observation(all_timestamps(facts), tuple(factors))


def _factor(name: str, factor: float, statement: str, code: str, where: Where) -> Statistic:
    return Statistic(
        name=name,
        value=factor,
        unit="1",
        expected=1.0,
        standard_error=0.0,
        resolution=31.0,
        statement=statement,
        code=code,
        where=where,
        severity="critical",
    )
