"""Compiled read of a cubic B-spline between pixels."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def read_spline(
    coefficients: NDArray[np.float32], columns: NDArray[np.float32], rows: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the B-spline of coefficients (H, W) at positions (n, m); beyond the image its border."""
    height, width = coefficients.shape
    read = np.empty(columns.shape, np.float32)
    for i in range(columns.shape[0]):
        for j in range(columns.shape[1]):
            x, y = within(columns[i, j], width), within(rows[i, j], height)
            read[i, j] = read_spline_at(coefficients, x, y, 0, 0, width, height)
    return read


@njit(cache=True)
def read_spline_at(
    coefficients: NDArray[np.float32], x: np.float32, y: np.float32, left: int, top: int, width: int, height: int
) -> np.float32:
    """Return the B-spline at a place within an image (height, width), of whose coefficients a part is given.

    The part begins at ``left`` and ``top``, and holds a pixel before the place and two behind, where the image does.
    """
    column, row = int(x), int(y)
    across, down = spline_weights(x - np.float32(column)), spline_weights(y - np.float32(row))
    total = np.float32(0)
    if 1 <= column < width - 2 and 1 <= row < height - 2:
        first = column - 1 - left
        for k in range(4):
            line = coefficients[row - 1 + k - top]
            total += down[k] * (
                across[0] * line[first]
                + across[1] * line[first + 1]
                + across[2] * line[first + 2]
                + across[3] * line[first + 3]
            )
    else:
        for k in range(4):
            line = coefficients[mirrored(row - 1 + k, height) - top]
            for m in range(4):
                total += down[k] * across[m] * line[mirrored(column - 1 + m, width) - left]
    return total


@njit(cache=True)
def within(position: np.float32, size: int) -> np.float32:
    """Return the position, or the border where it lies beyond; 0 where it is no number."""
    if not position > np.float32(0):
        return np.float32(0)
    return position if position < np.float32(size - 1) else np.float32(size - 1)


@njit(cache=True)
def spline_weights(t: np.float32) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return the weights of the pixels before and after a fraction t."""
    rest = np.float32(1) - t
    first, last = rest * rest * rest / np.float32(6), t * t * t / np.float32(6)
    second = (t * t * (np.float32(3) * t - np.float32(6)) + np.float32(4)) / np.float32(6)
    return first, second, np.float32(1) - first - second - last, last


@njit(cache=True)
def mirrored(index: int, size: int) -> int:
    """Return the place of an index at most a few pixels outside."""
    if size == 1:
        return 0
    index = abs(index)
    return index if index < size else max(2 * size - 2 - index, 0)
