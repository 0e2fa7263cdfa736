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
    across = np.empty(4, np.float32)
    down = np.empty(4, np.float32)
    for i in range(columns.shape[0]):
        for j in range(columns.shape[1]):
            x, y = _within(columns[i, j], width), _within(rows[i, j], height)
            column, row = int(x), int(y)
            _weigh(x - np.float32(column), across)
            _weigh(y - np.float32(row), down)
            total = np.float32(0)
            if 1 <= column < width - 2 and 1 <= row < height - 2:
                for k in range(4):
                    line = coefficients[row - 1 + k]
                    total += down[k] * (
                        across[0] * line[column - 1]
                        + across[1] * line[column]
                        + across[2] * line[column + 1]
                        + across[3] * line[column + 2]
                    )
            else:
                for k in range(4):
                    line = coefficients[_mirrored(row - 1 + k, height)]
                    for m in range(4):
                        total += down[k] * across[m] * line[_mirrored(column - 1 + m, width)]
            read[i, j] = total
    return read


@njit(cache=True)
def _within(position: np.float32, size: int) -> np.float32:
    """Return the position, or the border where it lies beyond; 0 where it is no number."""
    if not position > np.float32(0):
        return np.float32(0)
    return position if position < np.float32(size - 1) else np.float32(size - 1)


@njit(cache=True)
def _weigh(t: np.float32, weights: NDArray[np.float32]) -> None:
    """Fill in the weights (4,) of the pixels before and after a fraction t."""
    rest = np.float32(1) - t
    weights[0] = rest * rest * rest / np.float32(6)
    weights[3] = t * t * t / np.float32(6)
    weights[1] = (t * t * (np.float32(3) * t - np.float32(6)) + np.float32(4)) / np.float32(6)
    weights[2] = np.float32(1) - weights[0] - weights[1] - weights[3]


@njit(cache=True)
def _mirrored(index: int, size: int) -> int:
    """Return the place of an index at most a few pixels outside."""
    if size == 1:
        return 0
    index = abs(index)
    return index if index < size else max(2 * size - 2 - index, 0)
