"""Compiled loops over the pixels of a colour frame: luma, and where it may be cut off."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
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
def cut_off(rgb: UInt8, luma: Float32, saturated: float) -> NDArray[np.bool_]:
    """Return where any channel is at 255, or luma at least at a level, (H, W)."""
    height, width = luma.shape
    lost = np.empty((height, width), np.bool_)
    most, level = np.uint8(255), np.float32(saturated)
    for row in range(height):
        codes, values, into = rgb[row], luma[row], lost[row]
        if not (_any_code(codes.reshape(3 * width), most) or _any_from(values, level)):
            into[:] = False
            continue
        for column in range(width):
            code = max(codes[column, 0], codes[column, 1], codes[column, 2])
            into[column] = (code == most) | (values[column] >= level)
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
