"""Compiled loops over the pixels of a depth frame: where its edges are, and how far values read between pixels may err.

Depths (H, W) are in metres; not positive, infinite or NaN where invalid. A frame is gone through once, row by row, in
single precision: inverse depths differ by the difference of the depths, which is exact, over their product, so that
nothing cancels, and second differences come out to a hundredth of what the rounding of the depths makes of them.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Depths = NDArray[np.floating[Any]]
Float32 = NDArray[np.float32]
Marks = NDArray[np.uint8]


@njit(cache=True, error_model="numpy")
def inverse_at(depths: Depths, row: np.uint64, column: np.uint64) -> float:
    """Return the inverse depth of a pixel, 1/m; 0 where it is invalid."""
    depth = np.float64(depths[row, column])
    return 1.0 / depth if depth > 0.0 else 0.0


@njit(cache=True)
def edges_and_errors(
    depths: Float32, edge: float, of_bend: float, floor: float, marks: Marks, errors_per_m: Float32
) -> float:
    """Write where edges are and how far values may err; return the inverse depth of the nearest surface.

    Parameters
    ----------
    edge
        An edge is where the Laplacian of the inverse depth is more than this share of it.
    of_bend, floor
        A value errs by the one share of the largest second difference around it, and by the other share of itself.
    marks
        (H, W) 1 at edges, invalid pixels and the border, else 0.
    errors_per_m
        (H, W) 1/m.
    """
    height, width = depths.shape
    inverse, widest = np.zeros((3, width), np.float32), np.zeros((3, width), np.float32)
    down, right, bends = np.zeros((2, width), np.float32), np.zeros(width, np.float32), np.zeros(width, np.float32)
    nearest = np.zeros(width, np.float32)
    _invert(depths[0], inverse[0], nearest)
    for row in range(height + 1):
        here, below = inverse[row % 3], inverse[(row + 1) % 3]
        if row + 1 < height:
            _invert(depths[row + 1], below, nearest)
            _fall(depths[row], depths[row + 1], here, below, down[row % 2])
        if row < height:
            _fall(depths[row, :-1], depths[row, 1:], here[:-1], here[1:], right)
            above, under = down[(row - 1) % 2], down[row % 2]
            if 0 < row < height - 1:
                _mark(above, under, right, here, edge, marks[row])
            else:
                marks[row], above = 1, under
            _bend(above, under, right, bends)
            _widen(bends, widest[row % 3])
        else:
            widest[row % 3] = 0
        if row > 0:
            _err(widest[(row - 2) % 3], widest[(row - 1) % 3], widest[row % 3], inverse[(row - 1) % 3], of_bend, floor,
                 errors_per_m[row - 1])  # fmt: skip
    return float(nearest.max())


@njit(cache=True, error_model="numpy")
def _invert(depths: Float32, inverse: Float32, nearest: Float32) -> None:
    """Write the inverse depths (W,) of a row of pixels, and the largest of each column so far."""
    for column in range(len(inverse)):
        of_one = np.float32(1) / depths[column] if depths[column] > 0 else np.float32(0)
        inverse[column] = of_one
        nearest[column] = _larger(of_one, nearest[column])


@njit(cache=True)
def _fall(depths: Float32, next_depths: Float32, inverse: Float32, next_inverse: Float32, fall: Float32) -> None:
    """Write by how much inverse depths are larger than those of the next pixels."""
    for column in range(len(inverse)):
        product = inverse[column] * next_inverse[column]
        between = (next_depths[column] - depths[column]) * product
        fall[column] = between if product > 0 else inverse[column] - next_inverse[column]


@njit(cache=True)
def _mark(above: Float32, below: Float32, right: Float32, here: Float32, edge: float, marks: Marks) -> None:
    """Write where edges are: ``above``, ``below`` and ``right`` are the falls from above, to below and to the right."""
    last, least = len(here) - 1, np.float32(edge)
    marks[0] = marks[last] = 1
    for column in range(1, last):
        laplacian = above[column] - below[column] + right[column - 1] - right[column]
        marks[column] = (abs(laplacian) > least * here[column]) | (here[column] <= 0)


@njit(cache=True)
def _bend(above: Float32, below: Float32, right: Float32, bends: Float32) -> None:
    """Write the absolute second differences along both axes together; those beyond the border count as 0."""
    last = len(bends) - 1
    bends[0], bends[last] = abs(above[0] - below[0]), abs(above[last] - below[last])
    for column in range(1, last):
        bends[column] = abs(above[column] - below[column]) + abs(right[column - 1] - right[column])


@njit(cache=True)
def _widen(bends: Float32, widest: Float32) -> None:
    """Write the largest of each three neighbours."""
    last = len(bends) - 1
    widest[0], widest[last] = bends[: min(2, last + 1)].max(), bends[max(last - 1, 0) :].max()
    for column in range(1, last):
        widest[column] = _larger(_larger(bends[column - 1], bends[column]), bends[column + 1])


@njit(cache=True)
def _err(
    before: Float32, at: Float32, after: Float32, inverse: Float32, of_bend: float, floor: float, errors: Float32
) -> None:
    share, of_value = np.float32(of_bend), np.float32(floor)
    for column in range(len(errors)):
        largest = _larger(_larger(before[column], at[column]), after[column])
        errors[column] = share * largest + of_value * inverse[column]


@njit(cache=True)
def _larger(one: np.float32, other: np.float32) -> np.float32:
    """Return the larger of two numbers, none of which is NaN: a single instruction."""
    return one if one > other else other
