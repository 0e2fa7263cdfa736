"""A depth frame prepared for reading between its pixels: inverse depth, error bounds, edges, and steps.

Inverse depth is affine in the pixel coordinates on every plane. Bilinear interpolation is therefore exact on a plane,
and second differences bound its error elsewhere.

The compiled loops process a frame once, row by row, in single precision. The difference of two inverse depths is
computed as the difference of the depths, which is exact, over their product. No digits cancel, so that the error of
second differences is a hundredth of that by the rounding of the depths. Depths (H, W) are in metres; they are not
positive, infinite or NaN where invalid.
"""

from dataclasses import dataclass, replace
from math import ceil, sqrt
from typing import Any, Final

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.flow.mask import EDGE

Depths = NDArray[np.floating[Any]]
Float32 = NDArray[np.float32]
Marks = NDArray[np.uint8]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

SINGLE_PRECISION: Final = 2.0**-24
"""Unit roundoff of float32."""

_ROUNDINGS: Final = 8
"""Number of roundings of a depth in single precision: some when it is computed, one when it is stored in millimetres,
one when it is read in metres."""

FINEST_RELATIVE_STEP: Final = 2 * _ROUNDINGS * SINGLE_PRECISION
"""Finest step of quantised depths that counts, as a share of the depth. Half of a finer step is below the bound on the
error by rounding."""

_OF_SECOND_DIFFERENCE: Final = 0.25
"""Bound on the error of a value that is read between pixels, as a share of the largest second difference nearby.

On a smooth surface the error of bilinear interpolation is an eighth of the second difference (Lagrange's remainder);
the rest allows for derivatives that vary. White noise of standard deviation sigma has second differences of 2.4 sigma
along each axis; the largest sum over both axes nearby is about 6 sigma. The bounds of two frames then add up to about
3 sigma, while the difference of the frames has a standard deviation of at most 1.4 sigma.
"""

_WIDENED_PX: Final = 9
"""Width of the square by which edges are widened, px: 4 px on each side, as in ``estimators/flow/mask.py``."""

_FEWEST_BLOCKS: Final = 180_000
"""Number of pixels beyond which distances from edges are measured by blocks of pixels; an image has fewer blocks.

At 1440x1080, blocks of 3 px need an eighth of the time of pixels. They shorten the distance by at most 6 px, usually by
3 px: the limit of ``depth.consistency`` in its worst tile is 1.7% larger than with blocks of 2 px, and would be 3.3%
larger with blocks of 4 px.
"""

LEAST_STEP: Final = 0.1
"""Least step of inverse depth, relative to that of the nearer surface, after subtraction of the slope of the surface.

Surfaces that lie a tenth of their distance apart belong to two objects, or to two sides of one object. A smaller step
can be a fold of one surface.
"""

_TOO_SMALL: Final = 0.45
"""Share of the least step that a difference or a slope beside it must exceed. If both are below a half, they cannot
make a step together; 0.45 leaves room for rounding, and for the different nearer side of the neighbouring pair."""


@dataclass(frozen=True, slots=True)
class DepthImage:
    """A depth frame with the errors and edges that reading between its pixels needs.

    Attributes
    ----------
    depths_m
        (H, W) z-depth, m; not positive, infinite or NaN where invalid.
    error_per_m
        (H, W) bound on the error of an inverse depth that is read near each pixel, 1/m, without the error by
        ``quantisation_error``.
    quantisation_error
        Further bound on the error of every inverse depth, as a share of it: half of the largest step of quantised
        depths.
    near_edge
        (H, W) 1 within 4 px of an edge, of an invalid pixel or of the border, else 0.
    clearance_px
        (h, w) lower bound of the distance of each block of pixels from the nearest pixel that is near an edge, px; 0
        where the block holds such a pixel.
    nearest_per_m
        Inverse depth of the nearest surface, 1/m; 0 where no depth is valid.
    block_px
        Side of the blocks, px. The last blocks can extend beyond the image.
    """

    depths_m: Depths
    error_per_m: Float32
    quantisation_error: float
    near_edge: Marks
    clearance_px: Float32
    nearest_per_m: float
    block_px: int

    def moved(self, axis: int, shift_px: int) -> "DepthImage":
        """Return the image moved by whole pixels.

        Parameters
        ----------
        axis
            0 to the right, 1 down.
        shift_px
            Displacement, px, not 0; negative to the left (up).

        Returns
        -------
        DepthImage
            Of the same size; pixels that enter at the border count as near an edge.
        """
        along = 1 - axis
        entered = slice(0, shift_px) if shift_px > 0 else slice(shift_px, None)
        border = (slice(None), entered) if axis == 0 else (entered,)
        near_edge = np.roll(self.near_edge, shift_px, along)
        near_edge[border] = 1
        clearance_px = _clearance_px(near_edge, self.block_px)
        depths_m, error_per_m = (np.roll(image, shift_px, along) for image in (self.depths_m, self.error_per_m))
        return replace(self, depths_m=depths_m, error_per_m=error_per_m, near_edge=near_edge, clearance_px=clearance_px)


