"""Pictures made smaller by averaging or summing whole blocks of pixels, so that their values keep their unit."""

from typing import Any, Final, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
UInt8 = NDArray[np.uint8]
UInt16 = NDArray[np.uint16]
UInt32 = NDArray[np.uint32]

LARGEST_SENSOR_PX: Final = 4096
"""Events of an undeclared sensor that lie farther out are left out of its picture."""

_MOST_EVENTS: Final = np.iinfo(np.uint16).max


def block_px(width: int, picture_width_px: int) -> int:
    """Return the side of the smallest blocks with which a picture is no wider than allowed, px.

    Parameters
    ----------
    width
        Of the image, px.
    picture_width_px
        Largest width of the picture, px.
    """
    return max(1, -(-width // picture_width_px))


def picture_shape(height: int, width: int, block: int) -> tuple[int, int]:
    """Return rows and columns of a picture, 1 at least; pixels that fill no whole block are left out.

    Parameters
    ----------
    height, width
        Of the image, px.
    block
        Side of a block, px.
    """
    return max(height // block, 1), max(width // block, 1)


def mean_codes(image: UInt8, block: int) -> UInt8:
    """Return the mean of each block of an image of 8-bit codes, rounded to codes.

    Parameters
    ----------
    image
        (H, W, C).
    block
        Side of a block, px.

    Returns
    -------
    ndarray of uint8
        (h, w, C); halves are rounded to even.
    """
    rows, columns = picture_shape(image.shape[0], image.shape[1], block)
    height, width = _side(image.shape[0], block), _side(image.shape[1], block)
    codes = np.ascontiguousarray(image).view()
    codes.flags.writeable = False  # as decoded images are: the kernel is compiled for one kind of array
    return np.rint(_means_of_codes(codes, rows, columns, height, width)).astype(np.uint8)


def mean_values(image: NDArray[Any], block: int) -> Float32:
    """Return the mean of the finite values of each block of an image.

    Parameters
    ----------
    image
        (H, W) or (H, W, C), in any unit.
    block
        Side of a block, px.

    Returns
    -------
    ndarray of float32
        (h, w) or (h, w, C) in the unit of the image; NaN for blocks without a finite value.
    """
    rows, columns = picture_shape(image.shape[0], image.shape[1], block)
    height, width = _side(image.shape[0], block), _side(image.shape[1], block)
    values = np.ascontiguousarray(image, dtype=np.float32).reshape(*image.shape[:2], -1).view()
    values.flags.writeable = False  # as decoded images are: the kernel is compiled for one kind of array
    means = _finite_means(values, rows, columns, height, width)
    return means.reshape(rows, columns, *image.shape[2:])


def events_of_pixels(x: NDArray[Any], y: NDArray[Any], p: NDArray[Any], size: tuple[int, int], block: int) -> UInt16:
    """Return the number of events of each polarity in each block of a sensor's pixels: (2, h, w), at most 65535.

    Parameters
    ----------
    x, y
        (n,) columns and rows; events outside of the sensor do not count.
    p
        (n,) polarity, 0 darker, 1 brighter.
    size
        Height and width of the sensor, px.
    block
        Side of a block, px.
    """
    rows, columns = picture_shape(*size, block)
    # Pixels beyond the last whole block are left out.
    height, width = min(size[0], rows * block), min(size[1], columns * block)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height) & (p >= 0) & (p <= 1)
    x, y, p = x[inside], y[inside], p[inside].astype(np.intp)
    counts = np.bincount((p * rows + y // block) * columns + x // block, minlength=2 * rows * columns)
    return np.minimum(counts, _MOST_EVENTS).astype(np.uint16).reshape(2, rows, columns)


def summed_counts(counts: NDArray[np.integer[Any]], block: int) -> UInt16:
    """Return the sum of each block of counts: (..., h, w), at most 65535.

    Parameters
    ----------
    counts
        (..., H, W).
    block
        Side of a block, px.
    """
    *before, height, width = counts.shape
    rows, columns = picture_shape(height, width, block)
    high, wide = _side(height, block), _side(width, block)
    blocks = counts[..., : rows * high, : columns * wide].reshape(*before, rows, high, columns, wide)
    totals = blocks.sum(axis=(-3, -1), dtype=np.int64)
    return cast(UInt16, np.minimum(totals, _MOST_EVENTS).astype(np.uint16))


def _side(size: int, block: int) -> int:
    return min(size, block)


@njit(cache=True)
def _finite_means(image: Float32, rows: int, columns: int, height: int, width: int) -> Float32:
    """Return the means (rows, columns, c) of the finite values of blocks of an image (H, W, c); NaN where none is.

    ``height`` and ``width`` are those of a block. Sums are taken in single precision along columns, in double of them.
    """
    channels = image.shape[2]
    lines = image.reshape(image.shape[0], image.shape[1] * channels)
    wide, step = columns * width * channels, np.uint64(channels)  # a signed index costs a comparison
    means = np.empty((rows, columns, channels), np.float32)
    sums, counts = np.empty(wide, np.float32), np.empty(wide, np.float32)
    for row in range(rows):
        sums[:], counts[:] = 0, 0
        for line_number in range(row * height, (row + 1) * height):
            line = lines[line_number]
            for i in range(wide):
                # False for NaN and infinity alike.
                finite = abs(line[i]) < np.inf
                sums[i] += line[i] if finite else np.float32(0)
                counts[i] += np.float32(1) if finite else np.float32(0)
        for column in range(columns):
            for channel in range(channels):
                position, total, count = np.uint64(column * width * channels + channel), 0.0, np.float32(0)
                for _ in range(width):
                    total += sums[position]
                    count += counts[position]
                    position += step
                means[row, column, channel] = total / count if count else np.nan
    return means


@njit(cache=True)
def _means_of_codes(image: UInt8, rows: int, columns: int, height: int, width: int) -> Float32:
    """Return the means (rows, columns, C) of blocks of an image (H, W, C); arguments as of ``_finite_means``."""
    channels = image.shape[2]
    lines = image.reshape(image.shape[0], image.shape[1] * channels)
    means, sums = np.empty((rows, columns, channels), np.float32), np.empty(columns * width * channels, np.uint32)
    for row in range(rows):
        sums[:] = 0
        for line_number in range(row * height, (row + 1) * height):
            line = lines[line_number]
            for i in range(len(sums)):
                sums[i] += line[i]
        for column in range(columns):
            for channel in range(channels):
                position, total = np.uint64(column * width * channels + channel), np.uint64(0)
                for _ in range(width):
                    total += np.uint64(sums[position])
                    position += np.uint64(channels)
                means[row, column, channel] = total / np.float64(height * width)
    return means


@njit(cache=True)
def add_events(counts: UInt32, columns: NDArray[Any], rows: NDArray[Any]) -> None:
    """Add events to the counts of their pixels, in place.

    Parameters
    ----------
    counts
        (H, W).
    columns, rows
        (n,); events outside of the array do not count.
    """
    height, width = counts.shape
    for i in range(len(rows)):
        if 0 <= columns[i] < width and 0 <= rows[i] < height:
            counts[rows[i], columns[i]] += np.uint32(1)
