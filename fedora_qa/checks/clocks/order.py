"""Are timestamps in order?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.clocks.streams import (
    all_timestamps,
    clock_set_back,
    clocks_of,
    file_us,
    part_in_other_unit,
)
from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import FactsCheck, Observation, Statistic
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.estimators.clocks.regular_clock import is_rounded
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts, has_place
from fedora_qa.views.clock_resets import clock_reset


@dataclass(frozen=True, slots=True)
class CounterWrap(Feature):
    """A step back by nearly 2^31 or 2^32 us: a 32-bit counter that overflowed."""


@dataclass(frozen=True, slots=True)
class RoundedRepeats(Feature):
    """Repeated timestamps are those of a regular clock that was rounded to a grid above its period.

    Attributes
    ----------
    grid_ms
        The grid, ms.
    """

    grid_ms: float


class ClocksOrder(FactsCheck):
    """Do the timestamps of every stream increase?

    In every stream, the number of steps backwards. In every stream but the events, the number of repeated timestamps;
    events may share a timestamp.

    Why it matters
    --------------
    Interpolation, search and integration over time assume that timestamps increase. A binary search in timestamps that
    do not increase returns a wrong row without an error, and an integral over a negative step cancels a part of itself.

    How
    ---
    Every timestamp of the file is read at any effort, and consecutive ones are compared as integers. The kind of
    disorder is inferred from its pattern. A step back by nearly 2^31 or 2^32 us is a 32-bit counter that overflowed. If
    more than two timestamps a step back are earlier than one before them, the clock was set back by the size of that
    step. Otherwise samples were exchanged. Ten or more repeated timestamps that never delay later rows by more than a
    step were rounded to a grid above the period (``fedora_qa/estimators/clocks/regular_clock.py``). Other repeated
    timestamps are samples that were written twice.

    Noise model
    -----------
    None: the counts are exact, and both are zero in a correct file.

    Cannot detect
    -------------
    Samples that were exchanged together with their timestamps and then sorted. Events in a wrong order within one
    timestamp (``event_stream.duplicates``). Of events only the counts, the first step back and the longest steps are
    kept.

    Sources
    -------
    First principles. 32-bit microseconds overflow after 2147 s (signed) or 4295 s (unsigned).
    """

    name = "clocks.order"

    def examine(self, facts: Facts) -> Observation:
        """Count steps back and repeated timestamps in all streams."""
        statistics: list[Statistic] = []
        for stream, clock in clocks_of(facts):
            # Subtracted as int64 before any conversion: float64 seconds since 1970 lose 0.17 us.
            steps = np.diff(clock.times_ns)
            # Timestamps without a place in time are counted by integrity.finite.
            placed = has_place(clock.times_ns)
            neighbours = placed[:-1] & placed[1:]
            backward, repeated = np.flatnonzero(neighbours & (steps < 0)), np.flatnonzero(neighbours & (steps == 0))
            # Timestamps that were rounded to a grid above the period repeat, as those of samples that were written
            # twice.
            rounded: tuple[Feature, ...] = ()
            if len(repeated) and is_rounded(clock.times_ns):
                # Such a clock steps by 0 or by the grid: the longest step is the grid.
                rounded = (RoundedRepeats(float(np.max(np.diff(clock.times_ns))) / NS_PER_MS),)
            # A part in another unit, a counter that wrapped and a clock that was set back step back as well.
            disorders: list[Feature] = []
            if len(backward):
                part, set_back = part_in_other_unit(facts, stream), clock_set_back(clock, backward)
                wraps = _is_wrap(int(clock.times_ns[backward[0] + 1] - clock.times_ns[backward[0]]))
                disorders += [part] if part is not None else []
                disorders += [CounterWrap()] if wraps else []
                disorders += [set_back] if set_back is not None else []
            statistics += [
                self._count(facts, stream, "backward_steps", backward, tuple(disorders)),
                self._count(facts, stream, "repeated_stamps", repeated, rounded),
            ]
        # Events may share a timestamp, so that only their steps back are counted.
        if facts.events is not None:
            events, reset = facts.events, clock_reset(facts.events)
            wrap = (CounterWrap(),) if _is_wrap(-events.largest_decrease_ns) else ()
            statistics.append(
                count_of_faults(
                    name="events.backward_steps",
                    value=events.decreases,
                    unit="events",
                    statement=f"{events.decreases} events are earlier than the one before, first at row "
                    f"{events.first_decrease}, by up to {events.largest_decrease_ns / NS_PER_US:.6g} us; timestamps of "
                    "events must not decrease.",
                    code="clocks.order.backward_steps",
                    where=Where(stream="events", index_start=events.first_decrease if events.decreases else None),
                    severity="critical",
                    features=(*wrap, *((reset,) if reset is not None else ())),
                )
            )
        return Observation(all_timestamps(facts), tuple(statistics))

    def _count(
        self, facts: Facts, stream: str, rule: str, rows: NDArray[np.intp], features: tuple[Feature, ...]
    ) -> Statistic:
        times_ns = facts.clocks[stream].times_ns
        first = int(rows[0]) + 1 if len(rows) else None
        relation = "earlier than" if rule == "backward_steps" else "equal to"
        place = "" if first is None else f", first at row {first} ({facts.to_file_us(times_ns[first]):.0f} us)"
        return count_of_faults(
            name=f"{stream}.{rule}",
            value=len(rows),
            unit="samples",
            statement=f"{len(rows)} timestamps of {stream} are {relation} the one before{place}; they must increase.",
            code=f"clocks.order.{rule}",
            where=Where(stream=stream, index_start=first, start_us=file_us(facts, times_ns, first)),
            severity="critical",
            features=features,
        )


def _is_wrap(step_ns: int) -> bool:
    # A counter of 32 bits, signed or not, overflows by 2^31 or 2^32 us; the next sample comes a little later.
    return any(abs(step_ns / NS_PER_US + 2.0**bits) < 2.0**bits / 100 for bits in (31, 32))
