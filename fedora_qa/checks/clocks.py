"""The clocks of the streams: order, unit, rate, gaps, common span, resolution. Only stamps are looked at."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import FactsCheck, Measured, Notice, Observation, Suspect
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.regular_clock import RegularClock, fit_regular_clock
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Clock, EventScan, Facts

_UNIT_FACTORS: Final = {
    1e-6: "are in seconds",
    1e-3: "are in milliseconds",
    1.0: "agree with the other streams",
    32.0: "are wall-clock time of a simulation that ran 32 times slower",
    1e3: "are in nanoseconds",
}
"""What the ratio of a stream's duration to that of the others tells, the mistakes that real files hold."""

_NOMINAL_WITHIN: Final = 0.01
"""A rate nearer than this to a nominal one is meant to be that."""


class Order(FactsCheck):
    """Do the stamps of every stream advance?

    Counts steps backwards (events may repeat a stamp, every other stream may not) and repeated stamps. Exact: every
    stamp of the file is looked at, whatever the effort. A step back by nearly 2^31 or 2^32 us is named as the wrap
    of a 32-bit counter.
    """

    name = "clocks.order"

    def examine(self, facts: Facts) -> Observation:
        """Count over all streams."""
        measured = [m for stream, clock in _clocks(facts) for m in self._of_samples(facts, stream, clock)]
        if facts.events is not None:
            measured.append(self._of_events(facts))
        return Observation(_all_stamps(facts), tuple(measured))

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
        return Measured(
            name=f"{stream}.{rule}",
            value=float(len(rows)),
            unit="samples",
            standard_error=0.0,
            resolution=1.0,
            statement=f"{len(rows)} stamps of {stream} are {said} the one before{place}; they must increase.",
            code=f"clocks.order.{rule}",
            where=Where(stream=stream, index_start=first, start_us=_file_us(facts, times_ns, first)),
            severity="critical",
            suspects=tuple(suspects),
        )

    def _of_events(self, facts: Facts) -> Measured:
        events = _events(facts)
        first = events.first_decrease if events.decreases else None
        return Measured(
            name="events.backward_steps",
            value=float(events.decreases),
            unit="events",
            standard_error=0.0,
            resolution=1.0,
            statement=f"{events.decreases} events are earlier than the one before, first at row {first}; "
            "they must be in the order of time.",
            code="clocks.order.backward_steps",
            where=Where(stream="events", index_start=first),
            severity="critical",
            suspects=(Suspect("unsorted", "events", 0.9, float(events.decreases), "events"),),
        )


class Unit(FactsCheck):
    """Are all stamps in microseconds of one clock?

    A stream's duration is held against the median duration of all streams, and the length of flow intervals against
    the rate in their name. Only gross factors are told apart here (1000, 10^6, and the 32 of wall-clock stamps):
    the value is the factor nearest in logarithm. Blind where a file has a single stream and no flow.
    """

    name = "clocks.unit"

    def examine(self, facts: Facts) -> Observation:
        """Name the factor of each stream."""
        durations = dict(_durations_ns(facts))
        reference = _reference_duration_ns(facts, durations)
        if reference is None:
            return Observation(_all_stamps(facts), unobservable="no two streams have a duration to be compared")
        measured = tuple(self._factor(stream, length / reference) for stream, length in durations.items())
        return Observation(_all_stamps(facts), measured)

    def _factor(self, stream: str, ratio: float) -> Measured:
        factor = min(_UNIT_FACTORS, key=lambda known: abs(np.log(ratio / known)))
        return Measured(
            name=f"{stream}.unit_factor",
            value=factor,
            unit="1",
            expected=1.0,
            standard_error=0.0,
            resolution=31.0,
            statement=f"The stamps of {stream} span {ratio:.6g} times as long as the other streams: "
            f"they {_UNIT_FACTORS[factor]}.",
            code="clocks.unit.factor",
            where=Where(stream=stream),
            severity="critical",
            suspects=(Suspect("time_unit", stream, 1.0, factor, "1"),),
        )


