"""Residual flow of image tiles: by how many pixels a frame warped back by a flow differs from the frame before it.

Least squares on ``W - A = g . d + a + b (A + W)/2``, with the earlier frame A, the warped later frame W, the gradient g
of (A + W)/2 and the error d of the flow (stored minus true). The coefficients a and b absorb changes of exposure and
vignetting. B. D. Lucas, T. Kanade, IJCAI (1981) 674. The symmetric gradient is that of S. Birchfield (1997): its noise
is uncorrelated with the noise of the difference, so that noise does not bias d = 0.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

TILE_PX: Final = 32
HALO_PX: Final = 2
"""Reach of the derivative."""

_CORRELATED_PIXELS: Final = 4 * np.pi
"""Sum of the autocorrelation of white noise smoothed by a kernel of variance 1 px^2: this many pixels count as one."""


@dataclass(frozen=True, slots=True)
class TileResiduals:
    """Estimates for n tiles.

    Attributes
    ----------
    flow_errors_px
        (n, 2) stored minus true flow, px.
    noise_covariances_px2
        (n, 2, 2) px^2, of the noise floor alone: an upper bound, see `tile_residuals`. It decides whether texture
        suffices.
    covariances_px2
        (n, 2, 2) px^2, from the residual of the fit, where that exceeds the noise floor, mostly by unresolved
        detail.
    mismatch, unexplained
        (n,) squared difference of the frames, before and after the fit, over the squared deviation of the image
        from its mean: about 0 for frames that match, 1 and more for unrelated frames.
    valid_share
        (n,) share of the pixels of the tile that were used.
    """

    flow_errors_px: Float64
    noise_covariances_px2: Float64
    covariances_px2: Float64
    mismatch: Float64
    unexplained: Float64
    valid_share: Float64


def tile_residuals(
    before: Float32, warped: Float32, valid: NDArray[np.bool_], noise_variance_dn2: float
) -> TileResiduals:
    """Return the error of the flow in each tile.

    Parameters
    ----------
    before, warped
        (n, 36, 36) patches of A and W, DN, smoothed by a kernel of variance 1 px^2: a tile of 32 px and a halo of
        2.
    valid
        (n, 32, 32) pixels to use.
    noise_variance_dn2
        Variance of white noise of a pixel of either frame before smoothing, DN^2. Smoothing correlates the noise
        but never increases its spectral density, so that ``2 variance (G^T G)^-1`` bounds the covariance.

    Returns
    -------
    TileResiduals
        One estimate for each tile, px. The covariance of a tile without texture is large, not infinite.
    """
    sums = sums_of_tiles(before, warped, valid, HALO_PX)
    # W - A has the noise of both frames, hence twice the variance.
    contrast, floor = np.maximum(sums[:, 3, 3], 1e-9), 2 * noise_variance_dn2
    errors_px, inverse, left, variances_dn2 = solved(sums, floor, _CORRELATED_PIXELS)
    return TileResiduals(
        flow_errors_px=errors_px,
        noise_covariances_px2=np.asarray(floor * inverse, dtype=np.float64),
        covariances_px2=variances_dn2[:, None, None] * inverse,
        mismatch=sums[:, 4, 4] / contrast,
        unexplained=left / contrast,
        valid_share=sums[:, 2, 2] / TILE_PX**2,
    )


@njit(cache=True)
def sums_of_tiles(before: Float32, warped: Float32, valid: Mask, halo: int) -> Float64:
    """Return the sums of products of five quantities over the valid pixels of each tile.

    The five quantities are: the slopes of the mean of both patches along columns and along rows; 1; that mean less its
    average over the valid pixels; the second patch less the first.

    Parameters
    ----------
    before, warped
        (n, s + 2 halo, s + 2 halo) patches, DN.
    valid
        (n, s, s) pixels to use.
    halo
        Width of the halo, px; at least 2, the reach of the slopes.

    Returns
    -------
    ndarray of float64
        (n, 5, 5) symmetric.
    """
    count, size = valid.shape[:2]
    side = size + 2 * halo
    sums = np.zeros((count, 5, 5))
    mean, weights = np.empty(side * side, np.float32), np.zeros(side * side, np.float32)
    for i in range(count):
        before_flat, other = before[i].reshape(-1), warped[i].reshape(-1)
        for at in range(len(mean)):
            mean[at] = np.float32(0.5) * (before_flat[at] + other[at])
        for row in range(size):
            line, of_row = weights[(row + halo) * side + halo :], valid[i, row]
            for column in range(size):
                line[column] = of_row[column]
        products = _products(mean, before_flat, other, weights, side, halo)
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

    One loop runs over all rows; the weights of the halo are 0. Slopes have five taps; they are exact for quartics and
    3% too small at 1 rad/px.
    """
    near, far = np.float32(8 / 12), np.float32(1 / 12)
    pixels = total = np.float32(0)
    for at in range(len(mean)):
        pixels += weights[at]
        total += weights[at] * mean[at]
    level = total / max(pixels, np.float32(1))
    aa = ab = ac = ad = ae = bb = bc = bd = be = cd = ce = dd = de = ee = np.float32(0)
    first, stop = halo * side, len(mean) - halo * side
    here, before_row, other, there = mean[first:stop], before[first:stop], warped[first:stop], weights[first:stop]
    above, below = mean[first - side : stop - side], mean[first + side : stop + side]
    highest, lowest = mean[first - 2 * side : stop - 2 * side], mean[first + 2 * side : stop + 2 * side]
    left, right = mean[first - 1 : stop - 1], mean[first + 1 : stop + 1]
    leftmost, rightmost = mean[first - 2 : stop - 2], mean[first + 2 : stop + 2]
    for at in range(len(here)):
        c = there[at]
        # f' = (8 (f(1) - f(-1)) - (f(2) - f(-2))) / 12, of fourth order.
        a = c * (near * (right[at] - left[at]) - far * (rightmost[at] - leftmost[at]))
        b = c * (near * (below[at] - above[at]) - far * (lowest[at] - highest[at]))
        d, e = c * (here[at] - level), c * (other[at] - before_row[at])
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


