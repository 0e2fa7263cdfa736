"""Regular clocks: period, jitter, grid, jumps and missing samples; displaced segments; rounding to a coarse grid."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.fitting.robust import NORMAL_QUARTILE

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

FEWEST_TIMESTAMPS: Final = 3
"""Least number of timestamps of a fit. Two timestamps have one step, so that no residual remains."""

_ROUNDED_NS: Final = 1_000.0
"""Largest deviation of a step from whole periods, ns, that rounding both timestamps to a microsecond causes."""

_FEWEST_DOUBLE_STEPS: Final = 10
"""Least number of double steps that can come from rounding. If m samples are lost at random places, each m-th part of
the stream holds one gap with the probability m!/m^m: 4e-4 for ten."""

_FEWEST_REPEATS: Final = 6
"""Least number of repeated timestamps that can come from rounding. Samples that are written twice at random places fit
one line as well as rounded timestamps only if each of the r samples lies in its own r-th part of the stream, nearly.
The probability of this is r! (1.1 / r)^r: 3% for six and 0.5% for eight."""

_SAME_GRID: Final = 1.25
"""Largest range of the residuals of a rounded clock, in grids. About the true line the range is one grid; the
least-squares line deviates from the true line by a part of a grid."""

_MOST_JUMPS: Final = 0.1
"""Share (0 to 1) of deviating steps beyond which they count as jitter instead of jumps."""

_EXACT_RATIO: Final = 0.5
"""Least share (0 to 1) of the steps that equal the period of an exact clock. Timestamps of an exact clock that deviate
were displaced."""

_LEAST_OUTSIDE: Final = 0.1
"""Least share (0 to 1) of the timestamps that lie outside the displaced segment."""

_ROUNDINGS: Final = 2
"""Largest change of the difference of two timestamps by rounding, in units of the timestamps: half a unit for each
timestamp, and the rounding of the period."""

_FEWEST_LATE: Final = 8
"""Timestamps of a clock whose delay varies. The value is not derived."""

_SEGMENT: Final = 64
"""Samples of a segment. Segments are tested separately, so that the grid of a part of the stream is detected."""

_SHORT_SEGMENT: Final = 32
"""Samples of a segment where no longer one has a grid. They overlap by half."""

_FEWEST_ODD: Final = 4
"""Least number of steps of the rarer length in a segment. Fewer can be single gaps."""

_TICKS_OF_A_GRID: Final = 10.0
"""Least length of a grid that is no whole number of ticks, in ticks. Steps between its instants are off their multiples
by a tick at most, which steps at random are, of 10 ticks, with a probability of 3/10 each: all of 31 in one of 1e16
cases."""

_FLOAT_NS: Final = 1e-3
"""Rounding of products of steps, ns."""

_OF_A_GRID: Final = 1.1
"""Largest range of rounded timestamps about the fitted line, in grids. About the true line the range is one grid; the
fitted line deviates slightly from it."""


@dataclass(frozen=True, slots=True)
class RegularClock:
    """Timestamps as ``start + period * n`` with noise.

    Attributes
    ----------
    period_ns, period_error_ns
        Least-squares slope over the sample numbers n, ns, and its standard error from the scatter of the residuals, ns.
    jitter_ns
        Robust standard deviation of the residuals, ns: median absolute deviation / 0.6745.
    missing
        Number of samples that are missing in all gaps.
    gap_after
        (g,) rows after which a gap follows.
    jump_after, jumps_ns
        (j,) rows after which an otherwise exact clock jumps, and the sizes of the jumps, ns; positive where the clock
        was set forward.
    tick_ns
        Greatest common divisor of the steps, ns; or the grid of which they are multiples but for their own rounding.
    irregular_steps
        Number of steps, other than jumps, that are not a whole number of periods: 0 for an exact clock.
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
        """Whether gaps are distinguishable from jitter: it is below half a grid or below a tenth of a period."""
        return self.jitter_ns < max(self.period_ns / 10, self.grid_ns / 2)

    @property
    def grid_ns(self) -> int:
        """The grid that timestamps were rounded to, ns; 0 for an exact clock, whose equal steps determine no grid."""
        return self.tick_ns if self.irregular_steps else 0


