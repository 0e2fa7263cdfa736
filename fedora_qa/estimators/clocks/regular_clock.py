"""Fit a regular clock to timestamps: its period, its jitter, its grid, its jumps, and its missing samples."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.fitting.robust import NORMAL_QUARTILE

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

FEWEST_TIMESTAMPS: Final = 3
"""Two timestamps have one step, and no residual about it."""

_ROUNDED_NS: Final = 1_000.0
"""Two timestamps that were each rounded to a microsecond lie by up to this much off the whole periods between them."""

_FEWEST_DOUBLE_STEPS: Final = 10
"""m samples lost at random places leave one gap in each m-th part of the stream with probability m!/m^m: 4e-4 here."""

_FEWEST_REPEATS: Final = 6
"""Samples that are written twice at random fall on one line as rounded timestamps do where each of r lies in its own
r-th of the stream, nearly: with probability r! (1.1 / r)^r, 3% for six and 0.5% for eight."""

_SAME_GRID: Final = 1.25
"""Residuals of a rounded clock span one grid; the least-squares line is off the true one by a part of that."""

_MOST_JUMPS: Final = 0.1
"""Share of deviating steps beyond which a clock jitters and does not jump."""


@dataclass(frozen=True, slots=True)
class RegularClock:
    """Timestamps as ``start + period * n`` with noise.

    Attributes
    ----------
    period_ns, period_error_ns
        Least-squares slope over the sample numbers n, and its standard error from the scatter of the residuals.
    jitter_ns
        Robust standard deviation of the residuals (median absolute deviation / 0.6745).
    missing
        Samples that the gaps would have held.
    gap_after
        Rows behind which a gap lies.
    jump_after, jumps_ns
        Rows behind which an otherwise exact clock was set forward (positive) or back, and by how much.
    tick_ns
        Greatest common divisor of the steps.
    irregular_steps
        How many steps are no whole number of periods, jumps aside: 0 for an exact clock.
    """

    period_ns: float
    period_error_ns: float
    jitter_ns: float
    missing: int
    gap_after: NDArray[np.intp]
    jump_after: NDArray[np.intp]
    jumps_ns: Float64
    tick_ns: int
    irregular_steps: int

    @property
    def regular(self) -> bool:
        """Whether a gap can be distinguished from jitter: below half a grid, or a tenth of a period."""
        return self.jitter_ns < max(self.period_ns / 10, self.grid_ns / 2)

    @property
    def grid_ns(self) -> int:
        """The grid that timestamps were rounded to, 0 for an exact clock: its steps are multiples of whatever it is."""
        return self.tick_ns if self.irregular_steps else 0


def fit_regular_clock(times_ns: Int64) -> RegularClock | None:
    """Fit a regular clock to timestamps.

    The number of each sample counts the periods (the median step) that have passed, so that a gap shifts nothing.
    Double steps that are spread evenly are no gaps but those of a clock that was rounded to a coarse grid. Jumps of an
    otherwise exact clock are subtracted before the period is fitted.

    Parameters
    ----------
    times_ns
        (N,) strictly increasing.

    Returns
    -------
    RegularClock | None
        None with fewer than three timestamps.
    """
    if len(times_ns) < FEWEST_TIMESTAMPS:
        return None
    steps = np.diff(times_ns)
    tick_ns = int(np.gcd.reduce(steps))
    passed = np.maximum(np.rint(steps / np.median(steps)), 1.0)
    if np.count_nonzero(passed > 1) >= _FEWEST_DOUBLE_STEPS and _on_one_line(times_ns, tick_ns):
        passed = np.ones_like(passed)
    off_ns = steps - passed * float(np.median(steps / passed))
    irregular = np.flatnonzero(np.abs(off_ns) > _ROUNDED_NS)
    jumps = irregular if len(irregular) <= _MOST_JUMPS * len(steps) and len(irregular) < 3 else irregular[:0]
    jumped_ns = np.zeros(len(times_ns))
    jumped_ns[jumps + 1] = off_ns[jumps]
    numbers = np.concatenate(([0.0], np.cumsum(passed)))
    period_ns, residuals, spread = _line(numbers, (times_ns - times_ns[0]) - np.cumsum(jumped_ns))
    # N - 2 degrees of freedom: offset and period are fitted.
    sigma_ns = float(np.sqrt(residuals @ residuals / max(len(times_ns) - 2, 1)))
    return RegularClock(
        period_ns=period_ns,
        # Standard error of a slope: sigma over the root of the numbers' sum of squares.
        period_error_ns=sigma_ns / np.sqrt(spread),
        jitter_ns=float(np.median(np.abs(residuals - np.median(residuals)))) / NORMAL_QUARTILE,
        missing=int(np.sum(passed - 1)),
        gap_after=np.flatnonzero(passed > 1),
        jump_after=jumps,
        jumps_ns=off_ns[jumps],
        tick_ns=tick_ns,
        irregular_steps=int(np.count_nonzero(np.delete(off_ns, jumps))),
    )


def is_rounded(times_ns: Int64) -> bool:
    """Whether timestamps (N,), ns, that often repeat are those of a regular clock, rounded to a grid above its period.

    Samples that are written twice delay all later rows; rounding delays none by more than a step. Few repeats
    distinguish both only where the grid itself is no period of a clock (``has_odd_grid_above_period``).
    """
    steps = np.diff(times_ns)
    often = int(np.count_nonzero(steps == 0)) >= _FEWEST_REPEATS
    return (often and _on_one_line(times_ns, int(steps.max()))) or has_odd_grid_above_period(times_ns)


def has_odd_grid_above_period(times_ns: Int64) -> bool:
    """Whether timestamps (N,), ns, are those of a clock of a whole rate in Hz, rounded to a grid just above its period.

    All steps are then none or one, and timestamps stay within one grid of the clock; of a grid that is the period of a
    whole rate itself, the repeats are samples that were written twice.
    """
    steps = np.diff(times_ns)
    grid_ns = int(steps.max(initial=0))
    if grid_ns <= 0 or not np.isin(steps, (0, grid_ns)).all() or not np.any(steps == 0):
        return False
    numbers = np.arange(len(times_ns), dtype=np.float64)
    elapsed_ns = (times_ns - times_ns[0]).astype(np.float64)
    rate_hz = max(round(NS_PER_S / _line(numbers, elapsed_ns)[0]), 1)
    # Timestamps rounded to a grid stay within one grid of their clock; repeated samples accumulate.
    kept = float(np.ptp(elapsed_ns - numbers * NS_PER_S / rate_hz)) <= grid_ns
    whole_ns = NS_PER_S / max(round(NS_PER_S / grid_ns), 1)
    return kept and abs(grid_ns - whole_ns) > _ROUNDED_NS


def _on_one_line(times_ns: Int64, grid_ns: int) -> bool:
    """Whether timestamps are those of a regular clock without gaps, rounded to a grid."""
    _, residuals, _ = _line(np.arange(len(times_ns), dtype=np.float64), (times_ns - times_ns[0]).astype(np.float64))
    return float(np.ptp(residuals)) <= _SAME_GRID * grid_ns


def _line(numbers: Float64, elapsed_ns: Float64) -> tuple[float, Float64, float]:
    """Return the least-squares slope over the numbers, the residuals, and the numbers' sum of squares."""
    centred = numbers - numbers.mean()
    spread = float(centred @ centred)
    slope = float(centred @ elapsed_ns) / spread
    return slope, elapsed_ns - elapsed_ns.mean() - slope * centred, spread
