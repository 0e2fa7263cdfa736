"""Samples off a smooth motion, and straight lines between samples, by the curvature of each sample's neighbourhood."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.imu.sampled_curves import SampledCurve, divided_differences, stencils_of

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Indices = NDArray[np.intp]

_LONE: Final = 20.0
"""Medians of the distance of a sample from the middle of its neighbours above which it lies off. The length of normal
noise of three axes exceeds four medians in one of 1e9 samples; a motion is left."""

_ROWS_OF_TWO: Final = 6
"""Most rows in succession that two lone samples beside each other disturb: a motion is longer."""

_FEWEST_PERIODS: Final = 16
"""Least number of knots for a median of the curvature at them."""

_LARGEST_STRIDE: Final = 20
"""Largest distance of knots that is tried, in samples."""

_CURVATURE_ROUNDINGS: Final = 100.0
"""Units of rounding that the curvature at knots must exceed: below it both medians result from rounding alone."""


_STRAIGHT_ROUNDINGS: Final = 4.0
"""Units of rounding that the curvature of rounded samples of a straight line does not exceed: each of the three samples
is off by half a unit on each of three axes, and the spacing doubles at powers of two."""

_FEWEST_LINES: Final = 3
"""Least number of straight lines in succession: with fewer, their equal lengths say nothing."""


@dataclass(frozen=True, slots=True)
class CurvatureEvenness:
    """Ratio of the curvature of a motion between every ``stride``-th sample to that at these samples.

    Attributes
    ----------
    evenness
        Median curvature between these samples over the median at them. Near 1 for any smooth or noisy motion, near
        0 where samples were interpolated linearly from every ``stride``-th.
    stride
        Distance of these samples, in samples.
    rows
        First and last sample of the part of the curve that was compared; None: all of it.
    """

    evenness: float
    stride: int
    rows: tuple[int, int] | None = None


def lone_samples(times_ns: Int64, curve: SampledCurve) -> tuple[Indices, Float64]:
    """Return the samples that lie off the motion of their neighbours one by one, and their distances from it.

    The second difference at a sample that lies off by d is -2 d, and d at both neighbours. Of noise, and of a motion
    that speeds up for a while, second differences are large in many rows, or in runs of them.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.

    Returns
    -------
    rows : (n,) array
        Of the samples that lie off; empty where there are none, or any beside another.
    distances : (n,) array
        From the middle of the two neighbours, in the unit of the curve.
    """
    stencils = stencils_of(times_ns, 3)
    none: Indices = np.empty(0, dtype=np.intp)
    if len(stencils) < _FEWEST_PERIODS:
        return none, np.empty(0)
    vectors = curve.relative_vectors(stencils, 1)
    distances = np.linalg.norm(vectors[:, 0] + vectors[:, 2], axis=1) / 2
    # Half of all rows are quiet even where a fifth of the samples lie off. At most half exceed the median.
    off = distances > _LONE * max(float(np.median(distances)), np.finfo(np.float64).tiny)
    starts = np.flatnonzero(np.diff(np.r_[0, off.astype(np.int8)]) == 1)
    stops = np.flatnonzero(np.diff(np.r_[off.astype(np.int8), 0]) == -1) + 1
    if not len(starts) or np.any(stops - starts > _ROWS_OF_TWO):
        return none, np.empty(0)
    # The largest row of each run is that of the sample: its neighbours show half of the distance.
    largest = np.array(
        [start + int(np.argmax(distances[start:stop])) for start, stop in zip(starts, stops, strict=True)]
    )
    neighbours = np.clip(largest[:, None] + [-1, 1], 0, len(off) - 1)
    lone = largest[off[neighbours].all(axis=1)]
    return stencils[lone, 1], distances[lone]


def find_interpolation(
    times_ns: Int64, curve: SampledCurve, *, resolution: float, step: float = 0.0, order: int = 2
) -> CurvatureEvenness | None:
    """Return the stride of 2 to 20 for which samples lie most nearly on straight lines between every stride-th sample.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.
    resolution
        Rounding of a sample, in the unit of the curve. Strides whose curvature at knots is below a hundred times
        this are left out.
    step
        To which samples were rounded before they were stored, in the unit of the curve; 0 for none. Rounded samples of
        a steady motion are straight for as long as they keep their step, and bend by it: strides of no larger bends
        are left out.
    order
        Of the differences that stand for the curvature: 2 for straight lines; 4 for cubic curves, whose third
        derivative alone jumps, at their knots.

    Returns
    -------
    CurvatureEvenness or None
        The least even one, for equal evenness that of the smallest stride; None where there is no curvature to
        compare.
    """
    bends = np.linalg.norm(divided_differences(times_ns, curve, order), axis=-1)
    by_size = np.argsort(bends, kind="stable")
    ranked = bends[by_size]
    candidates = []
    for stride in range(2, min(_LARGEST_STRIDE, len(bends) // _FEWEST_PERIODS) + 1):
        # The bends are sorted once. The members of a phase, in order of rank, have their median in the middle.
        phases = (by_size % stride).astype(np.uint8)
        by_phase, counts = np.argsort(phases, kind="stable"), np.bincount(phases)
        for ranks in np.split(by_phase, np.cumsum(counts)[:-1]):
            at_knots = _mean_of_two(ranked[ranks[_median_ranks(len(ranks))]])
            if at_knots > max(_CURVATURE_ROUNDINGS * resolution, _STRAIGHT_ROUNDINGS * step):
                # Median of the bends that are not in ``ranks``: its rank among these, plus the members of ``ranks``
                # below it.
                among_rest = np.array(_median_ranks(len(bends) - len(ranks)))
                of_rest = among_rest + np.searchsorted(ranks - np.arange(len(ranks)), among_rest, side="right")
                candidates.append(CurvatureEvenness(_mean_of_two(ranked[of_rest]) / at_knots, stride))
    return min(candidates, key=lambda candidate: (round(candidate.evenness, 2), candidate.stride), default=None)


def find_straight_lines(
    times_ns: Int64, curve: SampledCurve, *, resolution: float, step: float = 0.0
) -> CurvatureEvenness | None:
    """Return the part of a curve without noise in which samples lie on straight lines of equal lengths.

    No motion is straight within rounding up to a sample and bent at it, sample for sample at equal distances. The last
    line may be shorter or longer than the others.

    Parameters
    ----------
    times_ns, curve, resolution, step
        As of ``find_interpolation``.

    Returns
    -------
    CurvatureEvenness or None
        Of the longest such part; None where there is none.
    """
    rows = stencils_of(times_ns, 3)[:, 1]
    bends = np.linalg.norm(divided_differences(times_ns, curve, 2), axis=-1)
    if len(rows) != len(bends) or not len(rows) or not resolution > 0:
        return None
    # Knots, and the numbers of straight samples behind each of them up to the next one.
    knots = np.flatnonzero(bends > _STRAIGHT_ROUNDINGS * resolution)
    lines = np.diff(np.r_[-1, knots, len(bends)]) - 1
    # Successive lines of equal lengths, from a knot to a knot.
    inner = lines[1:-1]
    starts = np.r_[0, np.flatnonzero(np.diff(inner)) + 1] if len(inner) else np.empty(0, dtype=np.intp)
    counts = np.diff(np.r_[starts, len(inner)])
    best: CurvatureEvenness | None = None
    for start, count in zip(starts, counts, strict=True):
        if inner[start] == 0 or count < _FEWEST_LINES - 1:
            continue
        # A line of another length behind them counts as the last one; so does one that reaches the end.
        others = int(lines[start + count + 1] > 0)
        first, last = int(knots[start]), int(knots[start + count])
        at_knots = float(np.median(bends[knots[start : start + count + 1]]))
        least = max(_CURVATURE_ROUNDINGS * resolution, _STRAIGHT_ROUNDINGS * step)
        if count + others < _FEWEST_LINES or at_knots <= least:
            continue
        last = min(last + int(lines[start + count + 1]) + 1, len(bends) - 1) if others else last
        part = CurvatureEvenness(
            float(np.median(bends[bends <= _STRAIGHT_ROUNDINGS * resolution])) / at_knots,
            int(inner[start]) + 1,
            (int(rows[first]), int(rows[last])),
        )
        if best is None or best.rows is None or last - first > best.rows[1] - best.rows[0]:
            best = part
    return best


def _median_ranks(count: int) -> list[int]:
    """Return the ranks of the two of ``count`` sorted numbers whose mean is the median."""
    return [(count - 1) // 2, count // 2]


def _mean_of_two(pair: Float64) -> float:
    return float(pair[0] + pair[1]) / 2