def fit_regular_clock(times_ns: Int64) -> RegularClock | None:
    """Fit a regular clock to timestamps.

    The number of a sample is the number of periods (median steps) since the first sample, so that a gap does not change
    the slope. Evenly spread double steps come from rounding to a coarse grid and do not count as gaps. Jumps of an
    otherwise exact clock are subtracted before the period is fitted.

    Parameters
    ----------
    times_ns
        (N,) strictly increasing timestamps, ns.

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
    if coarse_ns := _coarse_grid_ns(times_ns):
        tick_ns, passed = coarse_ns, np.ones_like(passed)
    elif np.count_nonzero(passed > 1) >= _FEWEST_DOUBLE_STEPS and _on_one_line(times_ns, tick_ns):
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
        # Standard error of a slope: sigma / sqrt(sum (n - mean n)^2).
        period_error_ns=sigma_ns / np.sqrt(spread),
        jitter_ns=float(np.median(np.abs(residuals - np.median(residuals)))) / NORMAL_QUARTILE,
        missing=int(np.sum(passed - 1)),
        gap_after=np.flatnonzero(passed > 1),
        jump_after=jumps,
        jumps_ns=off_ns[jumps],
        tick_ns=tick_ns,
        irregular_steps=int(np.count_nonzero(np.delete(off_ns, jumps))),
    )


def _coarse_grid_ns(times_ns: Int64) -> int:
    """Return the grid, ns, to which a regular clock was rounded before its timestamps were rounded to a microsecond.

    Ticks of 1/60 s are no whole microseconds, so that the steps have no common divisor. They have two lengths all the
    same, within rounding: the multiples of the grid next below and next above the period. 0 where there is no grid.
    """
    steps = np.diff(times_ns).astype(np.float64)
    is_long = steps > (steps.min() + steps.max()) / 2
    lengths = [steps[rows] for rows in (~is_long, is_long)]
    if min(len(rows) for rows in lengths) < _FEWEST_DOUBLE_STEPS:
        return 0
    # Both timestamps of a step are rounded.
    if any(np.ptp(rows) > _ROUNDINGS * _ROUNDED_NS for rows in lengths):
        return 0
    short, long = (float(np.mean(rows)) for rows in lengths)
    grid = long - short
    multiple = round(short / grid) if grid > _ROUNDINGS * _ROUNDED_NS else 0
    if not multiple or abs(short - multiple * grid) > _ROUNDED_NS * (multiple + 1) or not np.any(steps % round(grid)):
        return 0
    # The whole duration is known more precisely than a step.
    grid = float(steps.sum() / np.rint(steps / grid).sum())
    return round(grid) if _on_one_line(times_ns, round(grid)) else 0


def is_rounded(times_ns: Int64) -> bool:
    """Return whether repeated timestamps are those of a regular clock that was rounded to a grid above its period.

    A sample that is written twice delays all later rows; rounding delays no row by more than one step. With few repeats
    the two cases differ only if the grid is not the period of a whole rate (``has_odd_grid_above_period``).

    Parameters
    ----------
    times_ns
        (N,) timestamps that do not decrease, ns.

    Returns
    -------
    bool
        False where the repeats are samples that were written twice, or cannot be distinguished from such samples.
    """
    steps = np.diff(times_ns)
    often = int(np.count_nonzero(steps == 0)) >= _FEWEST_REPEATS
    return (often and _on_one_line(times_ns, int(steps.max()))) or has_odd_grid_above_period(times_ns)


def has_odd_grid_above_period(times_ns: Int64) -> bool:
    """Return whether timestamps are those of a clock of a whole rate in Hz, rounded to a grid just above its period.

    All steps are then 0 or one grid, and all timestamps stay within one grid of the clock. If the grid is itself the
    period of a whole rate, the repeats are samples that were written twice, and the result is False.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns.

    Returns
    -------
    bool
        True where the timestamps were rounded to such a grid.
    """
    steps = np.diff(times_ns)
    grid_ns = int(steps.max(initial=0))
    if grid_ns <= 0 or not np.isin(steps, (0, grid_ns)).all() or not np.any(steps == 0):
        return False
    numbers = np.arange(len(times_ns), dtype=np.float64)
    elapsed_ns = (times_ns - times_ns[0]).astype(np.float64)
    rate_hz = max(round(NS_PER_S / _line(numbers, elapsed_ns)[0]), 1)
    # Timestamps rounded to a grid stay within one grid of their clock; delays by repeated samples accumulate.
    kept = float(np.ptp(elapsed_ns - numbers * NS_PER_S / rate_hz)) <= grid_ns
    whole_ns = NS_PER_S / max(round(NS_PER_S / grid_ns), 1)
    return kept and abs(grid_ns - whole_ns) > _ROUNDED_NS


def _on_one_line(times_ns: Int64, grid_ns: int) -> bool:
    """Return whether timestamps (N,), ns, are those of a regular clock without gaps, rounded to a grid, ns."""
    _, residuals, _ = _line(np.arange(len(times_ns), dtype=np.float64), (times_ns - times_ns[0]).astype(np.float64))
    return float(np.ptp(residuals)) <= _SAME_GRID * grid_ns


def _line(numbers: Float64, elapsed_ns: Float64) -> tuple[float, Float64, float]:
    """Return the least-squares slope over the sample numbers, the residuals, and the numbers' sum of squares.

    The sum of squares is that about the mean of the numbers.
    """
    # slope = sum (n - mean n) t / sum (n - mean n)^2
    centred = numbers - numbers.mean()
    spread = float(centred @ centred)
    slope = float(centred @ elapsed_ns) / spread
    return slope, elapsed_ns - elapsed_ns.mean() - slope * centred, spread


def exact_period(steps: Int64) -> int | None:
    """Return the period that at least half of the steps (n,) have, as those of an exact clock; None of another one."""
    period = int(np.median(steps))
    return period if period > 0 and np.mean(steps == period) >= _EXACT_RATIO else None


@dataclass(frozen=True, slots=True)
class DisplacedSegment:
    """Rows of a clock that deviate from its line.

    Attributes
    ----------
    first, last
        First and last displaced row.
    offset_ns
        Median deviation of the rows, ns; positive where the timestamps are too late.
    drift
        Slope of the deviation over time, s/s; 0 where all rows deviate equally.
    """

    first: int
    last: int
    offset_ns: float
    drift: float


def displaced_part(times_ns: Int64, *, resolution_ns: int) -> DisplacedSegment | None:
    """Return the segment of an exact clock whose timestamps were displaced.

    Timestamps are compared with the line through the first timestamp whose period is the median step. Deviations by
    whole periods do not count, because lost samples cause them. The segment must begin or end with a jump: a clock with
    a wrong rate deviates without a jump.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns.
    resolution_ns
        Unit to which the timestamps are rounded, ns.

    Returns
    -------
    DisplacedSegment | None
        From the first to the last displaced row. None where no row is displaced, where less than a tenth of the
        timestamps lies outside the segment, or where the clock is not exact.
    """
    if len(times_ns) < 3:
        return None
    steps = np.diff(times_ns)
    period = exact_period(steps)
    if period is None:
        return None
    # Deviation from the line through the first timestamp, modulo the period: lost samples leave whole periods.
    deviation_ns = (times_ns - times_ns[0] + period // 2) % period - period // 2
    beside = np.abs(deviation_ns) > resolution_ns
    rows = np.flatnonzero(beside)
    if not len(rows) or len(times_ns) - (rows[-1] - rows[0] + 1) < _LEAST_OUTSIDE * len(times_ns):
        return None
    first, last = int(rows[0]), int(rows[-1])
    # Steps of the deviation into the segment and out of it; a segment that lasts to the end has no second jump. The
    # first row lies on the line, and so outside of the segment.
    jumps = np.abs(np.diff(deviation_ns))[[first - 1, min(last, len(deviation_ns) - 2)]]
    if jumps.max() <= _ROUNDINGS * resolution_ns:
        return None
    inside = deviation_ns[first : last + 1]
    steady = bool(np.ptp(inside) <= _ROUNDINGS * resolution_ns)
    # drift = slope of the deviation (ns) over period * row (ns), by least squares: s/s.
    drift = 0.0 if steady else float(np.polyfit(period * np.arange(len(inside), dtype=float), inside, 1)[0])
    return DisplacedSegment(first, last, float(np.median(inside)), drift)


@dataclass(frozen=True, slots=True)
class VaryingDelay:
    """A regular clock whose timestamps are late by times of their own, without a sample lost.

    Attributes
    ----------
    start_ns, period_ns
        First instant and period, ns, of the clock: sample n was taken at ``start_ns + n period_ns``.
    offset_ns
        Median delay of the samples that are late, ns; negative where they are early.
    range_ns
        Longest less shortest delay, ns.
    returns
        Whether the first and the last timestamp are those of the clock.
    """

    start_ns: float
    period_ns: float
    offset_ns: float
    range_ns: float
    returns: bool


def varying_delay(times_ns: Int64, start_ns: float, *, resolution_ns: int) -> VaryingDelay | None:
    """Return the delay of a regular clock that varies from sample to sample.

    The clock has a whole rate in Hz and begins at a known time. Three delays are none of another rate, of an offset or
    of a grid: neighbours are late by different times; the delay begins and ends within the stream, and neither jumps
    nor grows evenly; or it is larger than its changes, which follow no straight line.

    Parameters
    ----------
    times_ns
        (N,) increasing timestamps, ns.
    start_ns
        When the other clocks begin, ns.
    resolution_ns
        Unit to which the timestamps are rounded, ns.

    Returns
    -------
    VaryingDelay | None
        None where the clock has no such delay.
    """
    if len(times_ns) < _FEWEST_LATE or np.any(np.diff(times_ns) <= 0):
        return None
    if rounding_grid_ns(times_ns, resolution_ns=resolution_ns):
        return None
    numbers = np.arange(len(times_ns), dtype=np.float64)
    # No sample was lost: the rate is that of as many samples.
    period_ns = NS_PER_S / max(round(NS_PER_S * numbers[-1] / (times_ns[-1] - times_ns[0])), 1)
    late_ns = times_ns - start_ns - period_ns * numbers
    rounded_ns = _ROUNDINGS * resolution_ns
    is_late = np.abs(late_ns) > rounded_ns
    if not np.any(is_late):
        return None
    range_ns = float(np.ptp(late_ns))
    # Delays of a grid are smaller than the grid.
    if range_ns <= _SAME_GRID * float(np.gcd.reduce(np.diff(times_ns))):
        return None
    offset_ns = float(np.median(late_ns))
    within = float(np.abs(late_ns - offset_ns).max()) < period_ns / 2
    # Half of a step of rounding in each of three timestamps, of which one counts twice.
    if within and float(np.median(np.abs(np.diff(late_ns, 2)))) > _ROUNDINGS * rounded_ns:
        return VaryingDelay(start_ns, period_ns, offset_ns, range_ns, returns=False)
    returns = not (is_late[0] or is_late[-1])
    if returns and np.mean(~is_late) >= _LEAST_OUTSIDE and _is_uneven(times_ns, late_ns, is_late, resolution_ns):
        return VaryingDelay(start_ns, period_ns, float(np.median(late_ns[is_late])), range_ns, returns=True)
    _, residuals, _ = _line(numbers, late_ns)
    if within and abs(offset_ns) > range_ns and np.ptp(residuals) > _ROUNDINGS * rounded_ns:
        return VaryingDelay(start_ns, period_ns, offset_ns, range_ns, returns=False)
    return None


def _is_uneven(times_ns: Int64, late_ns: Float64, is_late: NDArray[np.bool_], resolution_ns: int) -> bool:
    """Whether a delay that begins and ends is no constant, no line, and no gap that a later one closes."""
    rows = np.flatnonzero(is_late)
    inside = slice(rows[0], rows[-1] + 1)
    if len(rows) < _FEWEST_LATE or slewed_part(times_ns, resolution_ns=resolution_ns) is not None:
        return False
    _, residuals, _ = _line(np.arange(len(late_ns[inside]), dtype=np.float64), late_ns[inside])
    return float(np.ptp(residuals)) > _ROUNDINGS * _ROUNDINGS * resolution_ns


@dataclass(frozen=True, slots=True)
class ClockStep:
    """A step of a clock that is exact otherwise.

    Attributes
    ----------
    row
        First row behind the step.
    offset_ns
        Excess of the step over the period, ns: what rows behind it are later than those before it. It may be whole
        periods, as lost samples leave them.
    """

    row: int
    offset_ns: int


def clock_steps(times_ns: Int64, *, resolution_ns: int) -> tuple[ClockStep, ...]:
    """Return the steps by which an exact clock was set; none where more than two steps are no period.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns.
    resolution_ns
        Unit to which the timestamps are rounded, ns.
    """
    if len(times_ns) < 3:
        return ()
    steps = np.diff(times_ns)
    period = exact_period(steps)
    if period is None:
        return ()
    behind = np.flatnonzero(np.abs(steps - period) > _ROUNDINGS * resolution_ns)
    # A clock is set and set back.
    return tuple(ClockStep(int(row) + 1, int(steps[row]) - period) for row in behind) if len(behind) <= 2 else ()


@dataclass(frozen=True, slots=True)
class SlewedSegment:
    """Time in which an exact clock has a rate error, after which it runs right again and keeps its offset.

    Attributes
    ----------
    start_ns
        Timestamp at which the rate changes, ns.
    duration_ns
        True time for which the clock has the rate error, ns.
    drift
        Rate error, s/s, positive where the clock runs fast.
    """

    start_ns: int
    duration_ns: int
    drift: float


def slewed_part(times_ns: Int64, *, resolution_ns: int) -> SlewedSegment | None:
    """Return the segment of an exact clock in which the clock was slewed: its offset changes evenly and then stays.

    The offset is the sum of the steps' deviations from whole periods, so that it may exceed a period. In the segment it
    lies on a line within rounding, which neither jumps nor jitter do. A clock with a wrong rate throughout has a step
    of another length after equal numbers of steps, within one; so at one end at least, more than twice the largest of
    these numbers must be equal.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns.
    resolution_ns
        Unit to which the timestamps are rounded, ns.

    Returns
    -------
    SlewedSegment | None
        None where there is no such segment, or where the clock is not exact.
    """
    if len(times_ns) < 3:
        return None
    steps = np.diff(times_ns)
    period = exact_period(steps)
    if period is None:
        return None
    excess_ns = (steps + period // 2) % period - period // 2
    odd = np.flatnonzero(excess_ns)
    if len(odd) < _FEWEST_ODD:
        return None
    first, last = int(odd[0]), int(odd[-1])
    ends = max(first, len(steps) - 1 - last)
    outside = len(steps) - (last - first + 1)
    if ends <= 2 * int(np.diff(odd).max()) or outside < _LEAST_OUTSIDE * len(steps):
        return None
    offsets_ns = np.concatenate(([0], np.cumsum(excess_ns[first : last + 1]))).astype(np.float64)
    true_ns = times_ns[first : last + 2] - times_ns[first] - offsets_ns
    # offset = drift (t - start) in the segment: the first and the last step may lie in it in part.
    drift, at_zero_ns = np.polyfit(true_ns[1:-1], offsets_ns[1:-1], 1)
    if not drift or abs(offsets_ns[-1]) <= _ROUNDINGS * resolution_ns:
        return None
    start_ns, stop_ns = -at_zero_ns / drift, (offsets_ns[-1] - at_zero_ns) / drift
    expected_ns = drift * (np.clip(true_ns, start_ns, stop_ns) - start_ns)
    if np.abs(offsets_ns - expected_ns).max() > _ROUNDINGS * resolution_ns:
        return None
    return SlewedSegment(int(times_ns[first]) + round(start_ns), round(stop_ns - start_ns), float(drift))


def rounding_grid_ns(times_ns: Int64, *, resolution_ns: int) -> int:
    """Return the grid to which the timestamps of a regular clock were rounded, 0 where there is none.

    If a grid does not divide the period, the rounded steps have exactly two lengths: the multiples of the grid next
    below and next above the period. They alternate evenly, so that the timestamps deviate from a straight line by at
    most half a grid. Jitter gives steps of many lengths; lost samples make the timestamps leave the line.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns; segments in which timestamps decrease give no grid.
    resolution_ns
        Unit of all timestamps, ns; only coarser grids count.

    Returns
    -------
    int
        Median of the grids of all segments of 64 samples that have one, ns; without any, of segments of 32.
    """
    segments = times_ns[: len(times_ns) // _SEGMENT * _SEGMENT].reshape(-1, _SEGMENT)
    grids = _rounding_grids_ns(segments, resolution_ns)
    if not grids and len(times_ns) >= _SHORT_SEGMENT:
        # A part that is shorter than two segments may fill none of them.
        windows = np.lib.stride_tricks.sliding_window_view(times_ns, _SHORT_SEGMENT)
        grids = _rounding_grids_ns(windows[:: _SHORT_SEGMENT // 2], resolution_ns)
    return int(np.median(grids)) if grids else 0


def _rounding_grids_ns(segments: Int64, resolution_ns: int) -> list[int]:
    """Return the grids of those of some segments (n, m) of timestamps that have one."""
    if not len(segments):
        return []
    steps = np.diff(segments, axis=1)
    short, long = steps.min(axis=1), steps.max(axis=1)
    coarse = (short >= 0) & (long - short > resolution_ns)
    grids = []
    for times in segments[coarse]:
        steps = np.diff(times)
        is_long = 2 * steps > steps.min() + steps.max()
        if min(np.count_nonzero(is_long), np.count_nonzero(~is_long)) < _FEWEST_ODD:
            continue
        # Both steps are successive multiples of the grid: their difference is the grid.
        short = float(steps[~is_long].mean())
        multiples = np.rint(short / (float(steps[is_long].mean()) - short)) + is_long
        grid = float(steps.sum()) / float(multiples.sum())
        slack = resolution_ns if grid > _TICKS_OF_A_GRID * resolution_ns else 0
        if np.abs(steps - multiples * grid).max() > slack + _FLOAT_NS:
            continue
        # Range of the timestamps about the line of least squares.
        numbers = np.arange(len(times)) - (len(times) - 1) / 2
        elapsed = (times - times[0]).astype(np.float64)
        slope = float(numbers @ elapsed) / float(numbers @ numbers)
        if float(np.ptp(elapsed - slope * numbers)) <= _OF_A_GRID * grid:
            grids.append(round(grid))
    return grids
