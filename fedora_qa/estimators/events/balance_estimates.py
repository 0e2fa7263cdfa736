"""Estimates of the balance of events against changes of the light: gain, growth, scatter, their courses and places.

The line of events against changes, and what faults do to it, are derived in ``balance``. Errors are those of the
scatter over tiles, or of what a fit leaves, so that they contain what a model of the pixels does not state.
"""

from dataclasses import dataclass
from math import inf, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.balance import MOMENTS, TILES
from fedora_qa.estimators.fitting.robust import jackknife_errors

Float64 = NDArray[np.float64]

_FEWEST: Final = 10
"""Least number of changes of a class, and of degrees of freedom of a variance, whichever tile is left out."""

_SINGULAR: Final = 1e9
"""Condition of normal equations that determine nothing."""

_DUE: Final = 7.0
"""Events that are due in a tile in which none comes: by chance in one of a thousand."""

_SIGMAS: Final = 5.0
"""Standard deviations beyond which a cell holds more than its share: one in a million does by chance."""


@dataclass(frozen=True, slots=True)
class GainEstimate:
    """A value with its standard error, of the scatter over tiles."""

    value: float
    error: float


@dataclass(frozen=True, slots=True)
class ResponseLine:
    """The line of events against changes.

    Attributes
    ----------
    gain
        Events for an event that is due.
    growth
        Further events for each further threshold of the change, relative to the gain: 1 for a line.
    scatter
        Variance of the events that each further event adds: 0 for an ideal pixel, 1 - g for random losses. Where the
        classes of changes end between events, the variance of the phases differs between them: by up to a tenth for
        gains that scenes of evenly distributed changes have.
    """

    gain: GainEstimate
    growth: GainEstimate
    scatter: GainEstimate


def response_line(moments: NDArray[np.floating[Any]]) -> ResponseLine | None:
    """Return the line of some intervals; None where too few changes are large, or none has an event.

    Parameters
    ----------
    moments
        (k, 2, 2, t, 6), as of ``BalanceSums``.
    """
    exact = moments.astype(np.float64)
    by_tile = np.concatenate([exact.sum(axis=(0, 1)), _about_means(exact).sum(axis=(0, 1))], axis=-1).swapaxes(0, 1)
    used = by_tile[by_tile[..., 0].sum(axis=1) > 0]
    if len(used) < 2 or np.any((used.sum(axis=0) - used)[..., [0, MOMENTS]] < _FEWEST):
        return None
    # Without an event there is no gain that growth and scatter relate to.
    if np.any((used.sum(axis=0) - used)[..., 4].sum(axis=1) == 0):
        return None
    errors = jackknife_errors([_line_of(used.sum(axis=0) - each) for each in used])
    return ResponseLine(
        *(GainEstimate(*map(float, pair)) for pair in zip(_line_of(used.sum(axis=0)), errors, strict=True))
    )


def _about_means(moments: Float64) -> Float64:
    """Return (..., 4) degrees of freedom and sums of k k, k e and e e about the means, of each cell of (..., 6)."""
    count, k, e, kk, ke, ee = np.moveaxis(moments, -1, 0)
    n = np.maximum(count, 1)
    return np.stack([np.maximum(count - 1, 0), kk - k * k / n, ke - k * e / n, ee - e * e / n], axis=-1)


def _line_of(sums: Float64) -> Float64:
    """Return gain, growth and scatter of the sums (2, 10) of both classes."""
    count, k, e, kk, ke, _, freedom, about_kk, about_ke, about_ee = sums.T
    gain = ke.sum() / kk.sum()
    mean_k, mean_e = k / count, e / count
    marginal = (mean_e[1] - mean_e[0]) / (mean_k[1] - mean_k[0])
    # Variances about the lines of the cells: a gain that differs by time and place does not scatter.
    variance = (about_ee - about_ke**2 / np.maximum(about_kk, 1e-12)) / freedom
    return np.array([gain, marginal / gain, (variance[1] - variance[0]) / (gain * (mean_k[1] - mean_k[0]))])


@dataclass(frozen=True, slots=True)
class GainCourse:
    """How the gain differs over time, or across the image.

    Attributes
    ----------
    contrast
        Difference of the gains of the part and of the rest, or of both ends of a trend.
    usual
        Gain of the rest, or in the middle of a trend.
    first, stop
        The part; the whole of a trend.
    is_trend
        Whether a trend fits better than a part.
    """

    contrast: GainEstimate
    usual: float
    first: int
    stop: int
    is_trend: bool