def depth_image(depths_m: Depths, relative_step: float = 0.0, least_block_px: int = 1) -> DepthImage:
    """Prepare a depth frame for reading between its pixels.

    Parameters
    ----------
    depths_m
        (H, W) z-depth, m; NaN or not positive where invalid.
    relative_step
        Largest step of quantised depths, as a share of the depth; 0 where they are not quantised.
    least_block_px
        Least side of the blocks by which distances from edges are measured, px.

    Returns
    -------
    DepthImage
        Of the same depths; all arrays but ``depths_m`` are new.
    """
    depths_m = np.ascontiguousarray(depths_m)
    single_m = np.asarray(depths_m, dtype=np.float32)
    marks, error_per_m = np.empty(depths_m.shape, np.uint8), np.empty(depths_m.shape, np.float32)
    floor = _ROUNDINGS * SINGLE_PRECISION
    nearest_per_m = _edges_and_errors(single_m, EDGE, _OF_SECOND_DIFFERENCE, floor, marks, error_per_m)
    near_edge = np.asarray(cv2.dilate(marks, np.ones((_WIDENED_PX, _WIDENED_PX), np.uint8)), dtype=np.uint8)
    block_px = max(least_block_px, ceil(sqrt(depths_m.size / _FEWEST_BLOCKS)))
    clearance_px = _clearance_px(near_edge, block_px)
    return DepthImage(depths_m, error_per_m, relative_step / 2, near_edge, clearance_px, float(nearest_per_m), block_px)


def _clearance_px(near_edge: Marks, block_px: int) -> Float32:
    """Return a lower bound (h, w) of the distance of each block's pixels from marks (H, W), px."""
    clear = np.asarray(near_edge == 0).view(np.uint8)
    if block_px == 1:
        return np.asarray(cv2.distanceTransform(clear, cv2.DIST_L2, 3), dtype=np.float32)
    # A pixel of the eroded image is clear if the block that begins with it is; beyond the border all counts as clear.
    blocks = cv2.erode(clear, np.ones((block_px, block_px), np.uint8), anchor=(0, 0))[::block_px, ::block_px]
    distances = np.asarray(cv2.distanceTransform(np.ascontiguousarray(blocks), cv2.DIST_L2, 3), dtype=np.float32)
    # Offsets of two pixels within their blocks differ by at most block - 1 px along each axis:
    # distance >= block * distance of blocks - sqrt(2) (block - 1).
    farther_px = np.float32(sqrt(2.0) * (block_px - 1))
    return np.asarray(np.maximum(np.float32(block_px) * distances - farther_px, np.float32(0)))


@njit(cache=True, error_model="numpy")
def inverse_at(depths: Depths, row: np.uint64, column: np.uint64) -> float:
    """Return the inverse depth of a pixel.

    Parameters
    ----------
    depths
        (H, W) z-depth, m; NaN or not positive where invalid.
    row, column
        The pixel.

    Returns
    -------
    float
        1/m; 0 where the depth is invalid.
    """
    depth = np.float64(depths[row, column])
    return 1.0 / depth if depth > 0.0 else 0.0


