"""Compiled pass over a flow field and its depth: pixels where one of them has a value and the other has none."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]

_INFINITE = np.float32(np.inf)
_INFINITE_BITS = np.int32(0x7F800000)
"""Bits of infinity in single precision; any number whose exponent has these bits is infinite or NaN."""


@njit(cache=True)
def compare_patterns(lines: Float32, depth_m: Float32, static_m: Float32) -> tuple[int, int, int]:
    """Count pixels that have a flow and no depth, a static depth and no flow, and an infinite flow.

    Parameters
    ----------
    lines
        (H, 2 W) u and v of one pixel after another, px.
    depth_m, static_m
        (H, W) m; valid where finite and positive. ``static_m`` is NaN where an object moves by itself.

    Returns
    -------
    unfounded, missing, infinite
        The three counts, in pixels.
    """
    unfounded, missing, infinite = 0, 0, 0
    for row in range(len(depth_m)):
        line, depths, statics = lines[row], depth_m[row], static_m[row]
        # Few rows have a wrong pixel. A pass without branches finds these rows, and only their pixels are counted.
        if not _has_wrong_pixel(line, depths):
            continue
        for column in range(len(depths)):
            u, v = line[2 * column], line[2 * column + 1]
            present = np.isfinite(u) and np.isfinite(v)
            valid = depths[column] > 0 and np.isfinite(depths[column])
            unfounded += present and not valid
            missing += valid and not present and np.isfinite(statics[column])
            infinite += np.isinf(u) or np.isinf(v)
    return unfounded, missing, infinite


@njit(cache=True)
def _has_wrong_pixel(line: Float32, depths: Float32) -> bool:
    """Return whether any flow of a row is infinite, or present without a depth, or missing with one."""
    wrong = np.int32(0)
    for column in range(len(depths)):
        u, v = abs(line[2 * column]), abs(line[2 * column + 1])
        present, valid = (u < _INFINITE) & (v < _INFINITE), (depths[column] > 0) & (depths[column] < _INFINITE)
        wrong |= np.int32((present != valid) | (u == _INFINITE) | (v == _INFINITE))
    return bool(wrong != 0)


def depth_range_m(depth_m: Float32, static_m: Float32) -> tuple[float, float] | None:
    """Return the least and the largest valid static depth.

    Positive numbers of single precision are in the order of their bits, read as integers, which are compared several at
    a time. Infinity and then NaN are above all of them.

    Parameters
    ----------
    depth_m
        (H, W) m; valid where finite and positive.
    static_m
        (H, W) m; not finite where an object moves by itself.

    Returns
    -------
    tuple of float, or None
        Least and largest depth, m; None where no static depth is valid.
    """
    bits = (np.ascontiguousarray(values, dtype=np.float32).view(np.int32) for values in (depth_m, static_m))
    least, largest = _range_of_bits(*bits)
    range_m = np.array([least, largest], dtype=np.int32).view(np.float32)
    return None if largest == 0 else (float(range_m[0]), float(range_m[1]))


@njit(cache=True)
def _range_of_bits(depths: NDArray[np.int32], statics: NDArray[np.int32]) -> tuple[np.int32, np.int32]:
    least, largest = _INFINITE_BITS, np.int32(0)
    for row in range(len(depths)):
        depth_row, static_row = depths[row], statics[row]
        for column in range(len(depth_row)):
            bits = depth_row[column]
            counts = (bits > 0) & (bits < _INFINITE_BITS) & ((static_row[column] & _INFINITE_BITS) != _INFINITE_BITS)
            least = min(least, bits if counts else _INFINITE_BITS)
            largest = max(largest, bits if counts else np.int32(0))
    return least, largest
