"""Read images between pixels, with a negligible error of interpolation.

Both frames are read through one kernel: a Gaussian and a cubic B-spline, together of variance 1 px^2. If the image is
*not* prefiltered, a B-spline gives the exact value, between the pixels too, of the image smoothed by that spline, up to
aliases. The spline attenuates aliases by (w / (2 pi - w))^4 at frequency w. Bilinear interpolation attenuates them by
the square only, which shifts values by some hundredths of a pixel at quarter-pixel positions.

A compiled loop sums the 16 coefficients of the spline. docs/flow-interpolation.md compares this with other methods.
"""

from functools import cache
from typing import Final

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Int64 = NDArray[np.int64]
Colours = NDArray[np.uint8]

SPLINE_VARIANCE_PX2: Final = 1.0 / 3.0
"""Variance of the cubic B-spline."""

_SPLINE_AT_PIXELS: Final = np.array([1 / 6, 4 / 6, 1 / 6], dtype=np.float32)


def smooth(image: Float32, sigma_px: float = 1.0) -> Float32:
    """Return an image blurred by the Gaussian that has the width ``sigma_px`` together with the B-spline.

    Parameters
    ----------
    image
        (H, W) of any unit.
    sigma_px
        Standard deviation of Gaussian and B-spline together, px.

    Returns
    -------
    ndarray of float32
        (H, W), mirrored beyond the border.
    """
    taps = smoothing_taps(sigma_px)
    return np.asarray(cv2.sepFilter2D(image, cv2.CV_32F, taps, taps, borderType=cv2.BORDER_REFLECT_101))


@cache
def smoothing_taps(sigma_px: float = 1.0) -> Float32:
    """Return the weights (n,), of sum 1, of the Gaussian of ``smooth``, cut at four standard deviations."""
    # sigma^2 = sigma_px^2 - 1/3: variances of kernels that are applied in turn add up.
    sigma = float(np.sqrt(max(sigma_px**2 - SPLINE_VARIANCE_PX2, 1e-6)))
    return np.asarray(cv2.getGaussianKernel(round(8 * sigma + 1) | 1, sigma, cv2.CV_32F), dtype=np.float32)[:, 0]


@cache
def taps_at_pixels(sigma_px: float = 1.0) -> Float32:
    """Return the weights (n,), of sum 1, of Gaussian and B-spline together: the kernel of a read at a pixel centre."""
    return np.convolve(smoothing_taps(sigma_px), _SPLINE_AT_PIXELS)


