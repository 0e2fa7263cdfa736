"""The rates of the clocks: unit of the stamps, and the rate that each stream keeps."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from fedora_qa.checks.clocks.streams import all_stamps, extent_ns, fits_of
from fedora_qa.checks.protocol import FactsCheck, Measured, Notice, Observation, Suspect
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.regular_clock import RegularClock
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts

_UNIT_FACTORS: Final = {
    1e-6: "are in seconds",
    1e-3: "are in milliseconds",
    1.0: "agree with the other streams",
    32.0: "are wall-clock time of a simulation that ran 32 times slower",
    1e3: "are in nanoseconds",
}
"""What the ratio of a stream's duration to that of the others tells, the mistakes that real files hold."""

_UNIT_WITHIN: Final = 0.2
"""A duration farther than this from every factor is a matter of streams that end early (clocks.span)."""

_NTSC_HZ: Final = (24, 30, 48, 60, 120)
"""Rates of video that are also used divided by 1.001."""

_NOMINAL_WITHIN: Final = 0.01
"""A rate nearer than this to a nominal one is meant to be that."""


class Unit(FactsCheck):
    """Are all stamps in microseconds of one clock?

    A stream's duration is held against the median duration of all streams, and the length of flow intervals against
    the rate in their name. Only gross factors are told apart here (1000, 10^6, and the 32 of wall-clock stamps): the
    value is the factor that is right within 20%, or 1. Blind where a file has a single stream and no flow.
    """

    name = "clocks.unit"

    def examine(self, facts: Facts) -> Observation:
        """Name the factor of each stream."""
        durations = dict(_durations_ns(facts))
        reference = _reference_duration_ns(facts, durations)
        if reference is None:
            return Observation(all_stamps(facts), unobservable="no two streams have a duration to be compared")
        measured = tuple(self._factor(stream, length / reference) for stream, length in durations.items())
        return Observation(all_stamps(facts), measured)

    def _factor(self, stream: str, ratio: float) -> Measured:
        factor = next((known for known in _UNIT_FACTORS if abs(ratio / known - 1) <= _UNIT_WITHIN), 1.0)
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
        fits = dict(fits_of(facts))
        if not fits:
            return Observation(all_stamps(facts), unobservable="no stream has three stamps in order")
        measured = {stream: self._error(facts, stream, fit) for stream, fit in fits.items()}
        exact = [m for m in measured.values() if m is not None and abs(m.value) <= m.allowance + 3 * m.standard_error]
        held = {stream for stream in fits if exact or stream.startswith("flow/")}
        return Observation(
            all_stamps(facts),
            tuple(m for stream, m in measured.items() if m is not None and stream in held),
            tuple(self._odd(stream, fit) for stream, fit in fits.items() if stream not in held),
        )

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


def _durations_ns(facts: Facts) -> Iterator[tuple[str, float]]:
    for stream, _ in fits_of(facts):
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


def _nominal_period_ns(stream: str, period_ns: float) -> float:
    """Return the nominal period that is nearest; of flow the one in its name.

    Nominal is a whole number of Hz, exactly or with its period rounded to whole microseconds as many recorders do, and
    its 1000/1001 (29.97 Hz and the like).
    """
    if stream.startswith("flow/"):
        return NS_PER_S / int(stream.removeprefix("flow/").removesuffix("hz"))
    exact_ns = NS_PER_S / max(round(NS_PER_S / period_ns), 1)
    candidates = [exact_ns, max(round(exact_ns / NS_PER_US), 1) * NS_PER_US]
    if round(NS_PER_S / exact_ns) in _NTSC_HZ:
        candidates.append(exact_ns * 1.001)
    return min(candidates, key=lambda nominal: abs(nominal - period_ns))
