"""Infer the step in which values are stored from the values; for depth also the step of its inverse.

Values that were rounded lie on a grid: multiples of a decimal or binary number, or numbers with a short mantissa.
Values that were not rounded lie near such a grid by chance only. A grid is accepted where chance would put as many
values on it with a probability below ``CHANCE``. Chance is at least one half: of values on a grid of half the step,
every second one lies on this grid too. Of all accepted grids the coarsest is meant, as its values lie on finer ones by
necessity.

Depths may be stored in steps of z or of 1/z (a z-buffer, a disparity). Their values alone do not identify the step: the
inverse depths of a plane are as regular as a grid. Second differences identify it. They are 0 on a plane, vary on a
curved surface, and are whole multiples of one step where depths were rounded.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import frexp
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import FINEST_RELATIVE_STEP
from fedora_qa.sequence.stored_step import (
    DOUBLE_ROUNDOFF,
    HALF_ROUNDOFF,
    SINGLE_ROUNDOFF,
    StoredStep,
    coarsest,
    of_components,
)

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

CHANCE: Final = 1e-6
"""Probability that values that were not rounded to a grid are taken to lie on it."""

_LEAST_SHARE: Final = 0.9
"""Least share (0 to 1) of the values on a grid. A fault of a part of the values leaves the others on it."""

_ROUNDED_UNITS: Final = 4.0
"""Units in the last place by which a multiple of a step may be off: by a product, a conversion of units, and the
stored number."""

_FIRST_VALUES: Final = 64
"""Number of values that are tested first: they mostly suffice to exclude a grid."""

FEWEST_VALUES: Final = 27
"""Least number of values that can show a grid: ``2^-n`` times the number of candidates lies below ``CHANCE``."""

_MOST_STEPS: Final = 8.5
"""Largest distance of neighbouring values, in steps, that is used for a grid of unknown step: further ones multiply the
error of the step."""

_MULTIPLES: Final = (1, 2, 3, 4)
"""Numbers of steps that the least distances of neighbouring values may have."""

_LEAST_DISTANCES: Final = 0.05
"""Quantile of the distances of neighbouring values that is taken for the least one: values off the grid lie below."""

# From 1000 to 1e-12, and from 64 to 2^-40, the coarsest first.
_DECIMALS: Final = tuple(digit * 10.0**power for power in range(3, -13, -1) for digit in (5.0, 2.0, 1.0))
_BINARIES: Final = tuple(2.0**power for power in range(6, -41, -1))
_STEPS: Final = np.array(sorted((*_DECIMALS, *_BINARIES), reverse=True))
"""Steps that are tried, in the unit of the values."""

_EDGE: Final = 0.05
"""Largest second difference that is used, as a share of the value. Larger ones are edges, or belong to steps that are
too coarse to use."""

# Most pixels of a frame that are used, and least number of significant second differences.
_MOST_PIXELS: Final = 40_000
_FEWEST_STEPS: Final = 30
_LEAST_BENT_SHARE: Final = 0.01
"""Least share (0 to 1) of second differences that are significant. A rarer step affects as few pixels."""

_BOTH_WAYS: Final = 0.2
"""Least share (0 to 1) of second differences of each sign. Where values were rounded, each sign has half of them."""

_SMALL: Final = 6.5
"""Largest second difference that is used, in steps. Larger ones multiply the error of the step."""

_PHASE: Final = 0.15
"""Largest distance from a whole multiple, in steps, that rounding to float32 causes. By chance 3 of 10 values are so
near, and 30 of 30 values in one of 1e16 trials."""


def stored_step(values: NDArray[np.floating], *, with_unknown_steps: bool = False) -> StoredStep:
    """Infer the step of values, of each component alone.

    Parameters
    ----------
    values
        (n,) or (n, k) values of k components; those that are not finite are left out.
    with_unknown_steps
        Whether any number may be the step, such as the full scale of a sensor over 2^15. A flow that is linear in the
        coordinates has equal distances as well, so this is for samples of a motion only.

    Returns
    -------
    StoredStep
        The coarsest, with those of the components. ``size`` is 0 where the values lie on no grid of equal steps, or
        are too few to show one, which is then not identifiable; components of too few values have the coarsest step of
        the others.
    """
    if not values.size:
        return StoredStep(is_identifiable=False)
    components = values.reshape(len(values), -1).T
    steps = [_component_step(component, with_unknown_steps) for component in components]
    # A constant component shows no step; as far as can be known it is stored like the others.
    common = coarsest(steps)
    few = [len(np.unique(component[np.isfinite(component)])) < FEWEST_VALUES for component in components]
    return of_components([common if is_few else step for is_few, step in zip(few, steps, strict=True)])


def level_step(values: NDArray[np.floating]) -> float:
    """Infer the step of samples that hardly change: of few levels, at each of which many samples lie.

    Numbers that were not rounded repeat where they do not change at all. So nine of ten samples repeat another one, and
    either the distances of all levels are multiples of one step beyond chance, or the samples return to levels that
    they left, which numbers at random do with a probability of one half at most.

    Parameters
    ----------
    values
        (n,) finite samples in the order of time.

    Returns
    -------
    float
        In the unit of the values; 0 where there is no such step.
    """
    levels = np.unique(values.astype(np.float64))
    if len(levels) < 2 or not _is_beyond_chance(len(values) - len(levels), len(values), 0.5, len(_MULTIPLES)):
        return 0.0
    slack = 2 * _ROUNDED_UNITS * 2 * DOUBLE_ROUNDOFF * float(np.abs(levels).max())
    if np.array_equal(levels.astype(np.float32), levels):
        slack *= SINGLE_ROUNDOFF / DOUBLE_ROUNDOFF
    distances = np.diff(levels)
    # Runs of equal samples less the levels: so many of them return.
    returns = 1 + int(np.count_nonzero(np.diff(values))) - len(levels)
    for multiple in _MULTIPLES:
        size = float(distances.min()) / multiple
        if np.all(np.abs(distances - size * np.rint(distances / size)) <= slack * np.rint(distances / size)):
            # The least distance is a multiple by definition; any other one is, with this probability.
            chance = min(1.0, 2.5 * slack / size) ** (len(distances) - 1) * len(_MULTIPLES)
            return size if min(chance, 0.5**returns * len(_MULTIPLES)) < CHANCE else 0.0
    return 0.0


def _component_step(values: NDArray[np.floating], with_unknown_steps: bool) -> StoredStep:
    # Repeated values are one observation; zeros lie on every grid.
    distinct = np.unique(values[np.isfinite(values) & (values != 0)].astype(np.float64))
    roundoff = DOUBLE_ROUNDOFF
    with np.errstate(over="ignore"):
        for kind, candidate in ((np.float16, HALF_ROUNDOFF), (np.float32, SINGLE_ROUNDOFF)):
            # Of numbers of a longer mantissa, 2^-13 of float32 numbers at most lie on the shorter one.
            if _is_beyond_chance(int(np.count_nonzero(distinct.astype(kind) == distinct)), len(distinct), 0.5, 2):
                roundoff = candidate
                break
    # Numbers of whichever value lie a unit in the last place, 2 u |value| at most, apart.
    units = 2 * roundoff * np.abs(distinct)
    size = _coarsest_grid(distinct, units)
    if roundoff == HALF_ROUNDOFF:
        # Multiples of 1/128 below 8 are float16 numbers: they lie on that grid to the digits of a longer mantissa, and
        # most of them on a coarser one than float16 has there.
        exact = _coarsest_grid(distinct, units * SINGLE_ROUNDOFF / HALF_ROUNDOFF)
        size = exact if exact > np.median(units) else size
    # Three eighths are multiples of one eighth too. A known step is exact where an unknown one is an estimate of it.
    unknown = next(_unknown_steps(distinct, units), 0.0) if with_unknown_steps else 0.0
    typical = float(np.median(np.abs(distinct))) if len(distinct) else 0.0
    size = unknown if unknown > 1.5 * size else size
    return StoredStep(size, roundoff, typical=typical, is_identifiable=size > 0 or len(distinct) >= FEWEST_VALUES)


def _coarsest_grid(values: Float64, units: Float64) -> float:
    """Return the coarsest step of which values (n,) with a unit in the last place (n,) are multiples; 0 for none."""
    # Some values exclude most grids, all at once; the others are tested with all values.
    some = slice(None, None, max(1, len(values) // _FIRST_VALUES))
    off = np.abs(values[some] - _STEPS[:, None] * np.rint(values[some] / _STEPS[:, None]))
    hopeful = np.count_nonzero(off <= _ROUNDED_UNITS * units[some], axis=1) >= 0.5 * off.shape[1]
    return next((float(size) for size in _STEPS[hopeful] if _lies_on_grid(values, units, size)), 0.0)


def _lies_on_grid(values: Float64, units: Float64, size: float) -> bool:
    """Whether values (n,) with a unit in the last place (n,) are multiples of a step."""
    off = np.abs(values - size * np.rint(values / size))
    on = int(np.count_nonzero(off <= _ROUNDED_UNITS * units))
    # Of numbers a unit apart, those within the slack on both sides and the middle one are taken for multiples.
    chance = float(np.mean(np.minimum(1.0, (2 * _ROUNDED_UNITS + 1) * units / size))) if len(values) else 1.0
    return _is_beyond_chance(on, len(values), chance, len(_STEPS))


def _unknown_steps(values: Float64, units: Float64) -> Iterator[float]:
    """Yield the steps of which the distances of neighbouring values (n,) are multiples, the largest first."""
    slack = 2 * _ROUNDED_UNITS * float(units.max(initial=0.0))
    distances = np.diff(values)
    distances = distances[distances > slack]
    if not len(distances):
        return
    least = float(np.quantile(distances, _LEAST_DISTANCES, method="lower"))
    for multiple in _MULTIPLES:
        size = least / multiple
        near = distances[distances <= _MOST_STEPS * size]
        # Each distance over its number of steps estimates the step.
        size = float(np.median(near / np.maximum(np.rint(near / size), 1.0)))
        on = int(np.count_nonzero(np.abs(near - size * np.rint(near / size)) <= slack))
        if _is_beyond_chance(on, len(near), min(1.0, 2.5 * slack / size), len(_MULTIPLES)):
            yield size


def _is_beyond_chance(on: int, count: int, chance: float, candidates: int) -> bool:
    """Whether a grid holds more values than values at random do, for any of several grids.

    ``P(share >= f) <= exp(-n KL(f || p))`` for n independent values that lie on it with a mean probability p (W.
    Hoeffding, J. Am. Stat. Assoc. 58 (1963) 13, theorem 1).
    """
    share, chance = on / max(count, 1), max(chance, 0.5)
    if share < _LEAST_SHARE or share <= chance:
        return False
    missing = 1 - share
    divergence = share * np.log(share / chance) + (missing * np.log(missing / (1 - chance)) if missing else 0.0)
    return bool(count * divergence > np.log(candidates / CHANCE))


@dataclass(frozen=True, slots=True)
class DepthStep:
    """The coarsest step of a frame.

    Attributes
    ----------
    relative
        The step as a share of the depth, 0 to 1.
    depth_m
        The depth at which the step is this share, m.
    of_inverse
        Whether the inverses of the depths have equal steps.
    """

    relative: float
    depth_m: float
    of_inverse: bool = False

    @property
    def size_m(self) -> float:
        """The step, m."""
        return self.relative * self.depth_m

    @property
    def grid(self) -> StoredStep:
        """The grid of the depths, in m, or of their inverses."""
        # d(1/z) = dz / z^2
        return StoredStep(inverse=self.relative / self.depth_m) if self.of_inverse else StoredStep(self.size_m)


@dataclass(frozen=True, slots=True)
class _CommonStep:
    """A step that second differences have in common.

    Attributes
    ----------
    size
        The step, in the unit of the values.
    misfit
        Mean distance of the second differences from whole multiples of the step, in steps.
    """

    size: float
    misfit: float


def depth_step(depths_m: NDArray[np.floating]) -> DepthStep | None:
    """Estimate the coarsest step in which a frame's depths were stored.

    Octaves of depth are fitted separately, so that the step can grow with the depth.

    Parameters
    ----------
    depths_m
        (H, W) z-depth, m; NaN or not positive where invalid.

    Returns
    -------
    DepthStep | None
        None where depths are as fine as float32, or too few second differences have a common step.
    """
    height, width = depths_m.shape
    rows = max(3, _MOST_PIXELS // max(width, 1))
    first = max(0, (height - rows) // 2)
    z = depths_m[first : first + rows].astype(np.float64)
    z = np.where(np.isfinite(z) & (z > 0), z, np.nan)
    best: dict[int, tuple[float, DepthStep]] = {}

    def keep(octave: int, misfit: float, step: DepthStep) -> None:
        # Over a short range of depth, steps of z resemble steps of 1/z: the better fit is kept.
        if octave not in best or misfit < best[octave][0]:
            best[octave] = misfit, step

    # A step s of z is the largest share of the depth at the near end, s / z; a step of 1/z at the far end, s z.
    for octave, common, octave_m in _steps(z, z):
        nearest_m = float(octave_m.min())
        keep(octave, common.misfit, DepthStep(common.size / nearest_m, nearest_m))
    for octave, common, octave_m in _steps(1.0 / z, z):
        farthest_m = float(octave_m.max())
        keep(octave, common.misfit, DepthStep(common.size * farthest_m, farthest_m, of_inverse=True))
    return max((step for _, step in best.values()), key=lambda step: step.relative, default=None)


def _steps(values: Float64, z: Float64) -> Iterator[tuple[int, _CommonStep, Float64]]:
    """Yield the octaves of depth in which values (h, w) have a step: number, step, and depths of the octave, m."""
    bends, middles, depths_m, octaves = _second_differences(values, z, _EDGE)
    counts, limits, significant = _significant_bends(bends, middles, octaves, FINEST_RELATIVE_STEP)
    if not len(significant):
        return
    lowest, significant_bends, significant_octaves = int(octaves.min()), bends[significant], octaves[significant]
    significant_counts = np.bincount(significant_octaves - lowest, minlength=len(counts))
    for i in np.flatnonzero(significant_counts >= np.maximum(_FEWEST_STEPS, _LEAST_BENT_SHARE * counts)).tolist():
        if common := _common_step(significant_bends[significant_octaves == lowest + i], float(limits[i])):
            yield lowest + i, common, depths_m[octaves == lowest + i]


def _common_step(bends: Float64, finest: float) -> _CommonStep | None:
    """Return the step of which all second differences (n,) are multiples; None where no step of ``finest`` or more is.

    Rounding gives second differences of both signs; those of a sphere have one sign and are almost equal.
    """
    sizes = np.abs(bends)
    if not _of_both_signs(bends):
        return None
    least = float(np.quantile(sizes, 0.01))
    # The least second difference is one step or two steps.
    for multiple in (1, 2):
        step = least / multiple
        small = sizes <= _SMALL * step
        small_sizes = sizes[small]
        if step < finest or len(small_sizes) < _FEWEST_STEPS or not _of_both_signs(bends[small]):
            return None
        # step = median(|d| / round(|d| / step)): each difference over its number of steps estimates the step.
        step = float(np.median(small_sizes / np.maximum(np.rint(small_sizes / step), 1.0)))
        misfits = np.abs(small_sizes / step - np.rint(small_sizes / step))
        if np.mean(misfits < _PHASE) > 1.0 - _LEAST_BENT_SHARE:
            return _CommonStep(step, float(np.mean(misfits)))
    return None


def _of_both_signs(bends: Float64) -> bool:
    positive = np.count_nonzero(bends > 0)
    return bool(min(positive, len(bends) - positive) >= _BOTH_WAYS * len(bends))


@njit(cache=True)
def _second_differences(values: Float64, depths_m: Float64, edge: float) -> tuple[Float64, Float64, Float64, Int64]:
    """Return second differences along rows and columns (n,), with values, depths and octaves (n,) at their middles.

    Parameters
    ----------
    values, depths_m
        (h, w) values, and depths in m; NaN where invalid. Octave k of depths begins at 2^k m.
    edge
        Second differences of more than this share of the value are left out.

    Returns
    -------
    bends, middles, middle_depths_m
        (n,) second differences and middle values, in the unit of the values, and depths, m.
    octaves
        (n,) numbers of the octaves.
    """
    height, width = values.shape
    bends, middles, middle_depths_m = np.empty((3, 2 * height * width))
    octaves, n = np.empty(2 * height * width, np.int64), 0
    octave, least_m, most_m = 0, 1.0, 2.0  # of the depth before: the next depth usually lies in the same octave
    for axis in range(2):
        below, right = (1, 0) if axis else (0, 1)
        for row in range(below, height - below):
            for column in range(right, width - right):
                middle = values[row, column]
                bend = values[row + below, column + right] - 2 * middle + values[row - below, column - right]
                if abs(bend) < edge * middle:  # False for NaN
                    bends[n], middles[n], middle_depths_m[n] = bend, middle, depths_m[row, column]
                    if not least_m <= middle_depths_m[n] < most_m:
                        octave = frexp(middle_depths_m[n])[1] - 1
                        least_m, most_m = 2.0**octave, 2.0 ** (octave + 1)
                    octaves[n] = octave
                    n += 1
    return bends[:n], middles[:n], middle_depths_m[:n], octaves[:n]


@njit(cache=True)
def _significant_bends(bends: Float64, middles: Float64, octaves: Int64, finest: float) -> tuple[Int64, Float64, Int64]:
    """Count second differences (n,) by octave, and find those that exceed the rounding of float32.

    Neighbours usually lie in one octave, so that successive values of one octave are processed together.

    Parameters
    ----------
    bends, middles, octaves
        (n,) second differences, values at their middles, and octaves.
    finest
        A second difference is significant where it exceeds this share of the largest value of its octave.

    Returns
    -------
    counts
        (k,) second differences of each octave, from the lowest octave on.
    limits
        (k,) least significant second difference of each octave, in the unit of the values.
    significant
        (m,) indices of the significant second differences.
    """
    if not len(octaves):
        return np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64)
    lowest = octaves.min()
    size = octaves.max() - lowest + 1
    counts, limits, stop = np.zeros(size, np.int64), np.zeros(size), 0
    while stop < len(octaves):
        start, octave, largest = stop, octaves[stop], 0.0
        while stop < len(octaves) and octaves[stop] == octave:
            largest = max(largest, middles[stop])
            stop += 1
        counts[octave - lowest] += stop - start
        limits[octave - lowest] = max(limits[octave - lowest], finest * largest)
    significant, m, i = np.empty(len(octaves), np.int64), 0, 0
    while i < len(octaves):
        octave = octaves[i]
        limit = limits[octave - lowest]
        while i < len(octaves) and octaves[i] == octave:
            significant[m] = i
            m += abs(bends[i]) > limit
            i += 1
    return counts, limits, significant[:m]
