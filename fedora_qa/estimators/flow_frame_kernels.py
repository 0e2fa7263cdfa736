"""Compiled reading of a colour frame between pixels: only what lies about the places that are asked for is made.

Its luma is smoothed by a Gaussian and read by a cubic B-spline, as ``flow_warp`` does with a whole image.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.flow_warp_kernels import mirrored, read_spline_at, spline_weights, within

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
    """Read a part of an image at places (s, s) of which all lie within it, away from the border."""
    for j in range(len(read)):
        for k in range(len(columns[j])):
            x, y = columns[j, k] - left, rows[j, k] - top
            # Unsigned: an index that may be negative costs a comparison each.
            column, row = np.uint64(np.int64(x)), np.uint64(np.int64(y))
            a, b, c, d = spline_weights(x - np.float32(column))
            down = spline_weights(y - np.float32(row))
            total, first = np.float32(0), column - np.uint64(1)
            for m in range(4):
                line = smoothed[row - np.uint64(1) + np.uint64(m)]
                total += down[m] * (
                    a * line[first]
                    + b * line[first + np.uint64(1)]
                    + c * line[first + np.uint64(2)]
                    + d * line[first + np.uint64(3)]
                )
            read[j, k] = total


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
        for k in range(inner[0], inner[1]):
            line[k] = red[of_row[first + k, 0]] + green[of_row[first + k, 1]] + blue[of_row[first + k, 2]]
        for k in range(inner[0]):
            line[k] = line[-2 * first - k]
        for k in range(inner[1], len(line)):
            line[k] = line[2 * inner[1] - 2 - k]
    return luma


@njit(cache=True)
def _smooth(luma: Float32, taps: Float32, smoothed: Float32) -> None:
    """Write an image less the reach of the taps on every side, convolved with them along both axes."""
    reach = len(taps) // 2
    across = np.zeros((len(luma), luma.shape[1] - 2 * reach), np.float32)
    for j in range(len(across)):
        into, line = across[j], luma[j]
        for m in range(len(taps)):
            tap, shifted = taps[m], line[m:]
            for k in range(len(into)):
                into[k] += tap * shifted[k]
    smoothed[:] = 0
    for j in range(len(smoothed)):
        into = smoothed[j]
        for m in range(len(taps)):
            tap, line = taps[m], across[j + m]
            for k in range(len(into)):
                into[k] += tap * line[k]
