"""The steps in which depths were stored: of z (16-bit millimetres), of 1/z (a z-buffer, a disparity), or of a float.

The values alone do not show a step: the inverse depths of a plane are as regular as a grid. Second differences do: they
vanish on a plane, vary on a curved surface, and are whole multiples of one step where depths were rounded.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import frexp
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import FINEST_RELATIVE_STEP

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

_EDGE: Final = 0.05
"""Second differences of more than this share of the value are edges, or the border of steps too coarse to use."""

_MOST_PIXELS: Final = 40_000
_FEWEST_STEPS: Final = 30
_LEAST_SHARE: Final = 0.01
"""Second differences that must be nonzero: a step that shows more rarely is met by as few pixels."""

_BOTH_WAYS: Final = 0.2
"""Share of the second differences that must have either sign: half of them have where values were rounded."""

_SMALL: Final = 6.5
"""Second differences of up to so many steps are used: larger ones magnify the error of the step itself."""

_PHASE: Final = 0.15
"""Departure from a whole multiple that rounding to float32 may add. By chance three in ten values come so near, and
thirty do so once in 1e16 trials."""


@dataclass(frozen=True, slots=True)
class DepthStep:
    """The coarsest step of a frame: as a share of the depth, and at which depth, in metres."""

    relative: float
    depth_m: float

    @property
    def size_m(self) -> float:
        """The step in metres."""
        return self.relative * self.depth_m


@dataclass(frozen=True, slots=True)
class _CommonStep:
    """A step, in the unit of the values, and the mean distance of second differences from its multiples, in steps."""

    size: float
    misfit: float


def depth_step(depths_m: NDArray[np.floating]) -> DepthStep | None:
    """Estimate the coarsest step in which a frame's depths were stored.

    Parameters
    ----------
    depths_m
        (H, W) m, NaN or not positive where invalid.

    Returns
    -------
    DepthStep | None
        None where depths are as fine as float32, or too few second differences show a step. Octaves of depth are
        fitted one by one, so that a step may grow with the depth.
    """
    height, width = depths_m.shape
    rows = max(3, _MOST_PIXELS // max(width, 1))
    first = max(0, (height - rows) // 2)
    z = depths_m[first : first + rows].astype(np.float64)
    z = np.where(np.isfinite(z) & (z > 0), z, np.nan)
    best: dict[int, tuple[float, DepthStep]] = {}

    def keep(octave: int, misfit: float, step: DepthStep) -> None:
        # Over a short range of depth, steps of z pass for steps of 1/z: the better fit is meant.
        if octave not in best or misfit < best[octave][0]:
            best[octave] = misfit, step

    # A step of z is the largest share of the depth at the near end, one of 1/z at the far end.
    for octave, common, octave_m in _steps(z, z):
        nearest_m = float(octave_m.min())
        keep(octave, common.misfit, DepthStep(common.size / nearest_m, nearest_m))
    for octave, common, octave_m in _steps(1.0 / z, z):
        farthest_m = float(octave_m.max())
        keep(octave, common.misfit, DepthStep(common.size * farthest_m, farthest_m))
    return max((step for _, step in best.values()), key=lambda step: step.relative, default=None)


def _steps(values: Float64, z: Float64) -> Iterator[tuple[int, _CommonStep, Float64]]:
    """Yield each octave of depth with a step of values (h, w): the step, and the octave's depths in metres."""
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
    """Return the step of which all second differences are multiples; None where there is none as large as the finest.

    Steps bend both ways, while the second differences of a ball are of one sign and almost equal.
    """
    sizes = np.abs(bends)
    if not _of_both_signs(bends):
        return None
    least = float(np.quantile(sizes, 0.01))
    # The least second difference may be one step or two.
    for multiple in (1, 2):
        step = least / multiple
        small = sizes <= _SMALL * step
        small_sizes = sizes[small]
        if step < finest or len(small_sizes) < _FEWEST_STEPS or not _of_both_signs(bends[small]):
            return None
        # A difference over its whole number of steps estimates the step; the median resists outliers.
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
    """Return second differences along rows and columns; values, depths and octaves of depth at their middles.

    Parameters
    ----------
    values, depths_m
        (h, w), NaN where invalid. Octave k of depths begins at 2^k.
    edge
        Second differences of more than this share of the value are left out.
    """
    height, width = values.shape
    bends, middles, middle_depths_m = np.empty((3, 2 * height * width))
    octaves, n = np.empty(2 * height * width, np.int64), 0
    octave, least_m, most_m = 0, 1.0, 2.0  # of the depth before, which is that of the next one as a rule
    for axis in range(2):
        below, right = (1, 0) if axis else (0, 1)
        for row in range(below, height - below):
            for column in range(right, width - right):
                middle = values[row, column]
                bend = values[row + below, column + right] - 2 * middle + values[row - below, column - right]
                if abs(bend) < edge * middle:  # False where NaN
                    bends[n], middles[n], middle_depths_m[n] = bend, middle, depths_m[row, column]
                    if not least_m <= middle_depths_m[n] < most_m:
                        octave = frexp(middle_depths_m[n])[1] - 1
                        least_m, most_m = 2.0**octave, 2.0 ** (octave + 1)
                    octaves[n] = octave
                    n += 1
    return bends[:n], middles[:n], middle_depths_m[:n], octaves[:n]


@njit(cache=True)
def _significant_bends(bends: Float64, middles: Float64, octaves: Int64, finest: float) -> tuple[Int64, Float64, Int64]:
    """Count second differences by octave, from the lowest on, (k,), and find those (m,) that exceed float32's rounding.

    They do where they are larger than a share ``finest`` of the octave's largest value: these limits (k,) come second.
    Neighbours lie in one octave as a rule, so that runs of one octave are gone through at once.
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
