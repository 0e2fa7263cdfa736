"""Compiled sums over sampled pixels, each image gone through once."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]


@njit(cache=True)
def sums_of(values: NDArray[np.floating[Any]], positive: bool) -> tuple[int, float, float, float, float]:
    """Return count, sum, sum of squares, least and greatest of the values (n,) that are finite, and positive if asked.

    Sums are taken in double precision, of stretches first, so that rounding does not pile up.
    """
    count, total, squares, least, greatest = 0, 0.0, 0.0, np.inf, -np.inf
    for start in range(0, len(values), 1024):
        some, some_squares = 0.0, 0.0
        for i in range(start, min(start + 1024, len(values))):
            value = np.float64(values[i])
            if abs(value) < np.inf and (value > 0.0 or not positive):
                count += 1
                some += value
                some_squares += value * value
                least = value if value < least else least
                greatest = value if value > greatest else greatest
        total, squares = total + some, squares + some_squares
    return count, total, squares, least, greatest


@njit(cache=True)
def lengths_at(flow_px: Float32, first: int, stride: int) -> Float32:
    """Return the length of a flow (H, W, 2) at every so many-th row and column, (h, w)."""
    rows, columns = _places(flow_px.shape[0], first, stride), _places(flow_px.shape[1], first, stride)
    lengths = np.empty((rows, columns), np.float32)
    for row in range(rows):
        line = flow_px[first + row * stride]
        for column in range(columns):
            u, v = line[first + column * stride, 0], line[first + column * stride, 1]
            lengths[row, column] = np.sqrt(u * u + v * v)
    return lengths


@njit(cache=True)
def lumas_at(rgb: NDArray[np.uint8], first: int, stride: int, red: float, green: float, blue: float) -> Float32:
    """Return the luma of the codes of a frame (H, W, 3) at every so many-th row and column, (h, w)."""
    rows, columns = _places(rgb.shape[0], first, stride), _places(rgb.shape[1], first, stride)
    lumas = np.empty((rows, columns), np.float32)
    for row in range(rows):
        line = rgb[first + row * stride]
        for column in range(columns):
            pixel = line[first + column * stride]
            lumas[row, column] = red * pixel[0] + green * pixel[1] + blue * pixel[2]
    return lumas


@njit(cache=True)
def _places(size: int, first: int, stride: int) -> int:
    return (size - first + stride - 1) // stride
