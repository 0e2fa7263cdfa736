"""Compiled reading of a colour frame between pixels: only what lies about the places that are asked for is made.

Its luma is smoothed by a Gaussian and read by a cubic B-spline, as ``flow_warp`` does with a whole image.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.flow.warp_kernels import mirrored, read_spline_at, spline_weights, within

Float32 = NDArray[np.float32]
Int64 = NDArray[np.int64]
Colours = NDArray[np.uint8]


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
