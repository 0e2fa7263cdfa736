"""Regular clocks: period, jitter, grid, jumps and missing samples; a displaced part; rounding to a coarse grid."""

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

_EXACT_RATIO: Final = 0.5
"""Share of the steps that must equal the period: then the clock is exact, and deviating timestamps were displaced."""

_LEAST_OUTSIDE: Final = 0.1
"""Share of the timestamps that must lie outside the displaced part."""

_ROUNDINGS: Final = 2
"""Units by which rounding alone moves the difference of two timestamps: half of one each, and the period's own."""

_SEGMENT: Final = 64
"""Samples of a segment: a grid that holds for a part of the stream only is detected there."""

_FEWEST_ODD: Final = 4
"""Steps of the rarer length in a segment: fewer could be single gaps."""

_OF_A_GRID: Final = 1.1
"""Extent of correct rounding about the fitted line, in grids: one about the true line, a little off the fitted."""


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


@dataclass(frozen=True, slots=True)
class DisplacedSegment:
    """Rows of a clock that lie beside its line.

    Attributes
    ----------
    first, last
        Rows, both of them displaced.
    offset_ns
        Median by which they are late.
    drift
        By how much their clock runs fast, seconds a second; 0 where all are late alike.
    """

    first: int
    last: int
    offset_ns: float
    drift: float


def displaced_part(times_ns: Int64, *, resolution_ns: int) -> DisplacedSegment | None:
    """Return the part of a clock that was moved; None where there is none, or where the clock is not exact.

    Timestamps are compared with the line through the first, with the median step as its period; whole periods, which
    lost samples leave, do not count. The part must begin or end with a jump: a clock that is off its rate throughout
    has none.

    Parameters
    ----------
    times_ns
        (N,) timestamps.
    resolution_ns
        Unit to which they are rounded, ns.

    Returns
    -------
    DisplacedSegment | None
        From the first to the last displaced row.
    """
    if len(times_ns) < 3:
        return None
    steps = np.diff(times_ns)
    period = int(np.median(steps))
    if period <= 0 or np.mean(steps == period) < _EXACT_RATIO:
        return None
    # Deviation from the line through the first timestamp, modulo the period: lost samples leave whole periods.
    deviation_ns = (times_ns - times_ns[0] + period // 2) % period - period // 2
    beside = np.abs(deviation_ns) > resolution_ns
    rows = np.flatnonzero(beside)
    if not len(rows) or len(times_ns) - (rows[-1] - rows[0] + 1) < _LEAST_OUTSIDE * len(times_ns):
        return None
    first, last = int(rows[0]), int(rows[-1])
    # Steps of the deviation into the part and out of it; a part that lasts to the end has no second jump.
    jumps = np.abs(np.diff(deviation_ns))[[max(first - 1, 0), min(last, len(deviation_ns) - 2)]]
    if jumps.max() <= _ROUNDINGS * resolution_ns:
        return None
    inside = deviation_ns[first : last + 1]
    steady = bool(np.ptp(inside) <= _ROUNDINGS * resolution_ns)
    # Slope of the deviation, ns, over the time by the clock's rows, ns: s/s.
    drift = 0.0 if steady else float(np.polyfit(period * np.arange(len(inside), dtype=float), inside, 1)[0])
    return DisplacedSegment(first, last, float(np.median(inside)), drift)


def rounding_grid_ns(times_ns: Int64, *, resolution_ns: int) -> int:
    """Return the grid to which the timestamps of a regular clock were rounded, ns; 0 where there is none.

    A period rounded to a grid that does not divide it gives steps of just two lengths, the multiples of the grid next
    to it, in even turns: they never stray from a straight line by more than half a grid. Jitter gives steps of
    many lengths, lost samples stray from the line.

    Parameters
    ----------
    times_ns
        (N,) timestamps; segments where they decrease show no grid.
    resolution_ns
        Unit of all timestamps, ns: only coarser grids count.

    Returns
    -------
    int
        ns, the median of the segments' grids.
    """
    segments = times_ns[: len(times_ns) // _SEGMENT * _SEGMENT].reshape(-1, _SEGMENT)
    if not len(segments):
        return 0
    steps = np.diff(segments, axis=1)
    short, long = steps.min(axis=1), steps.max(axis=1)
    coarse = (short >= 0) & (long - short > resolution_ns)
    grids = []
    for times in segments[coarse]:
        steps = np.diff(times)
        shortest, longest = int(steps.min()), int(steps.max())
        # Both steps are multiples of the grid, next to each other: their difference is the grid.
        grid = longest - shortest
        rarer = min(np.count_nonzero(steps == shortest), np.count_nonzero(steps == longest))
        if shortest % grid or rarer < _FEWEST_ODD or not np.isin(steps, (shortest, longest)).all():
            continue
        # Extent of the timestamps about the line of least squares.
        numbers = np.arange(len(times)) - (len(times) - 1) / 2
        elapsed = (times - times[0]).astype(np.float64)
        slope = float(numbers @ elapsed) / float(numbers @ numbers)
        if float(np.ptp(elapsed - slope * numbers)) <= _OF_A_GRID * grid:
            grids.append(grid)
    return int(np.median(grids)) if grids else 0
