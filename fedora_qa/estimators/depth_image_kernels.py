"""Compiled loops over the pixels of a depth frame: where its edges are, and how far values read between pixels may err.

Depths (H, W) are in metres, of any floating type; not positive, infinite or NaN where invalid. A frame is gone through
once, row by row, so that only what is asked for is ever written.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Depths = NDArray[np.floating[Any]]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Marks = NDArray[np.uint8]


@njit(cache=True)
def inverse_at(depths: Depths, row: int, column: int) -> float:
    """Return the inverse depth of a pixel, 1/m; 0 where it is invalid."""
    depth = np.float64(depths[row, column])
    return 1.0 / depth if depth > 0.0 else 0.0


@njit(cache=True)
def edges_and_errors(
    depths: Depths, edge: float, of_bend: float, floor: float, marks: Marks, errors_per_m: Float32
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
    inverse, nearest = np.zeros((3, width)), np.zeros(width)
    # Bends in single precision: they are shares of an error, and twice as many fit into a register.
    bends, widest = np.zeros(width, np.float32), np.zeros((3, width), np.float32)
    _invert(depths[0], inverse[0])
    for row in range(height + 1):
        above, here, below = inverse[(row - 1) % 3], inverse[row % 3], inverse[(row + 1) % 3]
        if row + 1 < height:
            _invert(depths[row + 1], below)
        if row < height:
            inside = 0 < row < height - 1
            _mark(above, here, below, edge, inside, marks[row])
            _bend(above, here, below, inside, bends)
            _widen(bends, widest[row % 3])
            for column in range(width):
                nearest[column] = here[column] if here[column] > nearest[column] else nearest[column]
        else:
            widest[row % 3] = 0.0
        if row > 0:
            _err(widest[(row - 2) % 3], widest[(row - 1) % 3], widest[row % 3], above, of_bend, floor,
                 errors_per_m[row - 1])  # fmt: skip
    return float(nearest.max())


@njit(cache=True)
def _invert(depths: Depths, inverse: Float64) -> None:
    """Write the inverse depths (W,) of a row of pixels."""
    for column in range(len(inverse)):
        depth = np.float64(depths[column])
        inverse[column] = 1.0 / depth if depth > 0.0 else 0.0


@njit(cache=True)
def _mark(above: Float64, here: Float64, below: Float64, edge: float, inside: bool, marks: Marks) -> None:
    last = len(here) - 1
    if not inside or last < 2:
        marks[:] = 1
        return
    marks[0] = marks[last] = 1
    for column in range(1, last):
        laplacian = above[column] + below[column] + here[column - 1] + here[column + 1] - 4.0 * here[column]
        marks[column] = (abs(laplacian) > edge * here[column]) | (here[column] <= 0.0)


@njit(cache=True)
def _bend(above: Float64, here: Float64, below: Float64, inside: bool, bends: Float32) -> None:
    """Write the absolute second differences along both axes together; those beyond the border count as 0."""
    last = len(here) - 1
    bends[0] = bends[last] = 0.0
    for column in range(1, last):
        bends[column] = np.float32(abs(here[column + 1] - 2.0 * here[column] + here[column - 1]))
    if inside:
        for column in range(last + 1):
            bends[column] += np.float32(abs(below[column] - 2.0 * here[column] + above[column]))


@njit(cache=True)
def _widen(bends: Float32, widest: Float32) -> None:
    """Write the largest of each three neighbours."""
    last = len(bends) - 1
    widest[0], widest[last] = bends[: min(2, last + 1)].max(), bends[max(last - 1, 0) :].max()
    for column in range(1, last):
        widest[column] = _larger(_larger(bends[column - 1], bends[column]), bends[column + 1])


@njit(cache=True)
def _err(
    before: Float32, at: Float32, after: Float32, inverse: Float64, of_bend: float, floor: float, errors: Float32
) -> None:
    share = np.float32(of_bend)
    for column in range(len(errors)):
        largest = _larger(_larger(before[column], at[column]), after[column])
        errors[column] = share * largest + np.float32(floor * inverse[column])


@njit(cache=True)
def _larger(one: float, other: float) -> float:
    """Return the larger of two numbers, none of which is NaN: a single instruction."""
    return one if one > other else other
