"""Where depth steps from one surface to a nearer one: edges that a picture from the same place shows as well."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.edge_kernels import find_steps
from fedora_qa.estimators.depth.inverse_depth import SINGLE_PRECISION

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


def depth_steps(depth_m: NDArray[Any], axis: int, *, farthest_m: float, every: int = 1) -> DepthSteps:
    """Find the steps of depth (H, W), in metres, NaN where it is farther than ``farthest_m``.

    ``axis`` 0 is to the right, 1 is down; looked at is every so many-th line of pixels along it. Inverse depth is
    affine on a plane, so a step is what exceeds the gentler of the slopes on both sides. Where neighbouring steps
    compete the largest is taken. What is farther may be missing or stand at ``farthest_m``: a surface that runs out of
    range there by its own slope has no outline.
    """
    depth = np.asarray(depth_m)
    if depth.shape[1 - axis] < 4:
        return _nowhere()
    rows, columns = find_steps(depth, axis == 1, every, farthest_m, SINGLE_PRECISION, LEAST_STEP)
    first, second = (_inverse(depth[rows + i * axis, columns + i * (1 - axis)], farthest_m) for i in (0, 1))
    return DepthSteps(
        columns + 0.5 * (1 - axis), rows + 0.5 * axis, 1.0 / np.maximum(first, second), np.asarray(first > second)
    )


def _inverse(depth_m: NDArray[Any], farthest_m: float) -> Float64:
    depth = depth_m.astype(np.float64)
    known = (depth > 0) & (depth < farthest_m * (1 - SINGLE_PRECISION))
    return np.asarray(np.divide(1.0, depth, out=np.full(depth.shape, 1.0 / farthest_m), where=known))


def _nowhere() -> DepthSteps:
    return DepthSteps(np.empty(0), np.empty(0), np.empty(0), np.empty(0, dtype=np.bool_))
