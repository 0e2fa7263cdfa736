"""The rates of the clocks, which each stream keeps."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.clocks.local_rates import WORST_ROUNDING, rate_change
from fedora_qa.checks.clocks.streams import all_timestamps, fits_of
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic, Suspect
from fedora_qa.conventions import NS_PER_MS, NS_PER_S, NS_PER_US
from fedora_qa.estimators.clocks.regular_clock import RegularClock, has_odd_grid_above_period
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts

_NTSC_HZ: Final = (24, 30, 48, 60, 120)
"""Rates of video that are also used divided by 1.001."""

_NOMINAL_WITHIN: Final = 0.01
"""A rate nearer than this to a nominal one is meant to be that."""

_LEAST_GRID_NS: Final = 10 * NS_PER_US
"""Steps of a clock that drifts differ by its resolution; only by chance have they a larger divisor."""


class ClocksRate(FactsCheck):
    """Does every stream run at its nominal rate?

    The error of each stream's period, in ppm of the nominal one.

    Why it matters
    --------------
    A clock that runs 100 ppm fast is 6 ms late after a minute: between IMU and camera that is a lever that no
    calibration of a constant offset takes out.

    How
    ---
    The period is the least-squares slope of the stamps over their numbers; gaps are counted and jumps of an exact
    clock taken out first (``fedora_qa/estimators/clocks/regular_clock.py``). Flow must keep the rate in its name. Any
    other stream is held against the nearest nominal rate (a whole number of Hz, a period of whole microseconds, or the
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
            return Observation(all_timestamps(facts), unobservable="no stream has three stamps in order")
        measured = {stream: self._error(facts, stream, fit) for stream, fit in fits.items()}
        exact = [
            m for m in measured.values() if m is not None and abs(m.value) <= m.model_error_bound + 3 * m.standard_error
        ]
        changes = (
            rate_change(facts, stream, fit, _nominal_period_ns(stream, fit.period_ns))
            for stream, fit in fits.items()
            if fit.regular
        )
        held = {stream for stream in fits if exact or stream.startswith("flow/")}
        return Observation(
            all_timestamps(facts),
            tuple(m for m in changes if m is not None)
            + tuple(m for stream, m in measured.items() if m is not None and stream in held),
            tuple(self._odd(stream, fit) for stream, fit in fits.items() if stream not in held),
        )

    def _error(self, facts: Facts, stream: str, fit: RegularClock) -> Statistic | None:
        nominal_ns = _nominal_period_ns(stream, fit.period_ns)
        deviation = fit.period_ns / nominal_ns - 1
        if abs(deviation) > _NOMINAL_WITHIN and not stream.startswith("flow/"):
            return None
        ppm = 1e6 * deviation
        span_ns = float(np.ptp(facts.clocks[stream].times_ns[facts.clocks[stream].advancing]))
        grid_ns = max(NS_PER_US, fit.grid_ns)
        return Statistic(
            name=f"{stream}.rate_error",
            value=ppm,
            unit="ppm",
            standard_error=0.0 if fit.jitter_ns <= grid_ns else 1e6 * fit.period_error_ns / nominal_ns,
            model_error_bound=1e6 * WORST_ROUNDING * grid_ns / span_ns,
            statement=f"The period of {stream} is {fit.period_ns / NS_PER_US:.6g} us, {ppm:+.4g} ppm off the nominal "
            f"{nominal_ns / NS_PER_US:.6g} us.",
            code="clocks.rate.error",
            where=Where(stream=stream),
            material=10_000.0,
            suspects=(
                Suspect("clock_rate", stream, 0.8, ppm, "ppm"),
                *_rounded(stream, facts.clocks[stream].times_ns, nominal_ns),
            ),
        )

    def _odd(self, stream: str, fit: RegularClock) -> Notice:
        return Notice(
            "clocks.rate.odd",
            f"{stream} runs at {NS_PER_S / fit.period_ns:.6g} Hz, no nominal rate",
            Where(stream=stream),
        )


def _rounded(stream: str, times_ns: NDArray[np.int64], nominal_ns: float) -> tuple[Suspect, ...]:
    """Suspect a grid where stamps never stray by more than it from the nominal rate, and all steps are multiples of it.

    A grid that nearly divides the period leaves all steps alike but a few, as of another rate with jumps; one a little
    above the period leaves all alike but a few that are none.
    """
    steps_ns = np.diff(times_ns)
    grid_ns = int(np.gcd.reduce(steps_ns)) if len(steps_ns) else 0
    if has_odd_grid_above_period(times_ns):
        return (Suspect("quantised_time", stream, 0.95, grid_ns / NS_PER_MS, "ms"),)
    strays_ns = float(np.ptp(times_ns - np.arange(len(times_ns)) * nominal_ns)) if len(times_ns) else 0.0
    if not (_LEAST_GRID_NS <= grid_ns < steps_ns.min() and strays_ns <= grid_ns):
        return ()
    return (Suspect("quantised_time", stream, 0.95, grid_ns / NS_PER_MS, "ms"),)


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