@njit(cache=True)
def solved(sums: Float64, floor: float, correlated: float) -> tuple[Float64, Float64, Float64, Float64]:
    """Solve the normal equations of tiles.

    A ridge keeps the matrices of tiles without texture invertible.

    Parameters
    ----------
    sums
        (n, 5, 5) of ``sums_of_tiles``.
    floor
        Least variance of the difference of a pixel, DN^2.
    correlated
        Number of pixels that count as one, as their noise is correlated.

    Returns
    -------
    errors_px, inverses, residual_squares, variances
        (n, 2) error of the flow, px; (n, 2, 2) its part of the inverse matrix, px^2/DN^2; (n,) sum of squares of
        the residuals, DN^2; (n,) variance of a pixel, DN^2: that of the residuals times ``correlated``, at least
        ``floor``.
    """
    count = len(sums)
    errors, inverses = np.empty((count, 2)), np.empty((count, 2, 2))
    left, variances = np.empty(count), np.empty(count)
    work, inverse = np.empty((4, 4)), np.empty((4, 4))
    for i in range(count):
        trace = sums[i, 0, 0] + sums[i, 1, 1] + sums[i, 2, 2] + sums[i, 3, 3]
        for a in range(4):
            for b in range(4):
                work[a, b], inverse[a, b] = sums[i, a, b], 1.0 if a == b else 0.0
            work[a, a] += 1e-9 * trace + 1e-9
        _invert(work, inverse)
        explained = 0.0
        for a in range(4):
            size = 0.0
            for b in range(4):
                size += inverse[a, b] * sums[i, b, 4]
            explained += size * sums[i, a, 4]
            if a < 2:
                errors[i, a], inverses[i, a, 0], inverses[i, a, 1] = size, inverse[a, 0], inverse[a, 1]
        left[i] = max(sums[i, 4, 4] - explained, 0.0)
        # s^2 = |r|^2 / (n - 4) for four fitted coefficients, times the number of pixels that count as one.
        variances[i] = max(correlated * left[i] / max(sums[i, 2, 2] - 4, 1.0), floor)
    return errors, inverses, left, variances


@njit(cache=True)
def _invert(work: Float64, inverse: Float64) -> None:
    """Write the inverse of a regular matrix (4, 4), by Gauss-Jordan elimination with row pivoting.

    ``work`` is overwritten; ``inverse`` must be the identity before.
    """
    for a in range(4):
        pivot = a
        for b in range(a + 1, 4):
            pivot = b if abs(work[b, a]) > abs(work[pivot, a]) else pivot
        for c in range(4):
            work[a, c], work[pivot, c] = work[pivot, c], work[a, c]
            inverse[a, c], inverse[pivot, c] = inverse[pivot, c], inverse[a, c]
        scale = 1.0 / work[a, a]
        for c in range(4):
            work[a, c] *= scale
            inverse[a, c] *= scale
        for b in range(4):
            if b != a:
                share = work[b, a]
                for c in range(4):
                    work[b, c] -= share * work[a, c]
                    inverse[b, c] -= share * inverse[a, c]
