"""Times of successive events of a pixel: their jitter, and events on a straight line in time.

While a straight edge crosses the square footprint of a pixel, its light Y changes linearly with time, over the part of
the edge in which the edge meets two opposite sides of the footprint. Successive events of one polarity lie at equal
steps of the signal:

    linear model:  Y = Y0 + k C                t_k = a + b k
    log model:     Y = Y0 exp(+- k C)          t_k = a + b exp(+- k C)

The third difference that is 0 for both signs has the characteristic polynomial (E - 1)(E - e^C)(E - e^-C), with E the
step from one event to the next:

    w = t_3 - t_0 - (c + 1) (t_2 - t_1),       c = 2 cosh C (log model), 2 (linear model)

Independent errors of time of the standard deviation s give w the standard deviation s sqrt(2 + 2 (c + 1)^2), about
4.5 s, and both signs equally often. The light gives w a share e of the duration T = t_3 - t_0, and that share does not
depend on the speed of the edge. So short durations determine s best.

The share e is not 0 where an edge meets a corner of the footprint, or is blurred. But then light changes fastest in the
middle of an edge, the outer intervals are longer than the middle one, and e is positive. Jitter makes w negative as
often as positive. Therefore the spread of w is estimated by its lower quartile, over that of a standard normal
variable. Where edges follow each other, a gap in the middle makes some e strongly negative, while those of single edges
stay small. Therefore the lower quartile of |w| gives a second estimate, and the smaller one counts.

``SHAPE_SHARE`` bounds how far the lower quartile of e lies below 0. Over directions, or phases, and over 3 to 12 events
of an edge, at thresholds of 0.05 to 0.5 nat and for the linear model, it is 0 for straight edges, -0.005 or more for
edges with a Gaussian blur, and -0.0215 or more for sine waves, which are worst (integrated in
``tests/estimators/events/test_time_jitter.py``).

Durations below a few s are those of events that jitter has brought together: there, w is limited by T. Four events at
random within T have a lower quartile of |w| / T of ``RANDOM_SHARE``. Where the quartile comes near to this share,
longer durations are used as well.

A simulator that interpolates its signal linearly between two renders gives each pixel events at equal spacings from one
render to the next: with a change of the signal by D in an interval of length T, a threshold of C is crossed every
T C / |D|. The pixel has events of one polarity only. The last of them is less than one spacing from the end of the
interval, and the first one less than one from its start, or less than (C+ + C-) / C where the polarity changes there.
Such events are counted as straight runs.

The same holds for any f(light) that is blended linearly between two renders. Let the signal be L = ln Y, and f = Y^g:
g = 1 for light, and the exponent of the transfer curve for code values. At the crossings f has the values
f_0 exp(+- g k C), and time is an affine function of f:

    t_k = a + b exp(+- g k C)

The spacings have the ratio exp(+- g C), whatever the level is, and g = 0 is the blend of logarithms. (A constant that
is added to light before the logarithm, and one in the transfer curve, change f by a constant, or nearly so.) Two errors
move the crossings of such blends:

- Renders that are blended n times in the interval, with straight lines in L between them. The chord of L over T / n
  deviates by L'' (T / n)^2 / 8 at most, and L'' = -g L'^2 with L' = C / s for a spacing of s: in time, by g C T^2 / (8
  n^2 s). The shortest spacing of a run bounds this.
- Blends that are stored as codes are rounded by half a step r: in time, by r / (g C f) spacings.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cosh, expm1, pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.fitting.robust import jackknife_errors

Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

QUARTILE: Final = 0.25

_EVENTS: Final = 4
"""Events of a quadruple."""

DEVIATES: Final = (0.6744897501960817, 0.31863936396437514)
"""For a standard normal x, minus the lower quartile of x, Phi(-0.6745) = 1/4, and the lower quartile of |x|,
2 Phi(0.3186) - 1 = 1/4."""

SHAPE_SHARE: Final = 0.022
"""Bound on minus the lower quartile of w / T that the light causes. Derivation above."""

RANDOM_SHARE: Final = 0.275
"""Lower quartile of |w| / T for two events at random times between two others, for c = 2.

