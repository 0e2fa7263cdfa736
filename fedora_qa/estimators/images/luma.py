"""Luma of colour frames, where frames may be clipped, and transfer curves from codes to linear values."""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB

Bools = NDArray[np.bool_]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
UInt8 = NDArray[np.uint8]

LUMA_WEIGHTS: Final[Float64] = np.array(LUMA_WEIGHTS_RGB, dtype=np.float64)

LUMA_ROUNDING_VARIANCE_DN2: Final = sum(weight**2 for weight in LUMA_WEIGHTS_RGB) / 12
"""Variance of luma whose three channels are rounded to whole DN: each error is uniform over a step."""

TRANSFERS: Final = ("linear", "srgb", "gamma2.2")
"""The curves that a file can declare."""

WHITE_DN: Final = 255.0

_GAMMA: Final = 2.2
_SRGB_TOE: Final = 0.04045


def luma_table(linear_dn: NDArray[np.floating[Any]]) -> Float32:
    """Return the contribution of each code of a channel to the luma of linear R, G, B.

    Parameters
    ----------
    linear_dn
        (256,) linear value of each code, DN.

    Returns
    -------
    ndarray of float32
        (3, 256) DN.
    """
    # Y = 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601).
    return np.outer(LUMA_WEIGHTS_RGB, linear_dn).astype(np.float32)


@njit(cache=True)
def luma_of(rgb: UInt8, table: Float32) -> Float32:
    """Return the luma of a frame.

    Parameters
    ----------
    rgb
        (H, W, 3) codes.
    table
        (3, 256) contribution of each code of a channel to the luma, DN.

    Returns
    -------
    ndarray of float32
        (H, W) DN.
    """
    height, width = rgb.shape[:2]
    luma = np.empty((height, width), np.float32)
    red, green, blue = table[0], table[1], table[2]
    for row in range(height):
        codes, luma_row = rgb[row], luma[row]
        for column in range(width):
            luma_row[column] = red[codes[column, 0]] + green[codes[column, 1]] + blue[codes[column, 2]]
    return luma


@njit(cache=True)
def luma_of_linear(rgb: UInt8, weights: Float64) -> Float32:
    """Return the luma of a frame of linear codes, in half the time of ``luma_of`` and equal to it bit by bit.

    Parameters
    ----------
    rgb
        (H, W, 3) codes, which are linear values in DN.
    weights
        (3,) of R, G, B.

    Returns
    -------
    ndarray of float32
        (H, W) DN.
    """
    height, width = rgb.shape[:2]
    luma = np.empty((height, width), np.float32)
    red, green, blue = weights[0], weights[1], weights[2]
    for row in range(height):
        codes, luma_row = rgb[row].reshape(3 * width), luma[row]
        for column in range(width):  # products are rounded before they are added, as in a table of single precision
            of_red = np.float32(red * np.float64(codes[3 * column]))
            of_green = np.float32(green * np.float64(codes[3 * column + 1]))
            luma_row[column] = of_red + of_green + np.float32(blue * np.float64(codes[3 * column + 2]))
    return luma


@njit(cache=True)
def sampled_luma(rgb: UInt8, first: int, stride: int, weights: Float64) -> Float32:
    """Return the luma of the codes of a frame at every ``stride``-th row and column from ``first`` on.

    Codes are used as they are stored, for any transfer curve. Sums are rounded once.

    Parameters
    ----------
    rgb
        (H, W, 3) codes.
    first, stride
        First row and column that is read, and the distance to the next, px.
    weights
        (3,) of R, G, B.

    Returns
    -------
    ndarray of float32
        (h, w), in codes.
    """
    rows, columns = len(range(first, rgb.shape[0], stride)), len(range(first, rgb.shape[1], stride))
    luma = np.empty((rows, columns), np.float32)
    red, green, blue = weights[0], weights[1], weights[2]
    for row in range(rows):
        codes = rgb[first + row * stride]
        for column in range(columns):
            pixel = codes[first + column * stride]
            luma[row, column] = red * pixel[0] + green * pixel[1] + blue * pixel[2]
    return luma


@njit(cache=True)
def cut_off(rgb: UInt8, luma: Float32, saturated: float) -> Bools:
    """Return where any channel is 255, or luma is at least at a level.

    Parameters
    ----------
    rgb
        (H, W, 3) codes.
    luma
        (H, W) of the same frame, DN.
    saturated
        Level of the luma, DN.

    Returns
    -------
    ndarray of bool
        (H, W).
    """
    height, width = luma.shape
    clipped = np.empty((height, width), np.bool_)
    most, level = np.uint8(255), np.float32(saturated)
    for row in range(height):
        codes, values, clipped_row = rgb[row].reshape(3 * width), luma[row], clipped[row]
        # Most rows have no such pixel. Without an exit from the loop several pixels are compared at a time.
        any_clipped = np.uint8(0)
        for i in range(len(codes)):
            any_clipped |= np.uint8(codes[i] == most)
        for i in range(len(values)):
            any_clipped |= np.uint8(values[i] >= level)
        if not any_clipped:
            clipped_row[:] = False
            continue
        for column in range(width):
            is_most = (codes[3 * column] == most) | (codes[3 * column + 1] == most) | (codes[3 * column + 2] == most)
            clipped_row[column] = is_most | (values[column] >= level)
    return clipped


def to_linear(codes: Float64, transfer: str) -> Float64:
    """Return the linear values of codes.

    The curve is the identity, that of IEC 61966-2-1 (sRGB), or code^2.2 with white fixed.

    Parameters
    ----------
    codes
        Of any shape, 0 to 255; values beyond are clipped.
    transfer
        One of ``TRANSFERS``.

    Returns
    -------
    ndarray of float64
        DN, 0 to 255.

    Raises
    ------
    ValueError
        The transfer is unknown.
    """
    code = np.clip(np.asarray(codes, dtype=np.float64) / WHITE_DN, 0.0, 1.0)
    if transfer == "srgb":
        # IEC 61966-2-1: a linear toe up to 0.04045, then a power of 2.4 with an offset.
        code = np.where(code <= _SRGB_TOE, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    elif transfer == "gamma2.2":
        code = code**_GAMMA
    elif transfer != "linear":
        raise ValueError(f"Expected a transfer of {', '.join(TRANSFERS)}, got {transfer!r}")
    return WHITE_DN * code


def to_code(linear_dn: Float64, transfer: str) -> Float64:
    """Return the codes of linear values, not rounded: the inverse of `to_linear`.

    Parameters
    ----------
    linear_dn
        Of any shape, DN, 0 to 255; values beyond are clipped.
    transfer
        One of ``TRANSFERS``.

    Returns
    -------
    ndarray of float64
        Codes, 0 to 255.

    Raises
    ------
    ValueError
        The transfer is unknown.
    """
    value = np.clip(np.asarray(linear_dn, dtype=np.float64) / WHITE_DN, 0.0, 1.0)
    if transfer == "srgb":
        # Inverse of the curve of IEC 61966-2-1 in `to_linear`.
        value = np.where(value <= _SRGB_TOE / 12.92, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    elif transfer == "gamma2.2":
        value = value ** (1 / _GAMMA)
    elif transfer != "linear":
        raise ValueError(f"Expected a transfer of {', '.join(TRANSFERS)}, got {transfer!r}")
    return WHITE_DN * value
