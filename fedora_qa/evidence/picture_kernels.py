"""Compiled sums over pixels: means of blocks, and events of each pixel."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
UInt8 = NDArray[np.uint8]
UInt16 = NDArray[np.uint16]
UInt32 = NDArray[np.uint32]


@njit(cache=True)
def finite_means(image: Float32, rows: int, columns: int, height: int, width: int) -> Float32:
    """Return the means (rows, columns, c) of the finite values of blocks of an image (H, W, c); NaN where none is.

    ``height`` and ``width`` are those of a block. Sums are taken in single precision along columns, in double of them.
    """
    channels = image.shape[2]
    lines = image.reshape(image.shape[0], image.shape[1] * channels)
    wide, step = columns * width * channels, np.uint64(channels)  # a signed place costs a comparison
    means = np.empty((rows, columns, channels), np.float32)
    sums, counts = np.empty(wide, np.float32), np.empty(wide, np.float32)
    for row in range(rows):
        sums[:], counts[:] = 0, 0
        for at in range(row * height, (row + 1) * height):
            line = lines[at]
            for i in range(wide):
                finite = abs(line[i]) < np.inf
                sums[i] += line[i] if finite else np.float32(0)
                counts[i] += np.float32(1) if finite else np.float32(0)
        for column in range(columns):
            for channel in range(channels):
                at_column, total, count = np.uint64(column * width * channels + channel), 0.0, np.float32(0)
                for _ in range(width):
                    total += sums[at_column]
                    count += counts[at_column]
                    at_column += step
                means[row, column, channel] = total / count if count else np.nan
    return means


@njit(cache=True)
def code_means(image: UInt8, rows: int, columns: int, height: int, width: int) -> UInt8:
    """Return the means (rows, columns, c) of blocks of an image of codes (H, W, c), rounded, halves to even."""
    channels = image.shape[2]
    lines = image.reshape(image.shape[0], image.shape[1] * channels)
    wide, step = columns * width * channels, np.uint64(channels)  # a signed place costs a comparison
    means, sums = np.empty((rows, columns, channels), np.uint8), np.empty(wide, np.uint32)
    for row in range(rows):
        sums[:] = 0
        for at in range(row * height, (row + 1) * height):
            line = lines[at]
            for i in range(wide):
                sums[i] += line[i]
        for column in range(columns):
            for channel in range(channels):
                at_column, total = np.uint64(column * width * channels + channel), np.uint32(0)
                for _ in range(width):
                    total += sums[at_column]
                    at_column += step
                means[row, column, channel] = np.uint8(np.rint(total / (height * width)))
    return means


@njit(cache=True)
def add_events(counts: UInt32, columns: NDArray[Any], rows: NDArray[Any]) -> None:
    """Add events (n,) to the counts of their pixels (H, W); those that lie beyond are left out."""
    height, width = counts.shape
    for i in range(len(rows)):
        if 0 <= columns[i] < width and 0 <= rows[i] < height:
            counts[rows[i], columns[i]] += np.uint32(1)


@njit(cache=True)
def events_of_blocks(
    columns: NDArray[Any], rows: NDArray[Any], p: NDArray[Any], size: tuple[int, int], block: int, most: int,
    counts: UInt16,
) -> None:  # fmt: skip
    """Add events (n,) within rows and columns of a ``size`` to blocks of pixels by polarity, (2, h, w), up to ``most``.

    Pixels beyond the last block are left out.
    """
    height, width = min(size[0], counts.shape[1] * block), min(size[1], counts.shape[2] * block)
    for i in range(len(rows)):
        if 0 <= columns[i] < width and 0 <= rows[i] < height and 0 <= p[i] <= 1:
            at = counts[p[i], rows[i] // block]
            column = columns[i] // block
            if at[column] < most:
                at[column] += np.uint16(1)
