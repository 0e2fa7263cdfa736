"""The rates of the clocks: unit of the stamps, and the rate that each stream keeps."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from fedora_qa.checks.clocks.local_rates import WORST_ROUNDING, rate_change
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

    The factor by which each stream's stamps are too large, told from how long the stream lasts.

    Why it matters
    --------------
    Every loader that trusts the unit places the whole stream elsewhere in time, and velocities are off by the factor.

    How
    ---
    The time from a stream's first to its last stamp is held against the median of all streams, or against what the
    names of the flow rates promise (fields over Hz) where there is flow. The factors that real files hold are told
    apart: seconds, milliseconds and nanoseconds written as microseconds, and the 32 of a simulation that was stamped by
    the wall clock while it ran 32 times slower. Stamps that count up by exactly one while others span more than twice
    as much are numbers of samples, not times; their factor is one microsecond over the period.

    Noise model
    -----------
    None at random. A factor is taken where the ratio of durations lies within 20% of it: the factors lie 30 times apart
    and farther, and streams that end early by less than a fifth are for ``clocks.span``. All else counts as 1.

    Cannot see
    ----------
    All streams in one wrong unit, unless flow says how long they should last; a file with a single stream and no flow.

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
            return Observation(all_stamps(facts), unobservable="no two streams have a duration to be compared")
        measured = tuple(self._factor(facts, stream, length / reference) for stream, length in durations.items())
        return Observation(all_stamps(facts), measured)

    def _factor(self, facts: Facts, stream: str, ratio: float) -> Measured:
        counts = ratio < 1 / 2 and _counts_samples(facts, stream)
        factor = ratio if counts else unit_factor(ratio)
        return Measured(
            name=f"{stream}.unit_factor",
            value=factor,
            unit="1",
            expected=1.0,
            standard_error=0.0,
            resolution=31.0,
            statement=f"The stamps of {stream} span {ratio:.6g} times as long as the other streams: "
            f"they {'are numbers of samples, not times' if counts else _UNIT_FACTORS[factor]}.",
            code="clocks.unit.factor",
            where=Where(stream=stream),
            severity="critical",
            suspects=(Suspect("time_unit", stream, 1.0, factor, "1"),),
        )


class Rate(FactsCheck):
    """Does every stream run at its nominal rate?

    The error of each stream's period, in ppm of the nominal one.

    Why it matters
    --------------
    A clock that runs 100 ppm fast is 6 ms late after a minute: between IMU and camera that is a lever that no
    calibration of a constant offset takes out.

    How
    ---
    The period is the least-squares slope of the stamps over their numbers; gaps are counted and jumps of an exact
    clock taken out first (``fedora_qa/estimators/regular_clock.py``). Flow must keep the rate in its name. Any other
    stream is held against the nearest nominal rate (a whole number of Hz, a period of whole microseconds, or the
    1000/1001 of video) if another stream of the file keeps its own: all stamps are of one clock. Otherwise an odd
    rate is noted. The same is fitted to each quarter of the stamps, and the fastest held against the slowest.

    Noise model
    -----------
    Rounding to a grid g (a microsecond, or the coarser grid that the stamps betray) moves each stamp by at most g/2.
    Over a span T, the slope of the regression moves by at most 3/2 g/T, with residuals of +-g/2 all against the same
    half; that is the allowance. Jitter above the grid adds the slope's standard error, white over samples. Between
    quarters 10 ppm are allowed besides, what a quartz oscillator without compensation moves by over 15 K.

    Cannot see
    ----------
    All clocks fast by the same ppm. Errors of a fast clock that are no larger than the allowance, 1.5 ppm over a
    second: ``imu.timing`` and ``depth.consistency`` compare content instead.

    Sources
    -------
    First principles: the slope is sum (n - m) t / sum (n - m)^2, and sum |n - m| / sum (n - m)^2 is 3/N for large N.
    """

    name = "clocks.rate"

    def examine(self, facts: Facts) -> Observation:
        """Measure each stream's rate error in ppm."""
        fits = dict(fits_of(facts))
        if not fits:
            return Observation(all_stamps(facts), unobservable="no stream has three stamps in order")
        measured = {stream: self._error(facts, stream, fit) for stream, fit in fits.items()}
        exact = [m for m in measured.values() if m is not None and abs(m.value) <= m.allowance + 3 * m.standard_error]
        changes = (
            rate_change(facts, stream, fit, _nominal_period_ns(stream, fit.period_ns))
            for stream, fit in fits.items()
            if fit.regular
        )
        held = {stream for stream in fits if exact or stream.startswith("flow/")}
        return Observation(
            all_stamps(facts),
            tuple(m for m in changes if m is not None)
            + tuple(m for stream, m in measured.items() if m is not None and stream in held),
            tuple(self._odd(stream, fit) for stream, fit in fits.items() if stream not in held),
        )

    def _error(self, facts: Facts, stream: str, fit: RegularClock) -> Measured | None:
        nominal_ns = _nominal_period_ns(stream, fit.period_ns)
        deviation = fit.period_ns / nominal_ns - 1
        if abs(deviation) > _NOMINAL_WITHIN and not stream.startswith("flow/"):
            return None
        ppm = 1e6 * deviation
        span_ns = float(np.ptp(facts.clocks[stream].times_ns[facts.clocks[stream].advancing]))
        grid_ns = max(NS_PER_US, fit.grid_ns)
        return Measured(
            name=f"{stream}.rate_error",
            value=ppm,
            unit="ppm",
            standard_error=0.0 if fit.jitter_ns <= grid_ns else 1e6 * fit.period_error_ns / nominal_ns,
            allowance=1e6 * WORST_ROUNDING * grid_ns / span_ns,
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


def unit_factor(ratio: float) -> float:
    """Return the known factor that a ratio of durations is near to; 1 where there is none."""
    return next((known for known in _UNIT_FACTORS if abs(ratio / known - 1) <= _UNIT_WITHIN), 1.0)


def _counts_samples(facts: Facts, stream: str) -> bool:
    """Whether all stamps of a stream count up by one of the file's microseconds."""
    clock = facts.clocks.get(stream)
    return clock is not None and len(clock.times_ns) > 2 and bool(np.all(np.diff(clock.times_ns) == NS_PER_US))


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