w = T - 3 (t_2 - t_1), and (t_2 - t_1) / T has the density 2 (1 - g). P(|1 - 3 g| < q) = 2 q / 3 (2 - 2 / 3) = 8 q / 9
for q up to 1, so the quartile is 9 / 32 = 0.28; a little less where c > 2."""

_REGULAR_SHARE, _SATURATED_SHARE = 0.4 * RANDOM_SHARE, 0.7 * RANDOM_SHARE
"""Lower quartiles of |w| / T: below the first, both quartiles grow in proportion to the jitter, and no longer durations
are needed; above the second, the jitter of the estimate is only a lower bound."""

_LIMIT_ERRORS: Final = 5.0
"""Approximate number of standard errors in a limit, for the comparison of octaves only."""

SHORT_SHARE: Final = 0.125
"""Share of the quadruples with the shortest durations that may be due to noise events, and determine nothing alone."""

FEWEST_PIXELS: Final = 50
"""Least number of pixels in the quadruples of an octave: one pixel that fires without cause must not decide."""

FEWEST_TICKS: Final = 8
"""Least duration of a quadruple in ticks: three intervals of more than two ticks each, after rounding."""

MOST_OF_A_PIXEL: Final = 4
"""Largest number of quadruples of a pixel in a window, with the same reason."""

_OVERLAP: Final = 2.31
"""Number of successive quadruples that count as one.

