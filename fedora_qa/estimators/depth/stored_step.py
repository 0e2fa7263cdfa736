"""The steps in which depths were stored where these are not known beforehand: of 1/z (a z-buffer, a disparity), or z.

Values alone do not identify a step: the inverse depths of a plane are as regular as a grid. Second differences identify
it. They are 0 on a plane, vary on a curved surface, and are whole multiples of one step where depths were rounded.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import frexp
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import FINEST_RELATIVE_STEP
from fedora_qa.sequence.stored_step import StoredStep

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

_EDGE: Final = 0.05
"""Largest second difference that is used, as a share of the value. Larger ones are edges, or belong to steps that are
too coarse to use."""

# Most pixels of a frame that are used, and least number of significant second differences.
_MOST_PIXELS: Final = 40_000
_FEWEST_STEPS: Final = 30
_LEAST_SHARE: Final = 0.01
"""Least share (0 to 1) of second differences that are significant. A rarer step affects as few pixels."""

_BOTH_WAYS: Final = 0.2
"""Least share (0 to 1) of second differences of each sign. Where values were rounded, each sign has half of them."""

_SMALL: Final = 6.5
"""Largest second difference that is used, in steps. Larger ones multiply the error of the step."""

_PHASE: Final = 0.15
"""Largest distance from a whole multiple, in steps, that rounding to float32 causes. By chance 3 of 10 values are so
near, and 30 of 30 values in one of 1e16 trials."""


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
    for i in np.flatnonzero(significant_counts >= np.maximum(_FEWEST_STEPS, _LEAST_SHARE * counts)).tolist():
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
        if np.mean(misfits < _PHASE) > 1.0 - _LEAST_SHARE:
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