class Rate(FactsCheck):
    """Does every stream run at its nominal rate?

    The period is the least-squares slope of the stamps over their numbers. Flow must keep the rate in its name. Any
    other stream is held against the nearest nominal rate (a whole number of Hz, or a period of whole microseconds)
    if another stream of the file keeps its own nominal rate: all stamps are of one clock. Otherwise an odd rate is
    only noted.

    Noise model: rounding to the tick of the stamps moves the slope by at most one tick over the whole span,
    whatever the phases of the two ends; jitter adds the slope's standard error.
    """

    name = "clocks.rate"

    def examine(self, facts: Facts) -> Observation:
        """Measure each stream's rate error in ppm."""
        fits = dict(_fits(facts))
        if not fits:
            return Observation(_all_stamps(facts), unobservable="no stream has three stamps in order")
        measured = {stream: self._error(facts, stream, fit) for stream, fit in fits.items()}
        exact = [m for m in measured.values() if m is not None and abs(m.value) <= m.allowance + 3 * m.standard_error]
        if not exact and not facts.flow_streams:
            notices = tuple(self._odd(stream, fit) for stream, fit in fits.items())
            return Observation(_all_stamps(facts), notices=notices)
        return Observation(_all_stamps(facts), tuple(m for m in measured.values() if m is not None))

    def _error(self, facts: Facts, stream: str, fit: RegularClock) -> Measured | None:
        nominal_ns = _nominal_period_ns(stream, fit.period_ns)
        deviation = fit.period_ns / nominal_ns - 1
        if abs(deviation) > _NOMINAL_WITHIN and not stream.startswith("flow/"):
            return None
        ppm = 1e6 * deviation
        span_ns = float(np.ptp(facts.clocks[stream].times_ns[facts.clocks[stream].advancing]))
        return Measured(
            name=f"{stream}.rate_error",
            value=ppm,
            unit="ppm",
            standard_error=0.0 if fit.jitter_ns <= fit.tick_ns else 1e6 * fit.period_error_ns / nominal_ns,
            allowance=1e6 * NS_PER_US / span_ns,
            statement=f"The period of {stream} is {fit.period_ns / NS_PER_US:.6g} us, {ppm:+.4g} ppm off the nominal "
            f"{nominal_ns / NS_PER_US:.6g} us.",
            code="clocks.rate.error",
            where=Where(stream=stream),
            matters=10_000.0,
            suspects=(Suspect("clock_rate", stream, 0.8, ppm, "ppm"),),
        )

    def _odd(self, stream: str, fit: RegularClock) -> Notice:
        return Notice(
            "clocks.rate.odd",
            f"{stream} runs at {NS_PER_S / fit.period_ns:.6g} Hz, no nominal rate",
            Where(stream=stream),
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
        for stream, fit in _fits(facts):
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
        return Observation(_all_stamps(facts), tuple(measured), tuple(notices), unobservable=empty)

    def _missing(self, facts: Facts, stream: str, fit: RegularClock) -> Measured:
        clock = facts.clocks[stream]
        rows = np.flatnonzero(clock.advancing)
        first = int(rows[fit.gap_after[0]]) if len(fit.gap_after) else None
        stop = None if first is None else first + 1
        return Measured(
            name=f"{stream}.missing",
            value=float(fit.missing),
            unit="samples",
            standard_error=0.0,
            resolution=1.0,
            statement=f"{fit.missing} samples of {stream} are missing in {len(fit.gap_after)} gaps, "
            f"the first behind row {first}.",
            code="clocks.gaps.missing",
            where=Where(
                stream=stream,
                index_start=first,
                index_stop=stop,
                start_us=_file_us(facts, clock.times_ns, first),
                stop_us=_file_us(facts, clock.times_ns, stop),
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
        return "" if len(dict(_fits(facts))) > 1 else "fewer than two streams have three stamps in order"

    def examine(self, facts: Facts) -> Observation:
        """Measure how much later each stream begins and how much earlier it ends."""
        fits = dict(_fits(facts))
        ends = {stream: _extent_ns(facts.clocks[stream]) for stream in fits}
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
        return Observation(_all_stamps(facts), tuple(measured))

    def _one(
        self, facts: Facts, stream: str, rule: str, value_ns: float, allowance_ns: float, suspects: tuple[Suspect, ...]
    ) -> Measured:
        value_ms = value_ns / 1e6
        said = "begins {:.4g} ms after" if rule == "begins_late" else "ends {:.4g} ms before"
        start, stop = _extent_ns(facts.clocks[stream])
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


class Resolution(FactsCheck):
    """Do event stamps have the resolution that the file declares?

    The grid on which all event stamps lie (greatest common divisor of their steps) must be that of the declared
    packets, or a microsecond for asynchronous events of the log model. By chance alone n honest stamps all fall on
    a grid of g us with probability g^-n; with a thousand events that is never. Events of the linear model come once
    a rendered step, which the format does not declare: there a grid is honest.
    """

    name = "clocks.resolution"
    needs = ("events",)
    _ENOUGH_EVENTS: Final = 1000

    def examine(self, facts: Facts) -> Observation:
        """Measure the grid of the event stamps."""
        events = _events(facts)
        coverage = Coverage(events.count, events.count, "events")
        declared = facts.declared.events
        if events.count < self._ENOUGH_EVENTS or not events.grid_ns:
            return Observation(coverage, unobservable=f"only {events.count} events: their grid is left to chance")
        if declared is not None and declared.model == "linear":
            return Observation(coverage, unobservable="events of the linear model lie on the grid of rendered steps")
        expected_us = max(1, declared.packet_interval_us if declared is not None else 0)
        grid_us = events.grid_ns / NS_PER_US
        measured = Measured(
            name="events.grid",
            value=grid_us,
            unit="us",
            expected=float(expected_us),
            standard_error=0.0,
            side="upper",
            resolution=float(expected_us),
            statement=f"All event stamps lie on a grid of {grid_us:g} us; {expected_us} us is declared.",
            code="clocks.resolution.grid",
            where=Where(stream="events"),
            suspects=(Suspect("quantised_time", "events", 0.95, grid_us / 1e3, "ms"),),
        )
        return Observation(coverage, (measured,))


def _clocks(facts: Facts) -> Iterator[tuple[str, Clock]]:
    for stream in sorted(facts.clocks):
        yield stream, facts.clocks[stream]


def _fits(facts: Facts) -> Iterator[tuple[str, RegularClock]]:
    for stream, clock in _clocks(facts):
        fit = fit_regular_clock(clock.times_ns[clock.advancing]) if clock.usable else None
        if fit is not None:
            yield stream, fit


def _extent_ns(clock: Clock) -> tuple[int, int]:
    """First and last instant; for flow from the start of the first interval to the end of the last."""
    times = clock.times_ns[clock.advancing]
    last = times[-1] if clock.ends_ns is None else clock.ends_ns[clock.advancing][-1]
    return int(times[0]), int(last)


def _durations_ns(facts: Facts) -> Iterator[tuple[str, float]]:
    for stream, clock in _clocks(facts):
        if clock.usable and len(clock.times_ns) > 1:
            start, stop = _extent_ns(clock)
            yield stream, float(stop - start)


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


def _nominal_period_ns(stream: str, period_ns: float) -> float:
    """Return the nearest period of whole microseconds or of a whole number of Hz; of flow the one in its name."""
    if stream.startswith("flow/"):
        return NS_PER_S / int(stream.removeprefix("flow/").removesuffix("hz"))
    candidates = [max(round(period_ns / NS_PER_US), 1) * NS_PER_US, NS_PER_S / max(round(NS_PER_S / period_ns), 1)]
    return min(candidates, key=lambda nominal: abs(nominal - period_ns))


def _consensus(instants_ns: list[int]) -> float:
    """Return the median, which one stray stream cannot move."""
    return float(np.median(instants_ns))


def _is_wrap(step_ns: int) -> bool:
    return any(abs(step_ns / NS_PER_US + 2.0**bits) < 2.0**bits / 100 for bits in (31, 32))


def _file_us(facts: Facts, times_ns: NDArray[np.int64], row: int | None) -> float | None:
    return None if row is None or row >= len(times_ns) else facts.to_file_us(float(times_ns[row]))


def _all_stamps(facts: Facts) -> Coverage:
    count = sum(len(clock.times_ns) for clock in facts.clocks.values())
    count += facts.events.count if facts.events else 0
    return Coverage(count, count, "stamps")


def _events(facts: Facts) -> EventScan:
    if facts.events is None:
        raise ValueError("Expected the file to have events, got none; the check needs them")
    return facts.events
