"""The rate error of each stream's clock."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from fedora_qa.checks.clocks.streams import all_timestamps, file_us, fits_of
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.conventions import NS_PER_MS, NS_PER_S, NS_PER_US
from fedora_qa.estimators.clocks.regular_clock import RegularClock, has_odd_grid_above_period
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Clock, Facts

_NTSC_HZ: Final = (24, 30, 48, 60, 120)
"""Rates of video that are also used divided by 1.001."""

_NOMINAL_WITHIN: Final = 0.01
"""Relative difference from a nominal rate within which a rate counts as that rate."""

_CHOSEN_STEP_NS: Final = NS_PER_MS // 2
"""Periods that are multiples of this are chosen as such, ns: every third sample of 5 ms, or a timer of 1.5 ms. The step
is not derived. At 1 kHz it is half a period, and at 10 Hz, where whole rates are 10% apart, it is 0.5% of one."""

_WRITTEN_STEPS_NS: Final = (10 * NS_PER_US, 100 * NS_PER_US)
"""Steps to which a program rounds the period of a whole rate, ns: 33.33 ms and 33.3 ms for 30 Hz. These are 100 ppm and
1000 ppm off the rate, as a drift may be, and so count only where they are kept within the error of the period. Of
drifts up to 1000 ppm either way, two windows of 3 ppm, for a second of timestamps, are three of a thousand."""

_WHOLE_MULTIPLES: Final = 1.5
"""Periods of another stream from which the nearest multiple is two or more."""

_LEAST_GRID_NS: Final = 10 * NS_PER_US
"""Least grid of rounded timestamps, ns: the steps of a drifting clock differ by its resolution, and have a larger
divisor only by chance."""

_WORST_ROUNDING: Final = 1.5
"""Slope, in grids over the span, when rounding moves the earlier half of all timestamps one way and the later the
other: (g/2) sum |n - m| / sum (n - m)^2 = (g/2) (N^2/4) / (N^3/12) = 3/2 g/N per sample."""

_SEGMENTS: Final = 4
_FEWEST_TIMESTAMPS: Final = 12
"""Least number in a segment: the scatter pooled over two segments then has twenty degrees of freedom."""

_WANDER_PPM: Final = 10.0
"""Largest change of the rate of a correct clock within a file, ppm: a quartz oscillator without compensation changes by
about 0.04 ppm per K^2 from 25 degrees C, 9 ppm over 15 K."""


@dataclass(frozen=True, slots=True)
class RoundedClock(Feature):
    """Timestamps that were rounded to a grid: they differ from the nominal rate by one step of the grid at most.

    Attributes
    ----------
    grid_ms
        The grid, ms, of which all steps are multiples.
    """

    grid_ms: float


@dataclass(frozen=True, slots=True)
class SegmentRate(Feature):
    """Rate error of the quarter of a stream that deviates most.

    Attributes
    ----------
    rate_ppm
        Rate error, ppm.
    rounding_ppm
        Bound of its error by rounding of timestamps, ppm.
    """

    rate_ppm: float
    rounding_ppm: float


@dataclass(frozen=True, slots=True)
class _RateSegment:
    """Rows of a stream, the relative error of the period there, how much rounding may add, and how timestamps scatter.

    ``lever`` is the root of the sum of squares of the sample numbers: a scatter over it is an error of the period.
    """

    first: int
    last: int
    rate: float
    rounding: float
    sigma_ns: float
    lever: float


class ClocksRate(FactsCheck):
    """Does every stream have its nominal rate?

    For each stream, the relative error of its period, in ppm of the nominal one, and the change of its rate within the
    file.

    Why it matters
    --------------
    A clock that runs 100 ppm fast is off by 6 ms after a minute. Calibration of a constant offset between IMU and
    camera does not remove this error.

    How
    ---
    The period is the least-squares slope of timestamps over sample numbers. Gaps are counted, and jumps of an exact
    clock are removed first (``fedora_qa/estimators/clocks/regular_clock.py``). Flow must have the rate in its name. Any
    other stream is compared with the nearest period that a writer chooses: that of a whole number of Hz, also rounded
    to a microsecond; of 1000/1001 of a video rate; a multiple of half a millisecond; or a multiple of the period that
    another stream of the file keeps. The period of a whole rate rounded to 10 or 100 us (33.3 ms for 30 Hz) counts
    where it is kept to within the bound. A deviation is a finding if another stream of the file has its nominal rate:
    all timestamps are of one clock. Otherwise an uncommon rate is noted. In a sequence that is declared as recorded,
    the rate of a stream is that of its sensor, which is stated and not judged; flow, and changes within the file, are
    judged all the same. The same fit is made to each quarter of the timestamps, and the fastest quarter is compared
    with the slowest.

    Noise model
    -----------
    Rounding to a grid g (a microsecond, or the coarser grid that is measured) moves each timestamp by at most g/2. Over
    a span T, the slope of the regression moves by at most 3/2 g/T, which is reached where the residuals are +g/2 in one
    half and -g/2 in the other. This is the model error bound. Jitter above the grid adds the standard error of the
    slope, white over samples. Between quarters the bound has 10 ppm more, by which a quartz oscillator without
    compensation changes over 15 K.

    Cannot detect
    -------------
    The same ppm error of all clocks. An error that leads to another period of those above, such as 1000 ppm of 30 Hz,
    which is 29.97 Hz on one side and 33.3 ms on the other. Errors no larger than the bound, which is 1.5 ppm for one
    second: ``imu.timing`` and ``depth.consistency`` compare the content of streams instead.

    Sources
    -------
    First principles: the slope is sum (n - m) t / sum (n - m)^2, and sum |n - m| / sum (n - m)^2 is 3/N for large N.
    """

    name = "clocks.rate"

    def examine(self, facts: Facts) -> Observation:
        """Measure each stream's rate error in ppm."""
        fits = dict(fits_of(facts))
        if not fits:
            return Observation(all_timestamps(facts), unobservable="no stream has three timestamps in order")
        errors: dict[str, Statistic] = {}
        sparse: list[Notice] = []
        inferred: dict[str, str | float] = {}
        is_recorded = facts.declared.kind == "recorded"
        nominals_ns = _nominal_periods_ns(facts, fits)
        for stream, fit in fits.items():
            if is_recorded and stream not in facts.flow_streams:
                # Of an oscillator of its own: that a whole number of Hz is near says nothing about its clock.
                inferred[f"{stream}.rate_hz"] = NS_PER_S / fit.period_ns
                continue
            nominal_ns = nominals_ns[stream]
            intervals = round(nominal_ns / _interval_ns(stream)) if stream in facts.flow_streams else 1
            if intervals > 1:
                message = f"{stream} has a field for only one of {intervals} intervals"
                sparse.append(Notice("clocks.rate.sparse", message, Where(stream=stream)))
            deviation = fit.period_ns / nominal_ns - 1
            # More than 1% from every nominal rate is another rate, not an error of a nominal one.
            if abs(deviation) > _NOMINAL_WITHIN and not stream.startswith("flow/"):
                continue
            ppm = 1e6 * deviation
            times_ns = facts.clocks[stream].times_ns
            least_grid_ns = _grid_ns(fit)

            # A grid that nearly divides the period makes all steps equal but a few, like another rate with jumps. A
            # grid slightly above the period makes all steps equal but a few that are zero.
            steps_ns = np.diff(times_ns)
            grid_ns = int(np.gcd.reduce(steps_ns)) if len(steps_ns) else 0
            is_rounded = has_odd_grid_above_period(times_ns)
            if not is_rounded and _LEAST_GRID_NS <= grid_ns < np.median(steps_ns):
                # Distance of each timestamp from n nominal periods; rounding keeps their range within one grid. The
                # period of a fit that leaves out jumps is a multiple of the grid, and another rate may be nearer to it.
                rows = np.arange(len(times_ns))
                mean_ns = float(np.polyfit(rows, times_ns - times_ns[0], 1)[0])
                periods_ns = {nominal_ns, _nominal_period_ns(stream, mean_ns, facts.clocks[stream])}
                is_rounded = any(np.ptp(times_ns - rows * period_ns) <= grid_ns for period_ns in periods_ns)

            errors[stream] = Statistic(
                name=f"{stream}.rate_error",
                value=ppm,
                unit="ppm",
                # Jitter within the grid is rounding, which the bound covers; jitter above it is white over samples.
                standard_error=0.0 if fit.jitter_ns <= least_grid_ns else 1e6 * fit.period_error_ns / nominal_ns,
                # |error of the slope| <= 3/2 g/T for a grid g over a span T (derivation at _WORST_ROUNDING).
                model_error_bound=1e6 * _rounding(facts.clocks[stream], fit),
                statement=f"The period of {stream} is {fit.period_ns / NS_PER_US:.6g} us, {ppm:+.4g} ppm off the "
                f"nominal {nominal_ns / NS_PER_US:.6g} us.",
                code="clocks.rate.error",
                where=Where(stream=stream),
                features=(RoundedClock(grid_ns / NS_PER_MS),) if is_rounded else (),
            )
        # If streams keep a nominal rate, the clock of the file is correct: all timestamps are of one clock, and the
        # other streams can be judged by it.
        exact = [m for m in errors.values() if abs(m.value) <= m.model_error_bound + 3 * m.standard_error]
        changes = (_change(facts, stream, fit, nominals_ns[stream]) for stream, fit in fits.items() if fit.regular)
        # Flow is judged in any case: its nominal rate stands in its name.
        judged = {stream for stream in fits if exact or stream.startswith("flow/")}
        measurements = (
            *(change for change in changes if change is not None),
            *(error for stream, error in errors.items() if stream in judged),
        )
        return Observation(
            all_timestamps(facts),
            measurements,
            tuple(
                Notice(
                    "clocks.rate.odd",
                    f"{stream} has {NS_PER_S / fit.period_ns:.6g} Hz, which is no nominal rate",
                    Where(stream=stream),
                )
                for stream, fit in fits.items()
                if stream not in judged and f"{stream}.rate_hz" not in inferred
            )
            + tuple(sparse),
            unobservable="" if measurements or not inferred else "rates of recorded streams are those of their sensors",
            inferred=inferred,
        )


