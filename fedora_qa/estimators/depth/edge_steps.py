"""Steps of depth from one surface to a nearer one. An image from the same place has edges there as well."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import SINGLE_PRECISION

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

LEAST_STEP: Final = 0.1
"""Least step of inverse depth, relative to that of the nearer surface, after subtraction of the slope of the surface.

Surfaces that lie a tenth of their distance apart belong to two objects, or to two sides of one object. A smaller step
can be a fold of one surface.
"""

_TOO_SMALL: Final = 0.45
"""Share of the least step that a difference or a slope beside it must exceed. If both are below a half, they cannot
make a step together; 0.45 leaves room for rounding, and for the different nearer side of the neighbouring pair."""


@dataclass(frozen=True, slots=True)
class DepthSteps:
    """Steps of depth along one image axis.

    Attributes
    ----------
    columns, rows
        (n,) positions, px: along the axis halfway between two pixels, across the axis at a pixel centre.
    depths_m
        (n,) z-depth of the nearer surface, m. The step is the outline of this surface.
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
    """Find the steps of a depth frame along one axis.

    Inverse depth is affine on a plane. The size of a step is therefore the difference of the inverse depths of two
    neighbouring pixels, less the smaller of the slopes on both sides. Of neighbouring steps only the largest counts.
    Depths beyond the range can be missing or equal to its end: a surface that leaves the range by its own slope has no
    outline there.

    Parameters
    ----------
    depth_m
        (H, W) z-depth, m; NaN where it is farther than ``farthest_m``.
    axis
        Axis along which depth steps: 0 to the right, 1 down.
    farthest_m
        End of the range of depth, m.
    every
        Distance of the lines of pixels that are searched, px.

    Returns
    -------
    DepthSteps
        Empty where the frame is shorter than four pixels along the axis.
    """
    depth = np.asarray(depth_m)
    if depth.shape[1 - axis] < 4:
        return DepthSteps(np.empty(0), np.empty(0), np.empty(0), np.empty(0, dtype=np.bool_))
    rows, columns = _find_steps(depth, axis == 1, every, farthest_m, SINGLE_PRECISION, LEAST_STEP)
    inverse_per_m = []
    for i in (0, 1):
        beside_m = depth[rows + i * axis, columns + i * (1 - axis)].astype(np.float64)
        valid = (beside_m > 0) & (beside_m < farthest_m * (1 - SINGLE_PRECISION))
        # Invalid depths count as the end of the range.
        inverse_per_m.append(np.divide(1.0, beside_m, out=np.full(beside_m.shape, 1.0 / farthest_m), where=valid))
    first_per_m, second_per_m = inverse_per_m
    return DepthSteps(
        columns + 0.5 * (1 - axis),
        rows + 0.5 * axis,
        1.0 / np.maximum(first_per_m, second_per_m),
        np.asarray(first_per_m > second_per_m),
    )


@njit(cache=True)
def _find_steps(
    depth_m: NDArray[Any], down: bool, every: int, farthest_m: float, rounding: float, least: float
) -> Int64:
    """Return rows and columns (2, n) of the pixels after which inverse depth steps to the right, or down.

    A step is larger than the share ``least`` of the inverse depth of its nearer side, after subtraction of the slope
    beside it, and larger than the neighbouring steps. Depths (H, W) are valid where they are below ``farthest_m`` by
    more than the share ``rounding``. Every ``every``-th line of pixels along the axis is searched.
    """
    height, width = depth_m.shape
    nearer_m, far_m, share = farthest_m * (1.0 - rounding), np.float32(farthest_m), np.float32(_TOO_SMALL * least)
    stride = every if down else 1  # between the columns that are searched
    line_length = (width + stride - 1) // stride
    line_m, next_m = np.empty(line_length, np.float32), np.empty(line_length, np.float32)
    large = np.zeros((3, line_length), np.bool_)
    positions, count = np.empty((2, 1024), np.int64), 0
    _fill_line(depth_m[0], stride, far_m, next_m)
    for line in range(0, height, 1 if down else every):
        if not down:
            _fill_line(depth_m[line], stride, far_m, line_m)
        else:
            line_m, next_m = next_m, line_m
            if line + 1 < height:
                _fill_line(depth_m[line + 1], stride, far_m, next_m)
        # A fast test in single precision selects few pixels for the exact test: the difference at the pixel or at one
        # of its two neighbours along the axis is large. For steps down, these neighbours lie in the lines around.
        if down:
            _write_large(line_m, next_m, share, large[line % 3])
            if line + 1 == height:
                large[line % 3] = False
            row, around = line - 1, (large[(line - 2) % 3], large[(line - 1) % 3], large[line % 3])
        else:
            _write_large(line_m[:-1], line_m[1:], share, large[0][1:])
            row, around = line, (large[0], large[0][1:], large[0][2:])
        for i in range(0 if down else 1, line_length if down else width - 2):
            if not (around[0][i] | around[1][i] | around[2][i]):
                continue
            column = i * stride
            size = _step_size(depth_m, row, column, down, farthest_m, nearer_m)
            if not size > least:
                continue
            before = _step_size(depth_m, row - down, column - (not down), down, farthest_m, nearer_m)
            after = _step_size(depth_m, row + down, column + (not down), down, farthest_m, nearer_m)
            if size >= before and size > after:
                if count == positions.shape[1]:
                    positions = np.concatenate((positions, np.empty_like(positions)), axis=1)
                positions[0, count], positions[1, count] = row, column
                count += 1
    return positions[:, :count]


