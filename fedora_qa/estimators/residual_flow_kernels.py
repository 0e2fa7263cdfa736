"""Compiled pass over image tiles: the sums that the least squares of ``residual_flow`` need."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]


@njit(cache=True)
def sums_of_tiles(before: Float32, warped: Float32, valid: Mask, halo: int) -> Float64:
    """Return the sums (n, 5, 5) of products of five quantities over the valid pixels (n, s, s) of each tile.

    The slopes of the mean of two patches along columns and rows; 1; that mean, less its own mean; the second patch less
    the first. Patches (n, s + 2 halo, s + 2 halo) come with a halo of at least two pixels, the reach of the slopes.
    """
    count, size = valid.shape[:2]
    side = size + 2 * halo
    sums = np.zeros((count, 5, 5))
    mean, weights = np.empty(side * side, np.float32), np.zeros(side * side, np.float32)
    for i in range(count):
        one, other = before[i].reshape(-1), warped[i].reshape(-1)
        for at in range(len(mean)):
            mean[at] = np.float32(0.5) * (one[at] + other[at])
        for row in range(size):
            line, of_row = weights[(row + halo) * side + halo :], valid[i, row]
            for column in range(size):
                line[column] = of_row[column]
        products = _products(mean, one, other, weights, side, halo)
        at = 0
        for a in range(5):
            for b in range(a, 5):
                sums[i, a, b] = sums[i, b, a] = products[at]
                at += 1
    return sums


@njit(cache=True, fastmath={"reassoc", "contract"})
def _products(
    mean: Float32, before: Float32, warped: Float32, weights: Float32, side: int, halo: int
) -> tuple[np.float32, ...]:
    """Return the sums of the fifteen products of a tile, whose rows with their halo follow one another.

    In one loop over all rows: the weights of the halo are 0. Slopes are of five taps, exact for quartics, 3% small at
    1 rad/px.
    """
    near, far = np.float32(8 / 12), np.float32(1 / 12)
    pixels = total = np.float32(0)
    for at in range(len(mean)):
        pixels += weights[at]
        total += weights[at] * mean[at]
    level = total / max(pixels, np.float32(1))
    aa = ab = ac = ad = ae = bb = bc = bd = be = cd = ce = dd = de = ee = np.float32(0)
    first, stop = halo * side, len(mean) - halo * side
    here, one, other, there = mean[first:stop], before[first:stop], warped[first:stop], weights[first:stop]
    above, below = mean[first - side : stop - side], mean[first + side : stop + side]
    highest, lowest = mean[first - 2 * side : stop - 2 * side], mean[first + 2 * side : stop + 2 * side]
    left, right = mean[first - 1 : stop - 1], mean[first + 1 : stop + 1]
    leftmost, rightmost = mean[first - 2 : stop - 2], mean[first + 2 : stop + 2]
    for at in range(len(here)):
        c = there[at]
        a = c * (near * (right[at] - left[at]) - far * (rightmost[at] - leftmost[at]))
        b = c * (near * (below[at] - above[at]) - far * (lowest[at] - highest[at]))
        d, e = c * (here[at] - level), c * (other[at] - one[at])
        aa += a * a
        ab += a * b
        ac += a
        ad += a * d
        ae += a * e
        bb += b * b
        bc += b
        bd += b * d
        be += b * e
        cd += d
        ce += e
        dd += d * d
        de += d * e
        ee += e * e
    return aa, ab, ac, ad, ae, bb, bc, bd, be, pixels, cd, ce, dd, de, ee