def _interval_ns(flow_stream: str) -> float:
    return NS_PER_S / flow_rate_hz(flow_stream)


def _grid_ns(fit: RegularClock) -> int:
    return max(NS_PER_US, fit.grid_ns)


def _rounding(clock: Clock, fit: RegularClock) -> float:
    """Return the bound of the relative error of a period by rounding of timestamps (derivation at _WORST_ROUNDING)."""
    return _WORST_ROUNDING * _grid_ns(fit) / float(np.ptp(clock.times_ns[clock.advancing]))


def _nominal_periods_ns(facts: Facts, fits: Mapping[str, RegularClock]) -> dict[str, float]:
    """Return the nominal period of each stream, ns: also a multiple of a period that another stream keeps."""
    nominals_ns = {
        stream: _nominal_period_ns(stream, fit.period_ns, facts.clocks[stream]) for stream, fit in fits.items()
    }
    sampled = [stream for stream in fits if facts.clocks[stream].ends_ns is None]
    kept_ns: set[float] = set()
    for stream in sampled:
        period_ns, nominal_ns = fits[stream].period_ns, nominals_ns[stream]
        within_ns = nominal_ns * _rounding(facts.clocks[stream], fits[stream])
        rounded_ns = [step_ns * round(_whole_rate_ns(period_ns) / step_ns) for step_ns in _WRITTEN_STEPS_NS]
        for candidate_ns in (nominal_ns, *rounded_ns):
            if abs(period_ns - candidate_ns) <= within_ns:
                nominals_ns[stream] = candidate_ns
                kept_ns.add(candidate_ns)
                break
    for stream in sampled:
        period_ns = fits[stream].period_ns
        # Every second sample at least: a stream of the same rate may have the same wrong clock.
        multiples_ns = [kept * round(period_ns / kept) for kept in kept_ns if period_ns > _WHOLE_MULTIPLES * kept]
        candidates_ns = [nominals_ns[stream], *multiples_ns]
        nominals_ns[stream] = min(candidates_ns, key=lambda nominal: abs(nominal - period_ns))
    return nominals_ns


