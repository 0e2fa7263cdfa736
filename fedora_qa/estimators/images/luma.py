"""Compiled loops over the pixels of a colour frame: luma, and where it may be cut off."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
UInt8 = NDArray[np.uint8]


@njit(cache=True)
def luma_of(rgb: UInt8, of_codes: Float32) -> Float32:
    """Return the luma (H, W) of a frame (H, W, 3), from what each code adds to it, (3, 256)."""
    height, width = rgb.shape[:2]
    luma = np.empty((height, width), np.float32)
    red, green, blue = of_codes[0], of_codes[1], of_codes[2]
    for row in range(height):
        codes, into = rgb[row], luma[row]
        for column in range(width):
            into[column] = red[codes[column, 0]] + green[codes[column, 1]] + blue[codes[column, 2]]
    return luma


@njit(cache=True)
def luma_of_linear(rgb: UInt8, weights: Float64) -> Float32:
    """Return the same, to the bit, where a code adds itself times its channel's weight (3,): half the time."""
    height, width = rgb.shape[:2]
    luma = np.empty((height, width), np.float32)
    red, green, blue = weights[0], weights[1], weights[2]
    for row in range(height):
        codes, into = rgb[row].reshape(3 * width), luma[row]
        for column in range(width):  # each is rounded before they are added, as a table of single precision holds them
            of_red = np.float32(red * np.float64(codes[3 * column]))
            of_green = np.float32(green * np.float64(codes[3 * column + 1]))
            into[column] = of_red + of_green + np.float32(blue * np.float64(codes[3 * column + 2]))
    return luma


@njit(cache=True)
def cut_off(rgb: UInt8, luma: Float32, saturated: float) -> NDArray[np.bool_]:
    """Return where any channel is at 255, or luma at least at a level, (H, W)."""
    height, width = luma.shape
    lost = np.empty((height, width), np.bool_)
    most, level = np.uint8(255), np.float32(saturated)
    for row in range(height):
        codes, values, into = rgb[row].reshape(3 * width), luma[row], lost[row]
        if not (_any_code(codes, most) or _any_from(values, level)):
            into[:] = False
            continue
        for column in range(width):
            is_most = (codes[3 * column] == most) | (codes[3 * column + 1] == most) | (codes[3 * column + 2] == most)
            into[column] = is_most | (values[column] >= level)
    return lost


@njit(cache=True)
def _any_code(codes: UInt8, wanted: np.uint8) -> bool:
    """Return whether a code is among those of a row: all are looked at, many at a time."""
    found = np.uint8(0)
    for i in range(len(codes)):
        found |= np.uint8(codes[i] == wanted)
    return bool(found)


@njit(cache=True)
def _any_from(values: Float32, level: np.float32) -> bool:
    found = np.uint8(0)
    for i in range(len(values)):
        found |= np.uint8(values[i] >= level)
    return bool(found)
