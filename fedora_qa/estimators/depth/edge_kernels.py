"""Compiled loops: where depth steps along one axis of an image, and profiles of a picture around such places."""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]


_SURELY_SMALL: Final = 0.45
"""Share of the least step below which neither a step nor the slopes beside it can make one together: a half, less what
the nearer side of another pair may differ by, and rounding."""


@njit(cache=True)
def find_steps(
    depth_m: NDArray[Any], down: bool, every: int, farthest_m: float, rounding: float, least: float
) -> Int64:
    """Return rows and columns (2, n) of pixels after which inverse depth (H, W) steps to the right, or down.

    Looked at is every so many-th line of pixels along that way.

    A step is more than ``least`` of the nearer side, beyond the slope beside it, and larger than those next to it.
    Depths count as known where they are nearer than ``farthest_m`` by more than ``rounding``.
    """
    height, width = depth_m.shape
    nearer_m, far_m, share = farthest_m * (1.0 - rounding), np.float32(farthest_m), np.float32(_SURELY_SMALL * least)
    step = every if down else 1  # between the columns that are looked at
    seen = (width + step - 1) // step
    here, after = np.empty(seen, np.float32), np.empty(seen, np.float32)
    large = np.zeros((3, seen), np.bool_)
    found, count = np.empty((2, 1024), np.int64), 0
    _fill_in(depth_m[0], step, far_m, after)
    for line in range(0, height, 1 if down else every):
        if not down:
            _fill_in(depth_m[line], step, far_m, here)
        else:
            here, after = after, here
            if line + 1 < height:
                _fill_in(depth_m[line + 1], step, far_m, after)
        # Of the steps to the right, those beside belong to the same line; of those downward, to the lines around.
        if down:
            _differ(here, after, share, large[line % 3])
            if line + 1 == height:
                large[line % 3] = False
            at, beside = line - 1, (large[(line - 2) % 3], large[(line - 1) % 3], large[line % 3])
        else:
            _differ(here[:-1], here[1:], share, large[0][1:])
            at, beside = line, (large[0], large[0][1:], large[0][2:])
        for place in range(0 if down else 1, seen if down else width - 2):
            if not (beside[0][place] | beside[1][place] | beside[2][place]):
                continue
            column = place * step
            size = _step_at(depth_m, at, column, down, farthest_m, nearer_m)
            if not size > least:
                continue
            earlier = _step_at(depth_m, at - down, column - (not down), down, farthest_m, nearer_m)
            later = _step_at(depth_m, at + down, column + (not down), down, farthest_m, nearer_m)
            if size >= earlier and size > later:
                if count == found.shape[1]:
                    found = np.concatenate((found, np.empty_like(found)), axis=1)
                found[0, count], found[1, count] = at, column
                count += 1
    return found[:, :count]


@njit(cache=True)
def _fill_in(depth_m: NDArray[Any], step: int, far_m: np.float32, filled_m: Float32) -> None:
    """Write every so many-th depth (W,), the farthest where none is known."""
    for column in range(len(filled_m)):
        depth = np.float32(depth_m[column * step])
        filled_m[column] = depth if (depth > 0) & (depth < far_m) else far_m


@njit(cache=True)
def _differ(one_m: Float32, other_m: Float32, share: np.float32, large: NDArray[np.bool_]) -> None:
    """Write whether depths differ by more than a share: (1/a - 1/b) / (1/a) is (b - a) / b."""
    for column in range(len(one_m)):
        one, other = one_m[column], other_m[column]
        large[column] = abs(other - one) > share * max(one, other)


@njit(cache=True)
def _inverse(depth_m: NDArray[Any], row: int, column: int, farthest_m: float, nearer_m: float) -> tuple[float, bool]:
    """Return inverse depth, and whether it is known."""
    depth = np.float64(depth_m[row, column])
    known = bool((depth > 0.0) & (depth < nearer_m))
    return 1.0 / depth if known else 1.0 / farthest_m, known