@njit(cache=True)
def _fill_line(depth_m: NDArray[Any], stride: int, far_m: np.float32, filled_m: Float32) -> None:
    """Write every ``stride``-th depth of a row (W,), m, and ``far_m`` where it is not valid."""
    for i in range(len(filled_m)):
        depth = np.float32(depth_m[i * stride])
        filled_m[i] = depth if (depth > 0) & (depth < far_m) else far_m


@njit(cache=True)
def _write_large(first_m: Float32, second_m: Float32, share: np.float32, large: NDArray[np.bool_]) -> None:
    """Write whether inverse depths differ by more than a share of the larger one."""
    # For a < b: (1/a - 1/b) / (1/a) = (b - a) / b.
    for i in range(len(first_m)):
        a, b = first_m[i], second_m[i]
        large[i] = abs(b - a) > share * max(a, b)


@njit(cache=True)
def _inverse_depth(
    depth_m: NDArray[Any], row: int, column: int, farthest_m: float, nearer_m: float
) -> tuple[float, bool]:
    """Return the inverse depth of a pixel, 1/m, and whether it is valid; that of ``farthest_m`` where it is not."""
    depth = np.float64(depth_m[row, column])
    valid = bool((depth > 0.0) & (depth < nearer_m))
    return 1.0 / depth if valid else 1.0 / farthest_m, valid


@njit(cache=True)
def _step_size(depth_m: NDArray[Any], row: int, column: int, down: bool, farthest_m: float, nearer_m: float) -> float:
    """Return the step of inverse depth from a pixel to the next, less the slope of the surface beside it.

    The step is relative to the inverse depth of the nearer of the two pixels; it is 0 at the border.
    """
    index, size = (row, depth_m.shape[0]) if down else (column, depth_m.shape[1])
    if not 0 < index < size - 2:
        return 0.0
    by_row, by_column = (1, 0) if down else (0, 1)
    # Inverse depths of four pixels in a row: the step lies between b and c.
    a, valid_a = _inverse_depth(depth_m, row - by_row, column - by_column, farthest_m, nearer_m)
    b, valid_b = _inverse_depth(depth_m, row, column, farthest_m, nearer_m)
    c, valid_c = _inverse_depth(depth_m, row + by_row, column + by_column, farthest_m, nearer_m)
    d, valid_d = _inverse_depth(depth_m, row + 2 * by_row, column + 2 * by_column, farthest_m, nearer_m)
    between = c - b
    slope_before = b - a if valid_a & valid_b else np.inf
    slope_after = d - c if valid_c & valid_d else np.inf
    gentler = slope_before if abs(slope_before) < abs(slope_after) else slope_after
    if abs(gentler) == np.inf:
        gentler = 0.0
    if not valid_b & valid_c:
        # Out of range the inverse depth is constant: only the part of a slope that lies within the range counts.
        gentler = min(max(gentler, min(between, 0.0)), max(between, 0.0))
    # step = |(c - b) - slope| / max(b, c)
    return abs(between - gentler) / max(b, c)
