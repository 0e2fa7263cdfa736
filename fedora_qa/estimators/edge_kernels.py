"""Compiled loops: where depth steps along one axis of an image, and profiles of a picture around such places."""

from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]


_SURELY_SMALL: Final = 0.45
"""Share of the least step below which neither a step nor the slopes beside it can make one together: a half, less what
the nearer side of another pair may differ by, and rounding."""


@njit(cache=True)
def find_steps(depth_m: NDArray[Any], down: bool, farthest_m: float, rounding: float, least: float) -> Int64:
    """Return rows and columns (2, n) of pixels after which inverse depth (H, W) steps to the right, or down.

    A step is more than ``least`` of the nearer side, beyond the slope beside it, and larger than those next to it.
    Depths count as known where they are nearer than ``farthest_m`` by more than ``rounding``.
    """
    height, width = depth_m.shape
    nearer_m, far_m, share = farthest_m * (1.0 - rounding), np.float32(farthest_m), np.float32(_SURELY_SMALL * least)
    here, after = np.empty(width, np.float32), np.empty(width, np.float32)
    large = np.zeros((3, width), np.bool_)
    found, count = np.empty((2, 1024), np.int64), 0
    _fill_in(depth_m[0], far_m, after)
    for line in range(height):
        here, after = after, here
        if line + 1 < height:
            _fill_in(depth_m[line + 1], far_m, after)
        # Of the steps to the right, those beside belong to the same line; of those downward, to the lines around.
        if down:
            _differ(here, after, share, large[line % 3])
            if line + 1 == height:
                large[line % 3] = False
            at, beside = line - 1, (large[(line - 2) % 3], large[(line - 1) % 3], large[line % 3])
        else:
            _differ(here[:-1], here[1:], share, large[0][1:])
            at, beside = line, (large[0], large[0][1:], large[0][2:])
        for column in range(0 if down else 1, width if down else width - 2):
            if not (beside[0][column] | beside[1][column] | beside[2][column]):
                continue
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
def _fill_in(depth_m: NDArray[Any], far_m: np.float32, filled_m: NDArray[np.float32]) -> None:
    """Write depths (W,), the farthest where none is known."""
    for column in range(len(filled_m)):
        depth = np.float32(depth_m[column])
        filled_m[column] = depth if (depth > 0) & (depth < far_m) else far_m


@njit(cache=True)
def _differ(
    one_m: NDArray[np.float32], other_m: NDArray[np.float32], share: np.float32, large: NDArray[np.bool_]
) -> None:
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
    image: NDArray[Any], differences: bool, starts: Float64, lines: Float64, groups: Int64, sums: Float64
) -> None:
    """Add profiles of an image (h, w) along its rows, each divided by its sum, to those of its group, (g, m).

    Parameters
    ----------
    differences
        Whether the absolute differences of neighbours in a row are meant, and not the image itself.
    starts, lines
        (n,) columns at which profiles of m samples begin, and their rows, px; between pixels linearly.
    """
    height, width = image.shape
    size = sums.shape[1]
    last = width - 2 if differences else width - 1
    samples, profile = np.empty(size + 1), np.empty(size)
    for i in range(len(starts)):
        first, line = int(np.floor(starts[i])), int(np.floor(lines[i]))
        part_along, part_across = starts[i] - first, lines[i] - line
        under = min(line + 1, height - 1)
        for k in range(size + 1):
            column = min(first + k, last)
            if differences:
                above = abs(np.float64(image[line, column + 1]) - np.float64(image[line, column]))
                below = abs(np.float64(image[under, column + 1]) - np.float64(image[under, column]))
            else:
                above, below = np.float64(image[line, column]), np.float64(image[under, column])
            samples[k] = above + part_across * (below - above)
        total = 0.0
        for k in range(size):
            profile[k] = samples[k] + part_along * (samples[k + 1] - samples[k])
            total += profile[k]
        if total > 0.0:
            of_group = sums[groups[i]]
            for k in range(size):
                of_group[k] += profile[k] / total