Successive w of independent times have the correlations -15/20, 6/20 and -1/20, and those of w^2 are their squares:
1 + 2 (0.5625 + 0.09 + 0.0025) = 2.31."""

FEWEST_EVENTS: Final = 3
"""Two events lie on a line always."""

LEAST_SPACING_TICKS: Final = 10
"""Least spacing of a line, in steps of the timestamps. A line of three events then occurs by chance in a tenth of the
runs at most (``chance_of_line``)."""


class Quadruples(NamedTuple):
    """n quadruples of successive events of one pixel and one polarity.

    Attributes
    ----------
    durations_ns
        (n,) from the first event to the fourth, ns.
    middles_ns
        (n,) from the second event to the third, ns.
    pixels
        (n,) row * width + column.
    """

    durations_ns: Int32
    middles_ns: Int32
    pixels: Int32


@dataclass(frozen=True, slots=True)
class JitterEstimate:
    """The spread of event timestamps about their true times.

    Attributes
    ----------
    sigma_s, standard_error_s
        Standard deviation and its standard error, s.
    bound_s
        Bound on the spread that light and ticks alone cause, s.
    nominal_error_s
        Standard error of the spread of a correct file with as many quadruples, s.
    saturated
        Whether jitter exceeds the intervals between events, so that ``sigma_s`` is a lower bound.
    quadruples
        Number of quadruples that determine the estimate.
    duration_s
        Their median duration, s.
    """

    sigma_s: float
    standard_error_s: float
    bound_s: float
    nominal_error_s: float
    saturated: bool
    quadruples: int
    duration_s: float


def event_quadruples(
    events: PixelEvents, start_ns: int, stop_ns: int, longest_ns: int, excluded: NDArray[np.int64], most: int
) -> Quadruples:
    """Return quadruples of successive events of one pixel and one polarity.

    Parameters
    ----------
    events
        Events by pixel.
    start_ns, stop_ns
        The first event of a quadruple lies in [start, stop), ns.
    longest_ns
        Longest duration, ns, below 2^31.
    excluded
        (k,) pixels that are left out, row * width + column.
    most
        Number of quadruples beyond which only every second, third, ... pixel is taken.

    Returns
    -------
    Quadruples
        In the order of pixels and, within a pixel, of time.
    """
    usable = np.ones(len(events.starts) - 1, np.bool_)
    usable[excluded] = False
    nothing = np.empty((3, 0), np.int32)
    count = _collect(events.starts, events.timestamped, usable, start_ns, stop_ns, longest_ns, 1, nothing)
    every = max(1, -(-count // most))
    rows = np.empty((3, count), np.int32)
    count = _collect(events.starts, events.timestamped, usable, start_ns, stop_ns, longest_ns, every, rows)
    durations_ns, middles_ns, pixels = rows[:, :count].copy()
    return Quadruples(durations_ns, middles_ns, pixels)


@njit(cache=True)
def _collect(
    starts: Int32,
    timestamped: Int64,
    usable: NDArray[np.bool_],
    start_ns: int,
    stop_ns: int,
    longest_ns: int,
    every: int,
    rows: Int32,
) -> int:
    """Count quadruples, and write duration, middle interval and pixel of as many as ``rows`` (3, n) has room for.

    Of the pixels one in ``every`` is taken.
    """
    count, room = 0, rows.shape[1]
    for pixel in range(len(usable)):
        if not usable[pixel] or starts[pixel + 1] - starts[pixel] < _EVENTS:  # most pixels
            continue
        # Pixels in an order without pattern: Knuth's multiplicative hash (TAOCP vol. 3, 6.4).
        if (np.uint64(pixel) * np.uint64(2654435761) >> np.uint64(7)) % np.uint64(every) != 0:
            continue
        of_pixel = 0
        for i in range(starts[pixel], starts[pixel + 1] - _EVENTS + 1):
            first = timestamped[i] >> 1
            if first < start_ns or first >= stop_ns or of_pixel == MOST_OF_A_PIXEL:
                continue
            duration = (timestamped[i + 3] >> 1) - first
            middle = (timestamped[i + 2] >> 1) - (timestamped[i + 1] >> 1)
            # The lowest bit is the polarity. Events out of order have a negative duration.
            same = (timestamped[i] & 1) + (timestamped[i + 1] & 1) + (timestamped[i + 2] & 1) + (timestamped[i + 3] & 1)
            if same % 4 or duration < 0 or duration > longest_ns or middle < 0 or middle > duration:
                continue
            if count < room:
                rows[0, count], rows[1, count], rows[2, count] = duration, middle, pixel
            count += 1
            of_pixel += 1
    return count


def step_polynomial(threshold_nat: float) -> float:
    """Return c = 2 cosh C, for a threshold C in nat; 2 for the linear model, with a threshold of 0."""
    return 2 * cosh(threshold_nat)


def estimate_jitter(
    durations_s: Float64,
    middles_s: Float64,
    pixels: NDArray[np.integer],
    parts: NDArray[np.integer],
    *,
    c: float,
    tick_s: float,
    longest_s: float,
    rounding_share: float = 0.0,
) -> JitterEstimate | None:
    """Return the jitter of event timestamps.

    Durations are divided into octaves below ``longest_s``. The shortest octave that does not belong to the shortest
    eighth of all quadruples gives the estimate. Where its quadruples are nearly as irregular as random events, longer
    octaves are used as well, until one is regular, and the estimate with the largest lower confidence limit counts:
    short durations limit the jitter that they show.

    Parameters
    ----------
    durations_s, middles_s
        (n,) durations and middle intervals of the quadruples, s.
    pixels
        (n,) numbers that differ between pixels.
    parts
        (n, k) numbers of the part of a quadruple, by k partitions; the scatter between the parts of each gives a
        standard error.
    c
        Of ``step_polynomial``.
    tick_s
        Step of the timestamps, s.
    longest_s
        Longest duration, s.
    rounding_share
        Standard deviation of w / T that the rounding of the signal causes.

    Returns
    -------
    JitterEstimate or None
        None where no octave has quadruples of ``FEWEST_PIXELS`` pixels, or where more than the shortest eighth last
        less than ``FEWEST_TICKS`` ticks.
    """
    # Errors of stamps on a grid are independent and uniform only where the intervals are longer than its step.
    if not len(durations_s) or not np.quantile(durations_s, SHORT_SHARE) >= FEWEST_TICKS * tick_s:
        return None
    resolved = durations_s >= FEWEST_TICKS * tick_s
    durations_s, middles_s, pixels, parts = (
        durations_s[resolved],
        middles_s[resolved],
        pixels[resolved],
        parts[resolved],
    )
    differences_s = durations_s - (c + 1) * middles_s
    octaves = np.floor(np.log2(longest_s / durations_s)).astype(np.int64)
    shortest = int(np.floor(np.log2(longest_s / np.quantile(durations_s, SHORT_SHARE))))
    # Independent errors s of four times give w = t_3 - t_0 - (c + 1)(t_2 - t_1) the standard deviation gain * s.
    gain = sqrt(2 + 2 * (c + 1) ** 2)
    # A stamp is uniform within a tick, and the quartiles of whole ticks spread w over a tick once more.
    tick_bound_s = tick_s * sqrt((1 + 1 / gain**2) / 12)
    shape_share = SHAPE_SHARE / DEVIATES[0] + rounding_share
    estimates: list[JitterEstimate] = []
    for octave in range(max(shortest, 0), -1, -1):
        chosen = octaves == octave
        if len(np.unique(pixels[chosen])) < FEWEST_PIXELS:
            continue
        duration_s = float(np.median(durations_s[chosen]))
        deviations_s = _deviations(differences_s[chosen], tick_s)
        which = int(np.argmin(deviations_s))
        error_s = float(_errors(differences_s[chosen], parts[chosen], tick_s)[which]) / gain
        bound_s = shape_share * duration_s / gain + tick_bound_s
        estimates.append(
            JitterEstimate(
                sigma_s=max(float(deviations_s[which]), 0.0) / gain,
                standard_error_s=error_s,
                bound_s=bound_s,
                # The error of a spread is a share of it, and the spread of a correct file is ``bound_s`` at most.
                nominal_error_s=error_s * min(1.0, bound_s * gain / max(float(deviations_s[1]), tick_s)),
                saturated=bool(deviations_s[1] * DEVIATES[1] > _SATURATED_SHARE * duration_s),
                quadruples=int(np.count_nonzero(chosen)),
                duration_s=duration_s,
            )
        )
        if deviations_s[1] * DEVIATES[1] <= _REGULAR_SHARE * duration_s:
            break
    return max(estimates, key=_lower_limit_s, default=None)


def _lower_limit_s(estimate: JitterEstimate) -> float:
    """Return a lower confidence limit of the jitter, s; it only chooses among octaves."""
    return estimate.sigma_s - estimate.bound_s - _LIMIT_ERRORS * estimate.standard_error_s


def _deviations(differences: Float64, tick: float) -> Float64:
    """Return the standard deviations of normal variables with the lower quartiles of w (n,) and of |w|."""
    cells = np.rint(differences / tick)
    quartiles = -_lower_quartile(cells, -np.inf), _lower_quartile(np.abs(cells), 0.0)
    deviations: Float64 = np.array(quartiles) * tick / np.array(DEVIATES)
    return deviations


def _lower_quartile(cells: Float64, least: float) -> float:
    """Return the lower quartile of values of at least ``least`` that are rounded to whole numbers (n,).

    Each value is spread evenly over its cell: timestamps in coarse ticks give few different values, and order
    statistics would jump by whole ticks.
    """
    place = min(int(QUARTILE * len(cells)), len(cells) - 1)
    # The cell that holds the quartile, the share of the values below it, and the share within it.
    cell = float(np.partition(cells, place)[place])
    first, stop = np.count_nonzero(cells < cell), np.count_nonzero(cells <= cell)
    # |w| has no values below 0: its cell of 0 is half as wide.
    begin = max(cell - 0.5, least)
    return float(begin + (cell + 0.5 - begin) * (QUARTILE * len(cells) - first) / (stop - first))


def _errors(differences: Float64, parts: NDArray[np.integer], tick: float) -> Float64:
    """Return the standard errors of ``_deviations``: for each the largest of the formal one and those by parts."""
    deviates = np.array(DEVIATES)
    # Asymptotic variance of a quantile, p (1 - p) / (n f^2), with the density f of x, phi(x), and of |x|, 2 phi(x)
    # (Cramer 1946, 28.5).
    densities = np.array([1, 2]) * np.exp(-0.5 * deviates**2) / sqrt(2 * pi)
    relative = sqrt(QUARTILE * (1 - QUARTILE) * _OVERLAP / len(differences)) / (densities * deviates)
    # The lower quartile of w may be near 0 by chance, or by shape; that of |w| shows the spread.
    errors = [relative * _deviations(differences, tick)[1]]
    for partition in parts.T:
        masks = [partition != part for part in np.unique(partition)]
        if len(masks) > 1:
            errors.append(jackknife_errors([_deviations(differences[others], tick) for others in masks]))
    largest: Float64 = np.max(errors, axis=0)
    return largest


def chance_of_line(tick_ns: int, spacing_ns: float) -> float:
    """Return the probability that three events lie on a line by chance.

    The second of them lies anywhere between the others, 2 s apart with a spacing of s, and on the line within one tick
    either way: 2 tick / (2 s). More events lie on a line less often.

    Parameters
    ----------
    tick_ns
        Step of the timestamps, ns.
    spacing_ns
        Spacing s, ns.
    """
    return tick_ns / spacing_ns


class Blend(NamedTuple):
    """A function of light that is a straight line in time from one render to the next.

    Attributes
    ----------
    log_ratios
        Logarithm of the ratio of two successive spacings, -g C- for darker events and g C+ for brighter ones.
    spacing_share
        Largest error of a time that the rounding of codes causes, in mean spacings.
    fewest_renders
        Fewest blends in an interval, with straight lines of the signal between them.
    """

    log_ratios: tuple[float, float]
    spacing_share: float
    fewest_renders: int


BLEND_OF_SIGNAL: Final = Blend((0.0, 0.0), 0.0, 1)
"""The signal itself is straight: equal spacings."""


class LineRules(NamedTuple):
    """What makes events of a pixel a line.

    Attributes
    ----------
    tick_ns
        Step of the timestamps, ns.
    first_spacings
        Largest time from the start of an interval to the first event, in spacings.
    blends
        (m, 4) attributes of m blends.
    """

    tick_ns: int
    first_spacings: float
    blends: Float64


def straight_runs(
    events: PixelEvents, parts_ns: Sequence[Int64], tick_ns: int, first_spacings: float, blends: Sequence[Blend]
) -> Int64:
    """Count the runs of events of a pixel within intervals, and those that lie on one line through all of an interval.

    A run is all events of one pixel in an interval, three at least, as few as to be ten ticks apart on average.

    Parameters
    ----------
    events
        By pixel; timestamps in ns.
    parts_ns
        k arrays (n, 2) of intervals (start, stop], ns. Those of an array ascend and do not overlap.
    tick_ns
        Step of the timestamps, ns: a timestamp is the first tick not before the crossing.
    first_spacings
        Largest time from the start of an interval to the first event of a line, in spacings.
    blends
        m functions of light in which a line is straight.

    Returns
    -------
    ndarray of int64
        (k, 2 + m) number of runs, of events in all runs, and of runs on a line of each blend.
    """
    counts = np.zeros((len(parts_ns), 2 + len(blends)), np.int64)
    if len(parts_ns):
        ends = np.cumsum([len(part) for part in parts_ns])
        lines = np.array([(*blend.log_ratios, blend.spacing_share, blend.fewest_renders) for blend in blends], float)
        intervals = np.concatenate(parts_ns)
        rules = LineRules(tick_ns, float(first_spacings), lines)
        _count_runs(events.starts, events.timestamped, intervals, ends, rules, counts)
    return counts


@njit(cache=True)
def _count_runs(
    starts: NDArray[np.int32],
    timestamped: Int64,
    intervals: Int64,
    ends: Int64,
    rules: LineRules,
    counts: Int64,
) -> None:
    """Add to ``counts`` (k, 2 + m), as of ``straight_runs``.

    ``ends`` (k,) are the indices after each part's intervals.
    """
    for pixel in range(len(starts) - 1):
        begin, end = starts[pixel], starts[pixel + 1]
        # Most pixels have too few events for any interval.
        if end - begin < FEWEST_EVENTS:
            continue
        for part in range(len(ends)):
            event, interval = begin, ends[part - 1] if part else 0
            while event < end and interval < ends[part]:
                start, stop = intervals[interval, 0], intervals[interval, 1]
                time = timestamped[event] >> 1
                if time > stop:
                    interval += 1
                    continue
                if time <= start:
                    event += 1
                    continue
                first, same = event, True
                while event < end and timestamped[event] >> 1 <= stop:
                    same &= (timestamped[event] & 1) == (timestamped[first] & 1)
                    event += 1
                count = event - first
                if count < FEWEST_EVENTS or stop - start < count * LEAST_SPACING_TICKS * rules.tick_ns:
                    continue
                counts[part, 0] += 1
                counts[part, 1] += count
                if not same:
                    continue
                for blend in range(len(rules.blends)):
                    counts[part, 2 + blend] += _is_straight(timestamped, first, event, start, stop, rules, blend)


@njit(cache=True)
def _is_straight(timestamped: Int64, first: int, end: int, start: int, stop: int, rules: LineRules, blend: int) -> bool:
    """Return whether events of one polarity from ``first`` to before ``end`` lie on one line in (start, stop], ns."""
    first_time, last_time, last = timestamped[first] >> 1, timestamped[end - 1] >> 1, end - first - 1
    line, tick = rules.blends[blend], rules.tick_ns
    log_ratio = line[timestamped[first] & 1]
    mean_spacing = max((last_time - first_time) / last, 1.0)
    # f_k - f_0, and its scale in time by first and last event.
    scale = (last_time - first_time) / _change(log_ratio, last)
    # Errors of codes and of chords, as in the module's docstring; these are largest where the spacing is least.
    shortest = min(scale * _change(log_ratio, 1), scale * (_change(log_ratio, last) - _change(log_ratio, last - 1)))
    chord = abs(log_ratio) * (stop - start) ** 2 / (8 * line[3] ** 2 * max(shortest, 1.0))
    tolerance = tick + line[2] * mean_spacing + chord
    after_last = scale * (_change(log_ratio, last + 1) - _change(log_ratio, last))
    if first_time - start > -scale * _change(log_ratio, -rules.first_spacings) + tick + tolerance:
        return False
    if stop - last_time > after_last + tick + tolerance:
        return False
    for k in range(1, last):
        # Timestamps are up to a tick late: so is the event, and so is the line through first and last event.
        if abs((timestamped[first + k] >> 1) - first_time - scale * _change(log_ratio, k)) > tolerance:
            return False
    return True


@njit(cache=True)
def _change(log_ratio: float, thresholds: float) -> float:
    """Return the change of f after a number of thresholds, in a unit that does not matter."""
    return thresholds if log_ratio == 0 else expm1(log_ratio * thresholds)
