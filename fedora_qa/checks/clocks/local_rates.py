"""Whether a clock keeps one rate all along."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.clocks.streams import file_us
from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.clocks.regular_clock import RegularClock
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts

WORST_ROUNDING: Final = 1.5
"""Slope, in grids over the span, when rounding moves the earlier half of all stamps one way and the later the other:
(g/2) sum |n - m| / sum (n - m)^2 = (g/2) (N^2/4) / (N^3/12) = 3/2 g/N per sample."""

_STRETCHES: Final = 4
_FEWEST_TIMESTAMPS: Final = 12
"""Of a stretch: the scatter pooled over two of them then has twenty degrees of freedom."""

_WANDER_PPM: Final = 10.0
"""By how much the rate of an honest clock may change within a file: a quartz oscillator without compensation moves by
about 0.04 ppm per K^2 from 25 degrees C, 9 ppm over 15 K."""

_MATTERS_PPM: Final = 10_000.0


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Rows of a stream, the relative error of the period there, how much rounding may add, and how stamps scatter.

    ``lever`` is the root of the sum of squares of the sample numbers: a scatter over it is an error of the period.
    """

    first: int
    last: int
    rate: float
    rounding: float
    sigma_ns: float
    lever: float


def rate_change(facts: Facts, stream: str, fit: RegularClock, nominal_ns: float) -> Statistic | None:
    """State how much the rate of a stream changes from one quarter to another; None where it is too short."""
    clock = facts.clocks[stream]
    rows = np.flatnonzero(clock.advancing)
    stretches = _stretches(clock.times_ns[rows], fit, nominal_ns)
    if len(stretches) < 2:
        return None
    slowest, fastest = (choose(stretches, key=lambda one: one.rate) for choose in (min, max))
    sigma_ns = float(np.sqrt(np.mean([one.sigma_ns**2 for one in stretches])))
    jitter_ns = 0.0 if sigma_ns <= max(NS_PER_US, fit.grid_ns) else sigma_ns
    odd = max(slowest, fastest, key=lambda one: abs(one.rate))
    ppm = 1e6 * (fastest.rate - slowest.rate)
    start, stop = int(rows[odd.first]), int(rows[odd.last])
    return Statistic(
        name=f"{stream}.rate_change",
        value=ppm,
        unit="ppm",
        standard_error=1e6 * jitter_ns / nominal_ns * float(np.hypot(1 / slowest.lever, 1 / fastest.lever)),
        model_error_bound=_WANDER_PPM + 1e6 * (slowest.rounding + fastest.rounding),
        side="upper",
        tests=len(stretches) * (len(stretches) - 1) // 2,
        material=_MATTERS_PPM,
        statement=f"The rate of {stream} changes by {ppm:.4g} ppm within the file: from row {start} to {stop} its "
        f"period is {1e6 * odd.rate:+.4g} ppm off the nominal one.",
        code="clocks.rate.change",
        where=Where(
            stream,
            file_us(facts, clock.times_ns, start),
            file_us(facts, clock.times_ns, stop),
            index_start=start,
            index_stop=stop + 1,
        ),
        suspects=(Suspect("clock_rate", stream, 0.85, 1e6 * odd.rate, "ppm", 1e6 * odd.rounding),),
    )


def _stretches(times_ns: NDArray[np.int64], fit: RegularClock, nominal_ns: float) -> list[_Stretch]:
    """Fit each quarter that is long enough and without a jump of the clock."""
    edges = np.linspace(0, len(times_ns), _STRETCHES + 1).astype(int).tolist()
    if len(times_ns) < _STRETCHES * _FEWEST_TIMESTAMPS:
        return []
    return [
        _fit(times_ns, first, stop - 1, fit, nominal_ns)
        for first, stop in pairwise(edges)
        if not np.any((fit.jump_after >= first) & (fit.jump_after < stop - 1))
    ]


def _fit(times_ns: NDArray[np.int64], first: int, last: int, fit: RegularClock, nominal_ns: float) -> _Stretch:
    """Return the least-squares rate of the rows from first to last, both included."""
    elapsed_ns = (times_ns[first : last + 1] - times_ns[first]).astype(np.float64)
    numbers = np.rint(elapsed_ns / fit.period_ns)
    centred = numbers - numbers.mean()
    square = float(centred @ centred)
    period_ns = float(centred @ elapsed_ns) / square
    residuals_ns = elapsed_ns - elapsed_ns.mean() - period_ns * centred
    return _Stretch(
        first,
        last,
        rate=period_ns / nominal_ns - 1,
        rounding=WORST_ROUNDING * max(NS_PER_US, fit.grid_ns) / max(float(elapsed_ns[-1]), 1.0),
        sigma_ns=float(np.sqrt(residuals_ns @ residuals_ns / (len(numbers) - 2))),
        lever=float(np.sqrt(square)),
    )