def _whole_rate_ns(period_ns: float) -> float:
    """Return the period of the nearest whole number of Hz, ns."""
    return NS_PER_S / max(round(NS_PER_S / period_ns), 1)


def _nominal_period_ns(stream: str, period_ns: float, clock: Clock) -> float:
    """Return the nearest nominal period, ns; for flow the one in the stream's name, or a multiple of it.

    Flow may have a field for only each second or third interval: its fields then last as long as the name states.
    Nominal rates of others are whole numbers of Hz, exactly or with a period rounded to whole microseconds (as many
    recorders write), those of whole and half milliseconds, and 1000/1001 of video rates (29.97 Hz and others).
    """
    if clock.ends_ns is not None:
        interval_ns = _interval_ns(stream)
        fields_ns = float(np.median(clock.ends_ns - clock.times_ns))
        is_named = abs(fields_ns / interval_ns - 1) <= _NOMINAL_WITHIN
        return interval_ns * max(round(period_ns / interval_ns), 1) if is_named else interval_ns
    exact_ns = _whole_rate_ns(period_ns)
    candidates = [exact_ns, max(round(exact_ns / NS_PER_US), 1) * NS_PER_US]
    candidates.append(max(round(period_ns / _CHOSEN_STEP_NS), 1) * _CHOSEN_STEP_NS)
    # Video at 1000/1001 of its rate: 29.97 Hz has the period of 30 Hz times 1.001.
    if round(NS_PER_S / exact_ns) in _NTSC_HZ:
        candidates.append(exact_ns * 1.001)
    return min(candidates, key=lambda nominal: abs(nominal - period_ns))


