"""Compiled means of blocks of pixels, of the values that are finite."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]


@njit(cache=True)
def finite_means(image: Float32, rows: int, columns: int, height: int, width: int) -> Float32:
    """Return the means (rows, columns, c) of the finite values of blocks of an image (H, W, c); NaN where none is.

    ``height`` and ``width`` are those of a block. Sums are taken in single precision along rows, in double of rows.
    """
    channels = image.shape[2]
    means = np.empty((rows, columns, channels), np.float32)
    sums, counts = np.empty((columns, channels)), np.empty((columns, channels))
    for row in range(rows):
        sums[:], counts[:] = 0.0, 0.0
        for line in image[row * height : (row + 1) * height]:
            for column in range(columns):
                for channel in range(channels):
                    total, count = np.float32(0), np.float32(0)
                    for i in range(column * width, (column + 1) * width):
                        value = line[i, channel]
                        finite = abs(value) < np.inf
                        total += value if finite else np.float32(0)
                        count += np.float32(1) if finite else np.float32(0)
                    sums[column, channel] += total
                    counts[column, channel] += count
        for column in range(columns):
            for channel in range(channels):
                count_of_block = counts[column, channel]
                means[row, column, channel] = sums[column, channel] / count_of_block if count_of_block else np.nan
    return means
