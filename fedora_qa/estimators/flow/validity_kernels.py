"""Compiled pass over a field of flow and its depth: where either has values and the other has none."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]

_INFINITE = np.float32(np.inf)
_INFINITE_BITS = np.int32(0x7F800000)
"""Infinity in single precision; whatever else has these bits is infinite or no number."""


@njit(cache=True)
def compare_patterns(lines: Float32, depth_m: Float32, standing_m: Float32) -> tuple[int, int, int]:
    """Count pixels that have a flow and no depth, a depth that stands and no flow, and an infinite flow.

    Flow comes as lines (H, 2 W) of u and v, depths as (H, W): each is one if it is finite and positive. NaN in
    ``standing_m`` says that it moves by itself. Pixels are counted one by one only in rows where any is odd.
    """
    unfounded, missing, infinite = 0, 0, 0
    for row in range(len(depth_m)):
        line, depths, standing = lines[row], depth_m[row], standing_m[row]
        if not _is_odd(line, depths):
            continue
        for column in range(len(depths)):
            u, v = line[2 * column], line[2 * column + 1]
            present = np.isfinite(u) and np.isfinite(v)
            valid = depths[column] > 0 and np.isfinite(depths[column])
            unfounded += present and not valid
            missing += valid and not present and np.isfinite(standing[column])
            infinite += np.isinf(u) or np.isinf(v)
    return unfounded, missing, infinite


@njit(cache=True)
def _is_odd(line: Float32, depths: Float32) -> bool:
    """Whether any flow is infinite, or there where no depth is, or not there where one is."""
    odd = np.int32(0)
    for column in range(len(depths)):
        u, v = abs(line[2 * column]), abs(line[2 * column + 1])
        present, valid = (u < _INFINITE) & (v < _INFINITE), (depths[column] > 0) & (depths[column] < _INFINITE)
        odd |= np.int32((present != valid) | (u == _INFINITE) | (v == _INFINITE))
    return bool(odd != 0)


def depth_range_m(depth_m: Float32, standing_m: Float32) -> tuple[float, float] | None:
    """Return the least and the largest depth (H, W) that is one and stands, m; None where none does.

    Positive numbers of single precision are in the order of their bits, read as whole numbers, which a machine compares
    many at a time; above all of them are infinity, and then those that are no number.
    """
    bits = (np.ascontiguousarray(values, dtype=np.float32).view(np.int32) for values in (depth_m, standing_m))
    least, largest = _range_of_bits(*bits)
    found = np.array([least, largest], dtype=np.int32).view(np.float32)
    return None if largest == 0 else (float(found[0]), float(found[1]))


@njit(cache=True)
def _range_of_bits(depths: NDArray[np.int32], standing: NDArray[np.int32]) -> tuple[np.int32, np.int32]:
    least, largest = _INFINITE_BITS, np.int32(0)
    for row in range(len(depths)):
        of_depth, of_standing = depths[row], standing[row]
        for column in range(len(of_depth)):
            bits = of_depth[column]
            counts = (bits > 0) & (bits < _INFINITE_BITS) & ((of_standing[column] & _INFINITE_BITS) != _INFINITE_BITS)
            least = min(least, bits if counts else _INFINITE_BITS)
            largest = max(largest, bits if counts else np.int32(0))
    return least, largest