@njit(cache=True)
def _edges_and_errors(
    depths: Float32, edge: float, of_bend: float, floor: float, marks: Marks, errors_per_m: Float32
) -> float:
    """Write edges and bounds of errors; return the inverse depth of the nearest surface, 1/m.

    Parameters
    ----------
    depths
        (H, W) z-depth, m.
    edge
        A pixel is an edge where the Laplacian of the inverse depth exceeds this share of the inverse depth.
    of_bend, floor
        The error is at most ``of_bend`` times the largest second difference around the pixel, and ``floor`` times the
        inverse depth.
    marks
        (H, W) receives 1 at edges, invalid pixels and the border, else 0.
    errors_per_m
        (H, W) receives the bounds, 1/m.
    """
    height, width = depths.shape
    inverse, widest = np.zeros((3, width), np.float32), np.zeros((3, width), np.float32)
    down, right, bends = np.zeros((2, width), np.float32), np.zeros(width, np.float32), np.zeros(width, np.float32)
    nearest = np.zeros(width, np.float32)
    _invert(depths[0], inverse[0], nearest)
    # Three rows of inverse depths and of bends are kept: errors of a row need the bends of the rows around it.
    for row in range(height + 1):
        here, below = inverse[row % 3], inverse[(row + 1) % 3]
        if row + 1 < height:
            _invert(depths[row + 1], below, nearest)
            _differ_from_next(depths[row], depths[row + 1], here, below, down[row % 2])
        if row < height:
            _differ_from_next(depths[row, :-1], depths[row, 1:], here[:-1], here[1:], right)
            above, under = down[(row - 1) % 2], down[row % 2]
            # The first and the last row belong to the border.
            if 0 < row < height - 1:
                _mark_edges(above, under, right, here, edge, marks[row])
            else:
                marks[row], above = 1, under
            _write_bends(above, under, right, bends)
            _widen(bends, widest[row % 3])
        else:
            widest[row % 3] = 0
        if row > 0:
            before, middle, after = widest[(row - 2) % 3], widest[(row - 1) % 3], widest[row % 3]
            _write_errors(before, middle, after, inverse[(row - 1) % 3], of_bend, floor, errors_per_m[row - 1])
    return float(nearest.max())


@njit(cache=True, error_model="numpy")
def _invert(depths: Float32, inverse: Float32, nearest: Float32) -> None:
    """Write the inverse depths (W,) of a row of pixels, 1/m, and update the largest of each column."""
    for column in range(len(inverse)):
        value = np.float32(1) / depths[column] if depths[column] > 0 else np.float32(0)
        inverse[column] = value
        nearest[column] = _larger(value, nearest[column])


@njit(cache=True)
def _differ_from_next(
    depths: Float32, next_depths: Float32, inverse: Float32, next_inverse: Float32, differences: Float32
) -> None:
    """Write the inverse depths less those of the next pixels, 1/m."""
    for column in range(len(inverse)):
        # 1/a - 1/b = (b - a) / (a b): the difference of the depths is exact in single precision.
        product = inverse[column] * next_inverse[column]
        difference = (next_depths[column] - depths[column]) * product
        differences[column] = difference if product > 0 else inverse[column] - next_inverse[column]


@njit(cache=True)
def _mark_edges(above: Float32, below: Float32, right: Float32, inverse: Float32, edge: float, marks: Marks) -> None:
    """Write the edges of a row; the arguments are differences from the row above, to the row below and to the right."""
    last, least = len(inverse) - 1, np.float32(edge)
    marks[0] = marks[last] = 1
    for column in range(1, last):
        # Each difference is a pixel less the next one; the difference of two is a second difference along one axis.
        laplacian = above[column] - below[column] + right[column - 1] - right[column]
        marks[column] = (abs(laplacian) > least * inverse[column]) | (inverse[column] <= 0)


@njit(cache=True)
def _write_bends(above: Float32, below: Float32, right: Float32, bends: Float32) -> None:
    """Write the sum of the absolute second differences along both axes; those across the border count as 0."""
    last = len(bends) - 1
    bends[0], bends[last] = abs(above[0] - below[0]), abs(above[last] - below[last])
    for column in range(1, last):
        bends[column] = abs(above[column] - below[column]) + abs(right[column - 1] - right[column])


@njit(cache=True)
def _widen(bends: Float32, widest: Float32) -> None:
    """Write the largest of each three neighbouring values."""
    last = len(bends) - 1
    widest[0], widest[last] = bends[: min(2, last + 1)].max(), bends[max(last - 1, 0) :].max()
    for column in range(1, last):
        widest[column] = _larger(_larger(bends[column - 1], bends[column]), bends[column + 1])


@njit(cache=True)
def _write_errors(
    before: Float32, middle: Float32, after: Float32, inverse: Float32, of_bend: float, floor: float, errors: Float32
) -> None:
    """Write the errors of a row of pixels from the largest bends of the rows before, at and after it, 1/m."""
    # error = of_bend * largest second difference + floor * inverse depth
    bend_share, value_share = np.float32(of_bend), np.float32(floor)
    for column in range(len(errors)):
        largest = _larger(_larger(before[column], middle[column]), after[column])
        errors[column] = bend_share * largest + value_share * inverse[column]


@njit(cache=True)
def _larger(a: np.float32, b: np.float32) -> np.float32:
    """Return the larger of two numbers, neither of which is NaN. It compiles to a single instruction."""
    return a if a > b else b


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

    def chosen(self, which: NDArray[np.bool_]) -> "DepthSteps":
        """Return the steps of a mask (n,)."""
        return DepthSteps(self.columns[which], self.rows[which], self.depths_m[which], self.near_first[which])


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
