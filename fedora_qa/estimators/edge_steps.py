"""Where depth steps from one surface to a nearer one: edges that a picture from the same place shows as well."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth_image import SINGLE_PRECISION

Float64 = NDArray[np.float64]

LEAST_STEP: Final = 0.1
"""Least step of inverse depth, relative to the nearer surface, beyond what the slope of a surface makes of it.

Surfaces a tenth of their distance apart are two things, or two sides of one: less may be a fold of one surface.
"""


@dataclass(frozen=True, slots=True)
class DepthSteps:
    """Steps of depth along one image axis.

    Attributes
    ----------
    columns, rows
        (n,) px: along the axis halfway between the two pixels, across it a pixel centre.
    depths_m
        (n,) of the nearer surface, whose outline it is.
    near_first
        (n,) True where the nearer surface lies on the left (above).
    """

    columns: Float64
    rows: Float64
    depths_m: Float64
    near_first: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.columns)


def depth_steps(depth_m: NDArray[Any], axis: int, *, farthest_m: float) -> DepthSteps:
    """Find the steps of depth (H, W), in metres, NaN where it is farther than ``farthest_m``.

    ``axis`` 0 is to the right, 1 is down. Inverse depth is affine on a plane, so a step is what exceeds the gentler of
    the slopes on both sides. Where neighbouring steps compete the largest is taken. What is farther may be missing or
    stand at ``farthest_m``: a surface that runs out of range there by its own slope has no outline.
    """
    depth = np.asarray(depth_m, dtype=np.float64)
    known = np.isfinite(depth) & (depth > 0) & (depth < farthest_m * (1 - SINGLE_PRECISION))
    inverse = np.divide(1.0, depth, out=np.full(depth.shape, 1.0 / farthest_m), where=known)
    along, seen = (inverse, known) if axis == 0 else (inverse.T, known.T)
    if along.shape[1] < 4:
        return _nowhere()
    relative = _relative_steps(along, seen)
    is_step = relative > LEAST_STEP
    is_step[:, 1:] &= relative[:, 1:] >= relative[:, :-1]
    is_step[:, :-1] &= relative[:, :-1] > relative[:, 1:]
    lines, before = np.nonzero(is_step)
    first, second = along[lines, before], along[lines, before + 1]
    places, across = before.astype(np.float64) + 0.5, lines.astype(np.float64)
    columns, rows = (places, across) if axis == 0 else (across, places)
    return DepthSteps(columns, rows, 1.0 / np.maximum(first, second), first > second)


def _relative_steps(inverse: Float64, known: NDArray[np.bool_]) -> Float64:
    """Return the step between each two pixels of a line, (lines, n - 1), less the slope of the surface beside it."""
    slopes = np.diff(inverse, axis=1)
    of_surfaces = np.where(known[:, 1:] & known[:, :-1], slopes, np.inf)
    left, right, between = of_surfaces[:, :-2], of_surfaces[:, 2:], slopes[:, 1:-1]
    gentler = np.where(np.abs(left) < np.abs(right), left, right)
    gentler[np.isinf(gentler)] = 0.0
    ends = np.isinf(of_surfaces[:, 1:-1])
    # Out of range inverse depth stays where it is: of a slope towards it, no more than the way there was to be seen.
    gentler[ends] = np.clip(gentler, np.minimum(between, 0.0), np.maximum(between, 0.0))[ends]
    steps: Float64 = np.zeros_like(slopes)
    steps[:, 1:-1] = np.abs(between - gentler)
    steps /= np.maximum(inverse[:, 1:], inverse[:, :-1])
    return steps


def _nowhere() -> DepthSteps:
    return DepthSteps(np.empty(0), np.empty(0), np.empty(0), np.empty(0, dtype=np.bool_))