def gain_over_time(moments: NDArray[np.floating[Any]], fewest: int) -> GainCourse | None:
    """Return the part of the time, or the trend, that fits the gains of the intervals best; None for too few.

    The part has half of the changes at most.

    Parameters
    ----------
    moments
        (k, 2, 2, t, 6), as of ``BalanceSums``.
    fewest
        Least number of intervals of a part, and of what is left.
    """
    *_, kk, ke, _ = np.moveaxis(moments.sum(axis=(1, 2, 3)), -1, 0)
    n = len(kk)
    if n < 2 * fewest or np.count_nonzero(kk) < 2 * fewest:
        return None
    gains = ke / np.maximum(kk, 1e-12)
    # Sums of ke and kk before each interval: those of a part are differences.
    sum_ke, sum_kk = (np.concatenate([[0.0], each.cumsum()]) for each in (ke, kk))
    best: tuple[float, int, int] | None = None
    for first in range(n):
        stops = np.arange(first + fewest, min(n, first + n - fewest) + 1)
        if not len(stops):
            continue
        w, x = sum_kk[stops] - sum_kk[first], sum_ke[stops] - sum_ke[first]
        rest = sum_kk[-1] - w
        inside, outside = x / np.maximum(w, 1e-12), (sum_ke[-1] - x) / np.maximum(rest, 1e-12)
        # The sum of squares that two levels explain. The rest is the larger share of the changes.
        explained = np.where(w <= rest, (inside - outside) ** 2 * w * rest / sum_kk[-1], 0.0)
        top = int(np.argmax(explained))
        if best is None or explained[top] > best[0]:
            best = float(explained[top]), first, int(stops[top])
    if best is None:
        return None
    _, first, stop = best
    part = np.zeros(n, np.bool_)
    part[first:stop] = True
    times = np.arange(n) - np.average(np.arange(n), weights=kk)
    fits = []
    for column in (part.astype(np.float64), times / (n - 1)):
        design = np.stack([np.ones(n), column], axis=1)
        normal = design.T @ (kk[:, np.newaxis] * design)
        if np.linalg.cond(normal) > _SINGULAR:
            return None
        level, contrast = np.linalg.solve(normal, design.T @ (kk * gains))
        left = float(np.sum(kk * (gains - design @ [level, contrast]) ** 2))
        fits.append((left, contrast, sqrt(max(left / (n - 2) * np.linalg.inv(normal)[1, 1], 0.0)), level))
    is_trend = fits[1][0] < fits[0][0]
    _, contrast, error, level = fits[is_trend]
    ends = (0, n) if is_trend else (first, stop)
    return GainCourse(GainEstimate(float(contrast), float(error)), float(level), *ends, is_trend)


def gain_across(moments: NDArray[np.floating[Any]]) -> GainCourse | None:
    """Return the trend of the gain across the image, in the direction in which it is steepest; None for too few tiles.

    Parameters
    ----------
    moments
        (k, 2, 2, t, 6), as of ``BalanceSums``.
    """
    *_, kk, ke, _ = np.moveaxis(moments.sum(axis=(0, 1, 2)), -1, 0)
    down, right = np.divmod(np.arange(len(kk)), TILES)
    design = np.stack([np.ones(len(kk)), right / (TILES - 1) - 1 / 2, down / (TILES - 1) - 1 / 2], axis=1)
    used = kk > 0
    normal = design.T @ (kk[:, np.newaxis] * design)
    if np.count_nonzero(used) < TILES or np.linalg.cond(normal) > _SINGULAR:
        return None
    gains = ke / np.maximum(kk, 1e-12)
    level, *slope = np.linalg.solve(normal, design.T @ (kk * gains))
    left = float(np.sum(kk * (gains - design @ [level, *slope]) ** 2)) / (np.count_nonzero(used) - 3)
    size = float(np.hypot(*slope))
    direction = np.array([0.0, *slope]) / max(size, 1e-12)
    error = sqrt(max(left * float(direction @ np.linalg.inv(normal) @ direction), 0.0))
    return GainCourse(GainEstimate(size, error), float(level), 0, len(kk), is_trend=True)


def silent_share(moments: NDArray[np.floating[Any]]) -> float:
    """Return the share of the missing events that are due in tiles which give none in an interval, 0 to 1."""
    cells = moments.sum(axis=(1, 2))
    due, came = cells[..., 1], cells[..., 2]
    missing = float(due.sum() - came.sum())
    return min(float(due[(due > _DUE) & (cells[..., 5] == 0)].sum()) / missing, 1.0) if missing > 0 else 0.0


def threshold_spread(agreement: Float64) -> GainEstimate:
    """Return the variance of the thresholds of pixels, relative to their square, by the agreement of their deviations.

    Parameters
    ----------
    agreement
        (k, t, 2), as of ``BalanceSums``.
    """
    products = agreement.sum(axis=0)
    used = products[products[:, 1] > 0]
    if len(used) < 2:
        return GainEstimate(0.0, inf)
    total = used.sum(axis=0)
    left_out = [(total - each)[0] / (total - each)[1] for each in used]
    return GainEstimate(float(total[0] / total[1]), float(jackknife_errors(left_out)))


def concentration(counts: NDArray[np.integer[Any]]) -> float:
    """Return the share of counts that lie above those of equal cells: beyond five sigma of a Poisson distribution.

    Parameters
    ----------
    counts
        Events against the change of the light, by columns.
    """
    mean = counts.mean()
    beyond = counts > mean + _SIGMAS * sqrt(mean + 1)
    return float((counts[beyond] - mean).sum() / max(counts.sum(), 1))
