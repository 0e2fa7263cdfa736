"""Compiled loops that average frames over footprints. Rows are added first, which runs along memory, then columns."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Bool = NDArray[np.bool_]
Weighted = tuple[NDArray[np.int64], Float64]
"""First pixel (m,) and weights (m, k) of the pixels from there."""
Weighted32 = tuple[NDArray[np.int64], Float32]


@njit(cache=True)
def average_taps(image: NDArray[Any], rows: Weighted, columns: Weighted, means: Float64) -> None:
    """Write the weighted means (h, w) of an image (H, W)."""
    line = np.empty(image.shape[1])
    for row in range(means.shape[0]):
        _add_rows(image, rows[0][row], rows[1][row], line)
        _add_columns(line, columns[0], columns[1], means[row])


@njit(cache=True)
def see_frame(
    luma: Float32,
    lost: Bool,
    rows: tuple[Weighted32, Weighted32, Weighted32],
    columns: tuple[Weighted32, Weighted32, Weighted32],
    inside_rows: Bool,
    inside_columns: Bool,
    rounding: float,
    sharp_means: Float32,
    even_means: Float32,
    errors: Float32,
) -> None:
    """Write what ``Footprints.see`` says, row by row, so that all but the frame itself stays in the cache.

    ``rows`` and ``columns`` weigh frame pixels: even, sharp and split.
    """
    width = luma.shape[1]
    even_rows, sharp_rows, split_rows = rows
    even_columns, sharp_columns, split_columns = columns
    lost_rows = _rows_with(lost)
    beyond = np.empty(len(inside_columns), np.float32)
    for column in range(len(beyond)):
        beyond[column] = rounding if inside_columns[column] else np.inf
    sharp, even, whole, split = (np.empty(width, np.float32), np.empty(width, np.float32),
                                 np.empty(width, np.float32), np.empty(width, np.float32))  # fmt: skip
    taps = even_rows[1].shape[1]
    # Of the contrast the last rows are kept: neighbouring footprints share one of them.
    contrast, known = np.empty((taps, width), np.float32), np.full(taps, -1)
    high, low, touched = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.bool_)
    for row in range(len(errors)):
        _add_rows32(luma, sharp_rows[0][row], sharp_rows[1][row], sharp)
        _add_columns32(sharp, sharp_columns[0], sharp_columns[1], sharp_means[row])
        first, weights = even_rows[0][row], even_rows[1][row]
        _add_rows32(luma, first, weights, even)
        whole[:], split[:] = 0.0, 0.0
        for i in range(taps):
            kept = (first + i) % taps
            if known[kept] != first + i:
                _contrast_of_row(luma, first + i, high, low, contrast[kept])
                known[kept] = first + i
            _add_both(contrast[kept], weights[i], split_rows[1][row, i], whole, split)
        error = errors[row]
        _add_even_columns(even, whole, split, even_columns, split_columns[1], even_means[row], error)
        if inside_rows[row]:
            for column in range(len(error)):
                error[column] += beyond[column]
        else:
            error[:] = np.inf
        if _mark_rows(lost, lost_rows, first, weights, touched):
            _lose_columns(touched, even_columns[0], even_columns[1], error)


@njit(cache=True)
def _add_rows(image: NDArray[Any], first: int, weights: Float64, line: Float64) -> None:
    line[:] = 0.0
    for i in range(len(weights)):
        for column in range(len(line)):
            line[column] += weights[i] * image[first + i, column]


@njit(cache=True, fastmath={"contract"})
def _add_rows32(image: Float32, first: int, weights: Float32, line: Float32) -> None:
    line[:] = 0.0
    for i in range(len(weights)):
        weight, row = weights[i], image[first + i]
        if weight != 0.0:
            for column in range(len(line)):
                line[column] += weight * row[column]


@njit(cache=True, fastmath={"contract"})
def _add_both(row: Float32, weight: np.float32, other_weight: np.float32, line: Float32, other: Float32) -> None:
    """Add a row to two lines, by weights of which none is 0 where the other is not."""
    if weight != 0.0:
        for column in range(len(line)):
            line[column] += weight * row[column]
            other[column] += other_weight * row[column]


@njit(cache=True, fastmath={"contract"})
def _add_columns(line: Float64, first: NDArray[np.int64], weights: Float64, means: Float64) -> None:
    for column in range(len(means)):
        # Unsigned: an index that may be negative costs a comparison each.
        at, total = np.uint64(first[column]), 0.0
        for i in range(weights.shape[1]):
            total += weights[column, i] * line[at + np.uint64(i)]
        means[column] = total


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _add_columns32(line: Float32, first: NDArray[np.int64], weights: Float32, means: Float32) -> None:
    for column in range(len(means)):
        at, total = np.uint64(first[column]), np.float32(0)
        for i in range(weights.shape[1]):
            total += weights[column, i] * line[at + np.uint64(i)]
        means[column] = total


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _add_even_columns(
    even: Float32,
    whole: Float32,
    split: Float32,
    even_columns: Weighted32,
    split_weights: Float32,
    means: Float32,
    bounds: Float32,
) -> None:
    """Write the means of ``even``, and those of ``whole`` less those of ``split`` by its own weights."""
    first, weights = even_columns
    for column in range(len(means)):
        at, mean, bound = np.uint64(first[column]), np.float32(0), np.float32(0)
        for i in range(weights.shape[1]):
            pixel, weight = at + np.uint64(i), weights[column, i]
            mean += weight * even[pixel]
            bound += weight * whole[pixel] - split_weights[column, i] * split[pixel]
        means[column], bounds[column] = mean, bound


@njit(cache=True)
def _contrast_of_row(luma: Float32, row: int, high: Float32, low: Float32, contrast: Float32) -> None:
    """Write the largest less the smallest value among each pixel of a row and its eight neighbours."""
    height, width = luma.shape
    above, at, below = luma[max(row - 1, 0)], luma[row], luma[min(row + 1, height - 1)]
    for column in range(width):
        high[column] = max(above[column], at[column], below[column])
        low[column] = min(above[column], at[column], below[column])
    for column in range(1, width - 1):
        most = max(high[column - 1], high[column], high[column + 1])
        least = min(low[column - 1], low[column], low[column + 1])
        contrast[column] = most - least
    for column in (0, width - 1):
        left, right = max(column - 1, 0), min(column + 1, width - 1)
        most = max(high[left], high[column], high[right])
        least = min(low[left], low[column], low[right])
        contrast[column] = most - least


@njit(cache=True)
def _rows_with(lost: Bool) -> Bool:
    """Return the rows (H,) with a pixel that is lost."""
    rows = np.zeros(lost.shape[0], np.bool_)
    for row in range(lost.shape[0]):
        found = False
        for column in range(lost.shape[1]):
            found |= lost[row, column]
        rows[row] = found
    return rows


@njit(cache=True)
def _mark_rows(lost: Bool, lost_rows: Bool, first: int, weights: Float32, touched: Bool) -> bool:
    """Mark the columns in which a pixel of the rows that weigh, or of those beside them, is lost; return if any is."""
    start, stop = len(lost), 0
    for i in range(len(weights)):
        if weights[i] != 0.0:
            start, stop = min(start, max(first + i - 1, 0)), max(stop, min(first + i + 2, len(lost)))
    if not np.any(lost_rows[start:stop]):
        return False
    touched[:] = False
    for row in range(start, stop):
        if lost_rows[row]:
            for column in range(len(touched)):
                touched[column] |= lost[row, column]
    return True


@njit(cache=True)
def _lose_columns(touched: Bool, first: NDArray[np.int64], weights: Float32, error: Float32) -> None:
    """Make the error infinite of pixels whose columns that weigh, or those beside them, are marked."""
    before = 0
    until = np.zeros(len(touched) + 1, np.int64)
    for column in range(len(touched)):
        before += touched[column]
        until[column + 1] = before
    for column in range(len(error)):
        start, stop = len(touched), 0
        for i in range(weights.shape[1]):
            if weights[column, i] != 0.0:
                at = first[column] + i
                start, stop = min(start, max(at - 1, 0)), max(stop, min(at + 2, len(touched)))
        if stop > start and until[stop] > until[start]:
            error[column] = np.inf
