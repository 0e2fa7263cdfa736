"""The clocks of the streams: order, gaps, common span, resolution. Only stamps are looked at."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.clocks.streams import all_stamps, clocks_of, extent_ns, file_us, fits_of
from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import FactsCheck, Measured, Notice, Observation, Suspect
from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.regular_clock import RegularClock
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Clock, EventScan, Facts


class Order(FactsCheck):
    """Do the stamps of every stream advance?

    Counts steps backwards (events may repeat a stamp, every other stream may not) and repeated stamps. Exact: every
    stamp of the file is looked at, whatever the effort. A step back by nearly 2^31 or 2^32 us is named as the wrap
    of a 32-bit counter.
    """

    name = "clocks.order"

    def examine(self, facts: Facts) -> Observation:
        """Count over all streams."""
        measured = [m for stream, clock in clocks_of(facts) for m in self._of_samples(facts, stream, clock)]
        if facts.events is not None:
            measured.append(self._of_events(facts))
        return Observation(all_stamps(facts), tuple(measured))

    def _of_samples(self, facts: Facts, stream: str, clock: Clock) -> Iterator[Measured]:
        steps = np.diff(clock.times_ns)
        yield self._count(facts, stream, "backward_steps", np.flatnonzero(steps < 0), clock.times_ns)
        yield self._count(facts, stream, "repeated_stamps", np.flatnonzero(steps == 0), clock.times_ns)

    def _count(
        self, facts: Facts, stream: str, rule: str, rows: NDArray[np.intp], times_ns: NDArray[np.int64]
    ) -> Measured:
        first = int(rows[0]) + 1 if len(rows) else None
        said = "earlier than" if rule == "backward_steps" else "equal to"
        place = "" if first is None else f", first at row {first} ({facts.to_file_us(times_ns[first]):.0f} us)"
        cause = "unsorted" if rule == "backward_steps" else "duplicated_samples"
        suspects = [Suspect(cause, stream, 0.9, float(len(rows)), "samples")]
        if first is not None and rule == "backward_steps" and _is_wrap(int(times_ns[first] - times_ns[first - 1])):
            suspects.insert(0, Suspect("time_unit", stream, 0.95))
        return count_of_faults(
            name=f"{stream}.{rule}",
            value=len(rows),
            unit="samples",
            statement=f"{len(rows)} stamps of {stream} are {said} the one before{place}; they must increase.",
            code=f"clocks.order.{rule}",
            where=Where(stream=stream, index_start=first, start_us=file_us(facts, times_ns, first)),
            severity="critical",
            suspects=tuple(suspects),
        )

    def _of_events(self, facts: Facts) -> Measured:
        events = _events(facts)
        first = events.first_decrease if events.decreases else None
        return count_of_faults(
            name="events.backward_steps",
            value=events.decreases,
            unit="events",
            statement=f"{events.decreases} events are earlier than the one before, first at row {first}; "
            "they must be in the order of time.",
            code="clocks.order.backward_steps",
            where=Where(stream="events", index_start=first),
            severity="critical",
            suspects=(
                Suspect("unsorted", "events", 0.9, float(events.decreases), "events"),
                # Rounding of a part of the stamps puts some of them before their neighbours.
                Suspect("quantised_time", "events", 0.3),
            ),
        )


class Gaps(FactsCheck):
    """Are samples missing?

    A step of about k periods (the median step) hides k - 1 samples. Exact for regular streams; where jitter exceeds
    a tenth of the period a gap cannot be told from it, and the stream is only noted.
    """

    name = "clocks.gaps"

    def examine(self, facts: Facts) -> Observation:
        """Count missing samples over all streams."""
        measured: list[Measured] = []
        notices: list[Notice] = []
        for stream, fit in fits_of(facts):
            if fit.regular:
                measured.append(self._missing(facts, stream, fit))
            else:
                jitter = f"jitter {fit.jitter_ns / NS_PER_US:.3g} us of a period of {fit.period_ns / NS_PER_US:.4g} us"
                notices.append(
                    Notice(
                        "clocks.gaps.irregular", f"{stream} is irregular ({jitter}): gaps cannot be told", Where(stream)
                    )
                )
        empty = "" if measured or notices else "no stream has three stamps in order"
        return Observation(all_stamps(facts), tuple(measured), tuple(notices), unobservable=empty)

    def _missing(self, facts: Facts, stream: str, fit: RegularClock) -> Measured:
        clock = facts.clocks[stream]
        rows = np.flatnonzero(clock.advancing)
        first = int(rows[fit.gap_after[0]]) if len(fit.gap_after) else None
        stop = None if first is None else first + 1
        return count_of_faults(
            name=f"{stream}.missing",
            value=fit.missing,
            unit="samples",
            statement=f"{fit.missing} samples of {stream} are missing in {len(fit.gap_after)} gaps, "
            f"the first behind row {first}.",
            code="clocks.gaps.missing",
            where=Where(
                stream=stream,
                index_start=first,
                index_stop=stop,
                start_us=file_us(facts, clock.times_ns, first),
                stop_us=file_us(facts, clock.times_ns, stop),
            ),
            suspects=(Suspect("dropped_samples", stream, 0.9, float(fit.missing), "samples"),),
        )


class Span(FactsCheck):
    """Do the streams begin and end together?

    Each stream's first and last instant are held against the median first and last of all sampled streams. A stream
    may begin or end up to a period of its own inside the recording, and so may the median stream: the sum of both
    periods is the allowance. Events are not held to it, since a still scene gives none.
    """

    name = "clocks.span"

    def not_applicable(self, facts: Facts) -> str:
        """Need two sampled streams."""
        return "" if len(dict(fits_of(facts))) > 1 else "fewer than two streams have three stamps in order"

    def examine(self, facts: Facts) -> Observation:
        """Measure how much later each stream begins and how much earlier it ends."""
        fits = dict(fits_of(facts))
        ends = {stream: extent_ns(facts.clocks[stream]) for stream in fits}
        begin = _consensus([start for start, _ in ends.values()])
        finish = _consensus([stop for _, stop in ends.values()])
        usual_ns = float(np.median([fit.period_ns for fit in fits.values()]))
        measured: list[Measured] = []
        for stream, (start, stop) in ends.items():
            allowance_ns = fits[stream].period_ns + usual_ns
            late, early = start - begin, finish - stop
            suspects = self._suspects(stream, late, early, finish - begin)
            for rule, value in (("begins_late", late), ("ends_early", early)):
                measured.append(self._one(facts, stream, rule, value, allowance_ns, suspects))
        return Observation(all_stamps(facts), tuple(measured))

    def _one(
        self, facts: Facts, stream: str, rule: str, value_ns: float, allowance_ns: float, suspects: tuple[Suspect, ...]
    ) -> Measured:
        value_ms = value_ns / 1e6
        said = "begins {:.4g} ms after" if rule == "begins_late" else "ends {:.4g} ms before"
        start, stop = extent_ns(facts.clocks[stream])
        return Measured(
            name=f"{stream}.{rule}",
            value=value_ms,
            unit="ms",
            standard_error=0.0,
            allowance=allowance_ns / 1e6,
            resolution=1e-3,
            statement=f"{stream} {said.format(value_ms)} the other streams.",
            code=f"clocks.span.{rule}",
            where=Where(stream=stream, start_us=facts.to_file_us(start), stop_us=facts.to_file_us(stop)),
            suspects=suspects,
        )

    def _suspects(self, stream: str, late_ns: float, early_ns: float, span_ns: float) -> tuple[Suspect, ...]:
        shift_ns = (late_ns - early_ns) / 2
        if late_ns * early_ns < 0 and abs(late_ns + early_ns) < 0.1 * abs(shift_ns):
            return (Suspect("time_offset", stream, 0.9, shift_ns / 1e6, "ms"),)
        return (Suspect("truncated", stream, 0.8, 100 * (late_ns + early_ns) / max(span_ns, 1.0), "percent"),)


def _consensus(instants_ns: list[int]) -> float:
    """Return the median, which one stray stream cannot move."""
    return float(np.median(instants_ns))


def _is_wrap(step_ns: int) -> bool:
    return any(abs(step_ns / NS_PER_US + 2.0**bits) < 2.0**bits / 100 for bits in (31, 32))


def _events(facts: Facts) -> EventScan:
    if facts.events is None:
        raise ValueError("Expected the file to have events, got none; the check needs them")
    return facts.events
