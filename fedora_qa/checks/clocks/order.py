"""Are timestamps in order?"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.clocks.streams import all_timestamps, clocks_of, event_scan, file_us
from fedora_qa.checks.clocks.unit import suspect_of_part
from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import FactsCheck, Observation, Statistic, Suspect
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.estimators.clocks.regular_clock import is_rounded
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Clock, Facts
from fedora_qa.views.clock_resets import set_clock

_BEHIND = 2
"""k samples in reverse make k - 1 steps back and as many stamps that lie behind; a clock that was set back makes one
step, behind which many lie."""


class ClocksOrder(FactsCheck):
    """Do the stamps of every stream advance?

    Steps backwards are counted in every stream, and repeated stamps in every stream but the events, which may share
    one.

    Why it matters
    --------------
    Whatever interpolates, searches or integrates over time takes stamps to increase. A binary search in stamps that do
    not increase returns some row without complaint, and an integral over a negative step undoes itself.

    How
    ---
    Every stamp of the file is looked at, whatever the effort, and consecutive ones are compared as integers. What broke
    the order is told from the pattern: a step back by nearly 2^31 or 2^32 us is a 32-bit counter that wrapped; one step
    behind which more than two stamps lie before the latest one is a clock that was set back, by the size of that step;
    otherwise samples were exchanged. Ten or more repeated stamps that never delay the rows behind them by more than a
    step were rounded to a grid above the period (``fedora_qa/estimators/clocks/regular_clock.py``); others were
    written twice.

    Noise model
    -----------
    None: the counts are exact, and an honest file has none of either.

    Cannot see
    ----------
    Samples that were exchanged together with their stamps and sorted again, and events in a wrong order within one
    stamp (``event_stream.duplicates``). Of events only counts, the first step back and the longest steps are kept.

    Sources
    -------
    First principles. That 32-bit microseconds overflow after 2147 or 4295 s is from the list of traps of real files.
    """

    name = "clocks.order"

    def examine(self, facts: Facts) -> Observation:
        """Count over all streams."""
        measured = [m for stream, clock in clocks_of(facts) for m in self._of_samples(facts, stream, clock)]
        if facts.events is not None:
            measured.append(self._of_events(facts))
        return Observation(all_timestamps(facts), tuple(measured))

    def _of_samples(self, facts: Facts, stream: str, clock: Clock) -> Iterator[Statistic]:
        steps = np.diff(clock.times_ns)
        backward, repeated = np.flatnonzero(steps < 0), np.flatnonzero(steps == 0)
        yield self._count(facts, stream, "backward_steps", backward, _suspects_of_order(facts, stream, backward))
        yield self._count(facts, stream, "repeated_stamps", repeated, _suspects_of_repeats(stream, clock, repeated))

    def _count(
        self, facts: Facts, stream: str, rule: str, rows: NDArray[np.intp], suspects: tuple[Suspect, ...]
    ) -> Statistic:
        times_ns = facts.clocks[stream].times_ns
        first = int(rows[0]) + 1 if len(rows) else None
        said = "earlier than" if rule == "backward_steps" else "equal to"
        place = "" if first is None else f", first at row {first} ({facts.to_file_us(times_ns[first]):.0f} us)"
        return count_of_faults(
            name=f"{stream}.{rule}",
            value=len(rows),
            unit="samples",
            statement=f"{len(rows)} stamps of {stream} are {said} the one before{place}; they must increase.",
            code=f"clocks.order.{rule}",
            where=Where(stream=stream, index_start=first, start_us=file_us(facts, times_ns, first)),
            severity="critical",
            suspects=suspects,
        )

    def _of_events(self, facts: Facts) -> Statistic:
        events = event_scan(facts)
        wrapped, was_set = _is_wrap(-events.largest_decrease_ns), set_clock(events)
        unsorted = Suspect("unsorted", "events", 0.9 if was_set is None else 0.3, float(events.decreases), "events")
        return count_of_faults(
            name="events.backward_steps",
            value=events.decreases,
            unit="events",
            statement=f"{events.decreases} events are earlier than the one before, first at row "
            f"{events.first_decrease}, by up to {events.largest_decrease_ns / NS_PER_US:.6g} us; they must be in the "
            "order of time.",
            code="clocks.order.backward_steps",
            where=Where(stream="events", index_start=events.first_decrease if events.decreases else None),
            severity="critical",
            suspects=(
                *((Suspect("time_unit", "events", 0.98),) if wrapped else ()),
                *(was_set.suspects if was_set is not None else ()),
                unsorted,
                Suspect("quantised_time", "events", 0.3),  # rounded in a part, some come before their neighbours
            ),
        )


def _suspects_of_order(facts: Facts, stream: str, backward: NDArray[np.intp]) -> tuple[Suspect, ...]:
    """Tell a counter that wrapped and a clock that was set back from samples in another order."""
    clock = facts.clocks[stream]
    if not len(backward):
        return ()
    step_ns = int(clock.times_ns[backward[0] + 1] - clock.times_ns[backward[0]])
    suspects = [Suspect("unsorted", stream, 0.9, float(len(backward)), "samples")]
    if _was_set_back(clock, backward):
        suspects.insert(0, Suspect("time_offset", stream, 0.92, _offset_ms(clock, int(backward[0])), "ms"))
    if _is_wrap(step_ns):
        suspects.insert(0, Suspect("time_unit", stream, 0.95))
    return (*suspect_of_part(facts, stream), *suspects)


def _was_set_back(clock: Clock, backward: NDArray[np.intp]) -> bool:
    """Whether whole runs of samples stand behind others, as where a clock was set back; not single ones."""
    return bool(len(backward)) and int(np.count_nonzero(~clock.advancing)) > _BEHIND * len(backward)


def _offset_ms(clock: Clock, back: int) -> float:
    """Return how late stamps before a step back are, where they leapt ahead by as much, else how early those after."""
    steps_ns = np.diff(clock.times_ns)
    period_ns = float(np.median(steps_ns))
    ahead_ns, back_ns = float(steps_ns[: back + 1].max()) - period_ns, float(steps_ns[back]) - period_ns
    return (ahead_ns if abs(ahead_ns + back_ns) <= period_ns else back_ns) / NS_PER_MS


def _suspects_of_repeats(stream: str, clock: Clock, repeated: NDArray[np.intp]) -> tuple[Suspect, ...]:
    """Tell stamps that were rounded to a grid above the period from samples that were written twice."""
    if not len(repeated):
        return ()
    twice = Suspect("duplicated_samples", stream, 0.9, float(len(repeated)), "samples")
    if not is_rounded(clock.times_ns):
        return (twice,)
    grid_ms = float(np.max(np.diff(clock.times_ns))) / NS_PER_MS
    return Suspect("quantised_time", stream, 0.95, grid_ms, "ms"), twice


def _is_wrap(step_ns: int) -> bool:
    return any(abs(step_ns / NS_PER_US + 2.0**bits) < 2.0**bits / 100 for bits in (31, 32))