def _change(facts: Facts, stream: str, fit: RegularClock, nominal_ns: float) -> Statistic | None:
    """Return the change of the rate of a stream from one quarter to another; None where the stream is too short."""
    clock = facts.clocks[stream]
    rows = np.flatnonzero(clock.advancing)
    times_ns = clock.times_ns[rows]
    # Least squares in each quarter that is long enough and without a jump of the clock.
    quarters = pairwise(np.linspace(0, len(times_ns), _SEGMENTS + 1).astype(int).tolist())
    segments: list[_RateSegment] = []
    for first, end in quarters if len(times_ns) >= _SEGMENTS * _FEWEST_TIMESTAMPS else ():
        # A jump of the clock within a segment would be fitted as a change of its rate.
        if np.any((fit.jump_after >= first) & (fit.jump_after < end - 1)):
            continue
        elapsed_ns = (times_ns[first:end] - times_ns[first]).astype(np.float64)
        # Numbers count elapsed periods, so that missing samples do not displace those behind them.
        numbers = np.rint(elapsed_ns / fit.period_ns)
        # Slope of t over n: sum (n - m) t / sum (n - m)^2.
        centred = numbers - numbers.mean()
        square = float(centred @ centred)
        period_ns = float(centred @ elapsed_ns) / square
        residuals_ns = elapsed_ns - elapsed_ns.mean() - period_ns * centred
        segments.append(
            _RateSegment(
                first,
                end - 1,
                rate=period_ns / nominal_ns - 1,
                rounding=_WORST_ROUNDING * max(NS_PER_US, fit.grid_ns) / max(float(elapsed_ns[-1]), 1.0),
                # Slope and mean take two degrees of freedom.
                sigma_ns=float(np.sqrt(residuals_ns @ residuals_ns / (len(numbers) - 2))),
                lever=float(np.sqrt(square)),
            )
        )
    if len(segments) < 2:
        return None
    slowest, fastest = (choose(segments, key=lambda segment: segment.rate) for choose in (min, max))
    # Pooled over the segments, as twelve timestamps alone have ten degrees of freedom.
    sigma_ns = float(np.sqrt(np.mean([segment.sigma_ns**2 for segment in segments])))
    jitter_ns = 0.0 if sigma_ns <= max(NS_PER_US, fit.grid_ns) else sigma_ns
    farthest = max(slowest, fastest, key=lambda segment: abs(segment.rate))
    ppm = 1e6 * (fastest.rate - slowest.rate)
    start, stop = int(rows[farthest.first]), int(rows[farthest.last])
    return Statistic(
        name=f"{stream}.rate_change",
        value=ppm,
        unit="ppm",
        # Standard error of a least-squares slope: sigma / sqrt(sum (n - m)^2), for the difference of two slopes.
        standard_error=1e6 * jitter_ns / nominal_ns * float(np.hypot(1 / slowest.lever, 1 / fastest.lever)),
        model_error_bound=_WANDER_PPM + 1e6 * (slowest.rounding + fastest.rounding),
        side="upper",
        # Any two segments might have been the slowest and the fastest.
        tests=len(segments) * (len(segments) - 1) // 2,
        statement=f"The rate of {stream} changes by {ppm:.4g} ppm within the file: from row {start} to {stop} its "
        f"period is {1e6 * farthest.rate:+.4g} ppm off the nominal one.",
        code="clocks.rate.change",
        where=Where(
            stream,
            file_us(facts, clock.times_ns, start),
            file_us(facts, clock.times_ns, stop),
            index_start=start,
            index_stop=stop + 1,
        ),
        features=(SegmentRate(1e6 * farthest.rate, 1e6 * farthest.rounding),),
    )