@njit(cache=True)
def _step_at(depth_m: NDArray[Any], row: int, column: int, down: bool, farthest_m: float, nearer_m: float) -> float:
    """Return the relative step from a pixel to the next, less the slope of the surface beside it; 0 at the border."""
    place, size = (row, depth_m.shape[0]) if down else (column, depth_m.shape[1])
    if not 0 < place < size - 2:
        return 0.0
    by_row, by_column = (1, 0) if down else (0, 1)
    a, knows_a = _inverse(depth_m, row - by_row, column - by_column, farthest_m, nearer_m)
    b, knows_b = _inverse(depth_m, row, column, farthest_m, nearer_m)
    c, knows_c = _inverse(depth_m, row + by_row, column + by_column, farthest_m, nearer_m)
    d, knows_d = _inverse(depth_m, row + 2 * by_row, column + 2 * by_column, farthest_m, nearer_m)
    between = c - b
    left = b - a if knows_a & knows_b else np.inf
    right = d - c if knows_c & knows_d else np.inf
    gentler = left if abs(left) < abs(right) else right
    if abs(gentler) == np.inf:
        gentler = 0.0
    if not knows_b & knows_c:
        # Out of range inverse depth stays where it is: of a slope towards it, no more than the way there was to be
        # seen.
        gentler = min(max(gentler, min(between, 0.0)), max(between, 0.0))
    return abs(between - gentler) / max(b, c)


@njit(cache=True)
def add_profiles(
    values: Float32, origin: int, along: int, across: int, size: tuple[int, int], differences: bool, first_px: float,
    at_along: Float64, at_across: Float64, near_first: NDArray[np.bool_], tiles: int, sums: Float64,
) -> None:  # fmt: skip
    """Add profiles of an image along one axis, each divided by its sum, to those of its side and tile, (2, t, t, m).

    Parameters
    ----------
    values, origin, along, across
        Of an image, all in one row (h * w,): where it begins, and the way to the next sample along and across.
    size
        How many samples lie along and across.
    differences
        Whether the absolute differences of neighbours along the axis are meant, and not the image itself.
    first_px
        Where the first sample lies along the axis.
    at_along, at_across, near_first
        (n,) places around which profiles of m samples are read, px, between samples linearly, and their sides. Those
        whose profile would leave the image are left out. Tiles are counted across first.
    """
    m = sums.shape[3]
    length, lines = size[0] - differences, size[1]
    samples, under, profile = np.empty(m + 1), np.empty(m + 1), np.empty(m)
    for i in range(len(at_along)):
        start, line = at_along[i] - first_px - (m // 2), at_across[i]
        if not (start >= 0 and start + m - 1 <= length - 1 and 0 <= line <= lines - 1):
            continue
        first, upper = int(start), int(line)
        part_along, part_across = start - first, line - upper
        _read(values, origin + upper * across + first * along, along, length - first, differences, samples)
        if part_across > 0:
            _read(values, origin + (upper + 1) * across + first * along, along, length - first, differences, under)
            for k in range(m + 1):
                samples[k] += part_across * (under[k] - samples[k])
        total = 0.0
        for k in range(m):
            profile[k] = samples[k] + part_along * (samples[k + 1] - samples[k])
            total += profile[k]
        if total > 0.0:
            side, column = int(near_first[i]), min(int(at_along[i] * tiles / length), tiles - 1)
            of_tile = sums[side, min(int(line * tiles / lines), tiles - 1), column]
            for k in range(m):
                of_tile[k] += profile[k] / total


@njit(cache=True)
def _read(values: Float32, start: int, along: int, count: int, differences: bool, samples: Float64) -> None:
    """Write samples from a place on, the last of ``count`` again and again beyond it."""
    for k in range(len(samples)):
        place = start + min(k, count - 1) * along
        value = np.float64(values[place])
        samples[k] = abs(np.float64(values[place + along]) - value) if differences else value


@njit(cache=True)
def root_counts(columns: Int64, rows: Int64, height: int, width: int) -> Float32:
    """Return the square root of how many of some points (n,) lie in each pixel, (H, W)."""
    counts = np.zeros((height, width), np.float32)
    for i in range(len(rows)):
        if 0 <= columns[i] < width and 0 <= rows[i] < height:
            counts[rows[i], columns[i]] -= 1
    for i in range(len(rows)):
        if 0 <= columns[i] < width and 0 <= rows[i] < height:
            count = counts[rows[i], columns[i]]
            counts[rows[i], columns[i]] = np.sqrt(-count) if count < 0 else count  # else its root has been taken
    return counts
