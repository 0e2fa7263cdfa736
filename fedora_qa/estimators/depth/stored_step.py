"""The steps in which depths were stored: of z (16-bit millimetres), of 1/z (a z-buffer, a disparity), or of a float.

The values alone cannot tell: the inverse depths of a plane are as regular as a grid. Its second differences can, which
vanish on a plane, vary on a curved surface, and are whole multiples of one step where depths were rounded.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import FINEST_RELATIVE_STEP
from fedora_qa.estimators.depth.stored_step_kernels import bent_octaves, second_differences

Float64 = NDArray[np.float64]

_EDGE: Final = 0.05
"""Second differences of more than this share of the value are edges, or the border of steps too coarse to use."""

_MOST_PIXELS: Final = 40_000
_FEWEST_STEPS: Final = 30
_LEAST_SHARE: Final = 0.01
"""Second differences that must be nonzero: a step that shows more rarely is met by as few pixels."""

_BOTH_WAYS: Final = 0.2
"""Share of the second differences that must have either sign: half of them have where values were rounded."""

_SMALL: Final = 6.5
"""Second differences of up to so many steps are looked at: larger ones magnify the error of the step itself."""

_PHASE: Final = 0.15
"""Departure from a whole multiple that rounding to float32 may add. By chance three in ten values come so near, and
thirty do so once in 1e16 trials."""


@dataclass(frozen=True, slots=True)
class DepthStep:
    """The coarsest step found: as a share of the depth, and at which depth, in metres."""

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
    """Return the coarsest step of a frame (H, W); None where depths are as fine as float32, or too little tells.

    Octaves of depth are looked at one by one, so that a step may grow with the depth.
    """
    height, width = depths_m.shape
    rows = max(3, _MOST_PIXELS // max(width, 1))
    first = max(0, (height - rows) // 2)
    z = depths_m[first : first + rows].astype(np.float64)
    z = np.where(np.isfinite(z) & (z > 0), z, np.nan)
    found: dict[int, tuple[float, DepthStep]] = {}
    for octave, misfit, step in (*_steps_of_depth(z), *_steps_of_inverse_depth(z)):
        # Over a short range of depth, steps of z pass for steps of 1/z: the better fit is meant.
        if octave not in found or misfit < found[octave][0]:
            found[octave] = misfit, step
    return max((step for _, step in found.values()), key=lambda step: step.relative, default=None)


def _steps_of_depth(z: Float64) -> Iterator[tuple[int, float, DepthStep]]:
    """Yield each octave, misfit, and step where it is the largest share of the depth: at the near end."""
    for octave, misfit, step, depths_m in _steps(z, z):
        yield octave, misfit, DepthStep(step / float(depths_m.min()), float(depths_m.min()))


def _steps_of_inverse_depth(z: Float64) -> Iterator[tuple[int, float, DepthStep]]:
    """Yield each octave, misfit, and step where it is the largest share of the depth: at the far end."""
    for octave, misfit, step, depths_m in _steps(1.0 / z, z):
        yield octave, misfit, DepthStep(step * float(depths_m.max()), float(depths_m.max()))


def _steps(values: Float64, z: Float64) -> Iterator[tuple[int, float, float, Float64]]:
    """Yield each octave of depth with a step of values (h, w): misfit, step, and the octave's depths in metres."""
    bends, middles, depths_m, octaves = second_differences(values, z, _EDGE)
    counts, limits, telling = bent_octaves(bends, middles, octaves, FINEST_RELATIVE_STEP)
    if not len(telling):
        return
    lowest, bent, of_bent = int(octaves.min()), bends[telling], octaves[telling]
    many = np.bincount(of_bent - lowest, minlength=len(counts))
    for i in np.flatnonzero(many >= np.maximum(_FEWEST_STEPS, _LEAST_SHARE * counts)).tolist():
        if common := _common_step(bent[of_bent == lowest + i], float(limits[i])):
            yield lowest + i, common.misfit, common.size, depths_m[octaves == lowest + i]


def _common_step(bent: Float64, finest: float) -> _CommonStep | None:
    """Return the step of which all second differences are multiples; None where there is none as large as the finest.

    Steps bend both ways, while the second differences of a ball are of one sign and almost equal.
    """
    sizes = np.abs(bent)
    if not _go_both_ways(bent):
        return None
    least = float(np.quantile(sizes, 0.01))
    for parts in (1, 2):
        step = least / parts
        few = sizes <= _SMALL * step
        small = sizes[few]
        if step < finest or len(small) < _FEWEST_STEPS or not _go_both_ways(bent[few]):
            return None
        step = float(np.median(small / np.maximum(np.rint(small / step), 1.0)))
        misfits = np.abs(small / step - np.rint(small / step))
        if np.mean(misfits < _PHASE) > 1.0 - _LEAST_SHARE:
            return _CommonStep(step, float(np.mean(misfits)))
    return None


def _go_both_ways(bent: Float64) -> bool:
    upward = np.count_nonzero(bent > 0)
    return bool(min(upward, len(bent) - upward) >= _BOTH_WAYS * len(bent))