def read_at_pixels(smoothed: Float32) -> Float32:
    """Return the values (H, W) of `read_between` at all pixel centres of a smoothed image (H, W)."""
    spline = _SPLINE_AT_PIXELS
    read = cv2.sepFilter2D(smoothed, cv2.CV_32F, spline, spline, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(read, dtype=np.float32)


def read_between(smoothed: Float32, columns: Float32, rows: Float32) -> Float32:
    """Return the B-spline of an image at any positions.

    Parameters
    ----------
    smoothed
        (H, W) coefficients of the B-spline: an image from `smooth`.
    columns, rows
        (n, m) positions, px; beyond the image those of its border are read.

    Returns
    -------
    ndarray of float32
        (n, m) in the unit of the image.
    """
    return np.asarray(read_spline(smoothed, columns, rows), dtype=np.float32)


@njit(cache=True)
def read_spline(
    coefficients: NDArray[np.float32], columns: NDArray[np.float32], rows: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the B-spline of coefficients at positions.

    Parameters
    ----------
    coefficients
        (H, W) of any unit.
    columns, rows
        (n, m) positions, px; beyond the image those of its border are read, and 0 in place of NaN.

    Returns
    -------
    ndarray of float32
        (n, m) in the unit of the coefficients.
    """
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
    """Return the B-spline at a position within an image of whose coefficients a part is given.

    Parameters
    ----------
    coefficients
        (h, w) the part. It holds one pixel before the position and two after it, as far as these lie in the image.
    x, y
        Position in the image, px, at least 0.
    left, top
        First column and row of the part, px.
    width, height
        Of the image, px.

    Returns
    -------
    float32
        In the unit of the coefficients.
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
    """Return a position limited to the pixels of an image along one axis.

    Parameters
    ----------
    position
        Column or row, px.
    size
        Width or height of the image, px.

    Returns
    -------
    float32
        0 to ``size`` - 1; 0 where the position is NaN.
    """
    if not position > np.float32(0):
        return np.float32(0)
    return position if position < np.float32(size - 1) else np.float32(size - 1)


# Its own arithmetic: without a setting it would have that of the caller for which it is compiled first.
@njit(cache=True, fastmath=False)
def spline_weights(t: np.float32) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return the weights of the pixels -1, 0, 1 and 2 for a position that is a fraction t, 0 to 1, after pixel 0."""
    rest = np.float32(1) - t
    # Cubic B-spline at t: (1 - t)^3 / 6, (3 t^3 - 6 t^2 + 4) / 6 and their mirror images; their sum is 1
    # (C. de Boor, A Practical Guide to Splines, 2001).
    first, last = rest * rest * rest / np.float32(6), t * t * t / np.float32(6)
    second = (t * t * (np.float32(3) * t - np.float32(6)) + np.float32(4)) / np.float32(6)
    return first, second, np.float32(1) - first - second - last, last


@njit(cache=True)
def mirrored(index: int, size: int) -> int:
    """Return the index of the pixel that stands for one at most a few pixels outside an image.

    Parameters
    ----------
    index
        Column or row.
    size
        Width or height of the image, px.

    Returns
    -------
    int
        0 to ``size`` - 1, mirrored about the first or last pixel.
    """
    if size == 1:
        return 0
    index = abs(index)
    return index if index < size else max(2 * size - 2 - index, 0)


@njit(cache=True)
def parts_about(columns: Float32, rows: Float32, width: int, height: int) -> Int64:
    """Return the part of an image that each tile of positions is read from.

    Parameters
    ----------
    columns, rows
        (n, s, s) positions, px; those beyond the image count as its border.
    width, height
        Of the image, px.

    Returns
    -------
    ndarray of int64
        (n, 4) left, top, right, bottom, half-open, px.
    """
    parts = np.empty((len(columns), 4), np.int64)
    for i in range(len(columns)):
        left, top, right, bottom = np.float32(width), np.float32(height), np.float32(0), np.float32(0)
        for j in range(columns.shape[1]):
            for k in range(columns.shape[2]):
                x, y = within(columns[i, j, k], width), within(rows[i, j, k], height)
                left, right = min(left, x), max(right, x)
                top, bottom = min(top, y), max(bottom, y)
        # The spline reads one pixel before a position and two after it; the ends are half-open.
        parts[i, 0], parts[i, 1] = max(int(left) - 1, 0), max(int(top) - 1, 0)
        parts[i, 2], parts[i, 3] = min(int(right) + 3, width), min(int(bottom) + 3, height)
    return parts


@njit(cache=True)
def read_parts(
    rgb: Colours, of_codes: Float32, taps: Float32, parts: Int64, columns: Float32, rows: Float32
) -> Float32:
    """Return the smoothed luma of a frame at positions, each tile of them read from its part.

    Parameters
    ----------
    rgb
        (H, W, 3) codes; the frame is mirrored beyond its border.
    of_codes
        (3, 256) contribution of each code of a channel to the luma, DN.
    taps
        Odd number of weights of the Gaussian.
    parts
        (n, 4) left, top, right, bottom of the part of each tile, of `parts_about`.
    columns, rows
        (n, s, s) positions, px.

    Returns
    -------
    ndarray of float32
        (n, s, s) DN.
    """
    height, width = rgb.shape[:2]
    read = np.empty(columns.shape, np.float32)
    for i in range(len(parts)):
        left, top = parts[i, 0], parts[i, 1]
        smoothed = np.empty((parts[i, 3] - top, parts[i, 2] - left), np.float32)
        _smooth(_luma_about(rgb, of_codes, parts[i], len(taps) // 2), taps, smoothed)
        if left > 0 and top > 0 and parts[i, 2] < width and parts[i, 3] < height:
            _read_inside(smoothed, np.float32(left), np.float32(top), columns[i], rows[i], read[i])
            continue
        for j in range(columns.shape[1]):
            for k in range(columns.shape[2]):
                x, y = within(columns[i, j, k], width), within(rows[i, j, k], height)
                read[i, j, k] = read_spline_at(smoothed, x, y, left, top, width, height)
    return read


@njit(cache=True, fastmath={"contract"})
def _read_inside(
    smoothed: Float32, left: np.float32, top: np.float32, columns: Float32, rows: Float32, read: Float32
) -> None:
    """Read a part of an image at positions (s, s) all of which lie within it, away from the border.

    Each row takes two loops. The first computes indices and weights of many positions at once, the second reads the
    values.
    """
    side, wide = columns.shape[1], np.uint64(smoothed.shape[1])
    values, firsts, weights = smoothed.reshape(-1), np.empty(side, np.uint32), np.empty((8, side), np.float32)
    a, b, c, d, e, f, g, h = weights
    for j in range(len(read)):
        at_columns, at_rows, into = columns[j], rows[j], read[j]
        for k in range(side):
            x, y = at_columns[k] - left, at_rows[k] - top
            column, row = np.int32(x), np.int32(y)
            firsts[k] = (row - np.int32(1)) * np.int32(smoothed.shape[1]) + column - np.int32(1)
            a[k], b[k], c[k], d[k] = spline_weights(x - np.float32(column))
            e[k], f[k], g[k], h[k] = spline_weights(y - np.float32(row))
        for k in range(side):
            at = np.uint64(firsts[k])  # unsigned: an index that may be negative costs a comparison
            across, total = (a[k], b[k], c[k], d[k]), np.float32(0)
            for down in (e[k], f[k], g[k], h[k]):
                total += down * (
                    across[0] * values[at]
                    + across[1] * values[at + np.uint64(1)]
                    + across[2] * values[at + np.uint64(2)]
                    + across[3] * values[at + np.uint64(3)]
                )
                at += wide
            into[k] = total


@njit(cache=True)
def smoothed_patches(rgb: Colours, of_codes: Float32, taps: Float32, corners: Int64, size: int) -> Float32:
    """Return the smoothed luma of patches of a frame.

    Parameters
    ----------
    rgb
        (H, W, 3) codes; the frame is mirrored beyond its border.
    of_codes
        (3, 256) contribution of each code of a channel to the luma, DN.
    taps
        Odd number of weights of the Gaussian.
    corners
        (n, 2) first column and row of each patch.
    size
        Side of a patch, px.

    Returns
    -------
    ndarray of float32
        (n, size, size) DN.
    """
    patches = np.empty((len(corners), size, size), np.float32)
    part = np.empty(4, np.int64)
    for i in range(len(corners)):
        part[0], part[1], part[2], part[3] = corners[i, 0], corners[i, 1], corners[i, 0] + size, corners[i, 1] + size
        _smooth(_luma_about(rgb, of_codes, part, len(taps) // 2), taps, patches[i])
    return patches


@njit(cache=True)
def _luma_about(rgb: Colours, of_codes: Float32, part: Int64, reach: int) -> Float32:
    """Return the luma of a part (left, top, right, bottom) of a frame and of ``reach`` pixels around it, DN."""
    height, width = rgb.shape[:2]
    red, green, blue = of_codes[0], of_codes[1], of_codes[2]
    luma = np.empty((part[3] - part[1] + 2 * reach, part[2] - part[0] + 2 * reach), np.float32)
    first = part[0] - reach
    inner = max(-first, 0), min(width - first, luma.shape[1])
    for j in range(len(luma)):
        of_row, line = rgb[mirrored(part[1] - reach + j, height)], luma[j]
        codes, within_image = of_row[max(first, 0) :], line[inner[0] : inner[1]]
        for k in range(len(within_image)):
            within_image[k] = red[codes[k, 0]] + green[codes[k, 1]] + blue[codes[k, 2]]
        for k in range(inner[0]):
            line[k] = line[-2 * first - k]
        for k in range(inner[1], len(line)):
            line[k] = line[2 * inner[1] - 2 - k]
    return luma


@njit(cache=True, fastmath={"contract"})
def _smooth(luma: Float32, taps: Float32, smoothed: Float32) -> None:
    """Write an image less the reach of the taps on every side, convolved with the taps along both axes.

    The taps are symmetric, so that two pixels share one multiplication. Slices begin at 0 and indices are not negative:
    a comparison for each pixel would cost more than its arithmetic.
    """
    reach = len(taps) // 2
    wide, middle = luma.shape[1] - 2 * reach, taps[reach]
    across = np.empty((len(luma), wide), np.float32)
    for j in range(len(across)):
        into, line = across[j], luma[j]
        centre = line[reach:]
        for k in range(wide):
            into[k] = middle * centre[k]
        for m in range(reach):
            tap, left, right = taps[m], line[m:], line[2 * reach - m :]
            for k in range(wide):
                into[k] += tap * (left[k] + right[k])
    for j in range(len(smoothed)):
        into, centre = smoothed[j], across[j + reach]
        for k in range(wide):
            into[k] = middle * centre[k]
        for m in range(reach):
            tap, above, below = taps[m], across[j + m], across[j + 2 * reach - m]
            for k in range(wide):
                into[k] += tap * (above[k] + below[k])
