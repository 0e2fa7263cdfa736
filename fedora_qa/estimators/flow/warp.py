"""Read images between pixels, so smoothly that interpolation adds next to no error of its own.

Both frames are read through one kernel: a Gaussian and a cubic B-spline, together of variance 1 px^2. A B-spline read
of an image that was *not* prefiltered is the exact value, between the pixels too, of the image smoothed by that spline,
up to aliases that the spline weakens by (w / (2 pi - w))^4 at frequency w. Bilinear interpolation weakens them by the
square only, which shifts what it reads by some hundredths of a pixel at quarter-pixel positions.

A compiled loop sums the spline's 16 coefficients. docs/flow-interpolation.md measures this and other ways to read.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, TypeVar, cast

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Int64 = NDArray[np.int64]
Colours = NDArray[np.uint8]
Image = TypeVar("Image", bound=NDArray[Any])

REMAP_ROUNDING_PX: Final = 0.0 if int(cv2.__version__.split(".", maxsplit=1)[0]) >= 5 else 1 / 64
"""OpenCV 4 rounds the coordinates of bilinear reads to 1/32 px; OpenCV 5 does not (a test holds it to that)."""

SPLINE_VARIANCE_PX2: Final = 1.0 / 3.0
"""Variance of the cubic B-spline."""

_SPLINE_AT_PIXELS: Final = np.array([1 / 6, 4 / 6, 1 / 6], dtype=np.float32)

_MOST_ROWS: Final = 32_766
"""Below SHRT_MAX, which ``cv2.remap`` refuses. All tiles of a frame of 1440x1080 have 48,960 rows of pixels."""


def smooth(image: Float32, sigma_px: float = 1.0) -> Float32:
    """Return the image (H, W) blurred by the Gaussian that makes ``sigma_px`` together with the B-spline."""
    taps = smoothing_taps(sigma_px)
    return np.asarray(cv2.sepFilter2D(image, cv2.CV_32F, taps, taps, borderType=cv2.BORDER_REFLECT_101))


@cache
def smoothing_taps(sigma_px: float = 1.0) -> Float32:
    """Return the weights of that Gaussian, four standard deviations to either side, of sum 1."""
    # Variances of kernels that are applied in turn add up: that of the spline is taken off.
    sigma = float(np.sqrt(max(sigma_px**2 - SPLINE_VARIANCE_PX2, 1e-6)))
    return np.asarray(cv2.getGaussianKernel(round(8 * sigma + 1) | 1, sigma, cv2.CV_32F), dtype=np.float32)[:, 0]


@cache
def taps_at_pixels(sigma_px: float = 1.0) -> Float32:
    """Return the weights, of sum 1, of Gaussian and B-spline together: the kernel of a read at a pixel centre."""
    return np.convolve(smoothing_taps(sigma_px), _SPLINE_AT_PIXELS)


def read_at_pixels(smoothed: Float32) -> Float32:
    """Return what `read_between` gives at every pixel centre, (H, W)."""
    spline = _SPLINE_AT_PIXELS
    read = cv2.sepFilter2D(smoothed, cv2.CV_32F, spline, spline, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(read, dtype=np.float32)


def read_between(smoothed: Float32, columns: Float32, rows: Float32) -> Float32:
    """Return the B-spline of ``smoothed`` at any positions (n, m); beyond the image, that of its border."""
    return np.asarray(read_spline(smoothed, columns, rows), dtype=np.float32)


def blur(image: Float32, sigma_px: float = 1.0) -> Float32:
    """Return the image (H, W) blurred by a Gaussian, to be read by `read_bilinear`."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT_101), dtype=np.float32)


def read_bilinear(image: Float32, columns: Float32, rows: Float32) -> Float32:
    """Return an image bilinearly at any positions (n, m); positions must be finite, and read the border beyond it."""
    return read_at(image, columns, rows, cv2.INTER_LINEAR, cv2.BORDER_REFLECT_101)


@dataclass(frozen=True, slots=True)
class Interpolator:
    """One way to read frames between their pixels; docs/flow-interpolation.md measures them.

    Attributes
    ----------
    smoothed
        Image (H, W) and width in px to the image that is read.
    at_pixels
        What ``between`` gives at every pixel centre of that, (H, W).
    between
        That image and finite positions (n, m), columns and rows, px, to the values there.
    """

    smoothed: Callable[[Float32, float], Float32]
    at_pixels: Callable[[Float32], Float32]
    between: Callable[[Float32, Float32, Float32], Float32]


BILINEAR: Final = Interpolator(blur, lambda blurred: blurred, read_bilinear)
SPLINE: Final = Interpolator(smooth, read_at_pixels, read_between)


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
    # Cubic B-spline at t: (1 - t)^3 / 6, (3 t^3 - 6 t^2 + 4) / 6 and their mirror images; their sum is 1
    # (C. de Boor, A Practical Guide to Splines, 2001).
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


@njit(cache=True)
def parts_about(columns: Float32, rows: Float32, width: int, height: int) -> Int64:
    """Return left, top, right, bottom (n, 4), half-open, of the part of an image that places (n, s, s) are read from.

    Places beyond the image are those of its border.
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
    """Return the smoothed luma of a frame (H, W, 3) at places (n, s, s), each tile read from its part (n, 4).

    ``of_codes`` (3, 256) is what each code of a channel adds to the luma, ``taps`` the odd number of weights of the
    Gaussian. Beyond the border the frame is mirrored.
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
    """Read a part of an image at places (s, s) of which all lie within it, away from the border.

    Row by row first where and with what weights, of many places at once, then what lies there.
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
    """Return the smoothed luma (n, size, size) of patches of a frame, by their first columns and rows (n, 2)."""
    patches = np.empty((len(corners), size, size), np.float32)
    part = np.empty(4, np.int64)
    for i in range(len(corners)):
        part[0], part[1], part[2], part[3] = corners[i, 0], corners[i, 1], corners[i, 0] + size, corners[i, 1] + size
        _smooth(_luma_about(rgb, of_codes, part, len(taps) // 2), taps, patches[i])
    return patches


@njit(cache=True)
def _luma_about(rgb: Colours, of_codes: Float32, part: Int64, reach: int) -> Float32:
    """Return the luma of a part of a frame and of ``reach`` pixels around it."""
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
    """Write an image less the reach of the taps on every side, convolved with them along both axes.

    Taps are the same on both sides, so that two pixels share one. Slices begin at 0 and indices are none below, as a
    comparison for each pixel would cost more than what is done with it.
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


def read_at(
    image: Image, columns: Float32, rows: Float32, interpolation: int, border: int = cv2.BORDER_CONSTANT
) -> Image:
    """Return an image at positions between its pixels.

    Parameters
    ----------
    image
        (H, W).
    columns, rows
        (n, m) positions, of any n, and m below 32767.
    interpolation, border
        Flags of OpenCV: how values between pixels, and beyond the image, are made.

    Returns
    -------
    (n, m).
    """
    if not columns.size:
        return cast(Image, np.empty(columns.shape, image.dtype))
    parts = (slice(first, first + _MOST_ROWS) for first in range(0, len(columns), _MOST_ROWS))
    values = [cv2.remap(image, columns[part], rows[part], interpolation, borderMode=border) for part in parts]
    return cast(Image, values[0] if len(values) == 1 else np.concatenate(values))
