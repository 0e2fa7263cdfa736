"""Tiles of an image, and the residual flow in them after a frame is warped back by a flow.

Least squares on ``W - A = g . d + a + b (A + W)/2``, with the earlier frame A, the warped later frame W, the gradient g
of (A + W)/2 and the error d of the flow (stored minus true). The coefficients a and b absorb changes of exposure and
vignetting. B. D. Lucas, T. Kanade, IJCAI (1981) 674. The symmetric gradient is that of S. Birchfield (1997): its noise
is uncorrelated with the noise of the difference, so that noise does not bias d = 0.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
Int64 = NDArray[np.int64]

TILE_PX: Final = 32
HALO_PX: Final = 2
"""Reach of the derivative."""

_CORRELATED_PIXELS: Final = 4 * np.pi
"""Sum of the autocorrelation of white noise smoothed by a kernel of variance 1 px^2: this many pixels count as one."""

_MARGIN_PX: Final = 8
"""Distance of tiles from the border, where smoothing extrapolates."""


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


@dataclass(frozen=True, slots=True)
class TileGrid:
    """Whole tiles of an image, centred in it.

    Attributes
    ----------
    height, width
        Of the image, px.
    origins
        (n, 2) column and row of the first pixel of each tile.
    """

    height: int
    width: int
    origins: NDArray[np.int64]

    @classmethod
    @cache
    def of(cls, height: int, width: int) -> "TileGrid":
        """Return the tiles of an image; none where the image is too small.

        Parameters
        ----------
        height, width
            Of the image, px.

        Returns
        -------
        TileGrid
            Cached: the same object for the same size.
        """
        starts = []
        for size in (width, height):
            count = max((size - 2 * _MARGIN_PX) // TILE_PX, 0)
            starts.append((size - count * TILE_PX) // 2 + TILE_PX * np.arange(count, dtype=np.int64))
        columns, rows = np.meshgrid(*starts)
        return cls(height, width, np.stack((columns.ravel(), rows.ravel()), axis=-1))

    def sample(self, share: float, *seed: int) -> NDArray[np.int64]:
        """Return a random share of the tiles, at least one if there is any.

        Parameters
        ----------
        share
            Of the tiles, 0 to 1.
        seed
            Determines the choice.

        Returns
        -------
        ndarray of int64
            (k, 2) origins of these tiles, in the order of the grid.
        """
        count = len(self.origins)
        wanted = min(count, max(1, round(share * count)))
        if wanted == count:
            return self.origins
        # Seeded by the caller, so that the choice depends neither on the worker nor on the order of windows.
        chosen = np.random.default_rng(seed).permutation(count)[:wanted]
        return self.origins[np.sort(chosen)]


def pixels_of(origins: NDArray[np.int64], halo_px: int = HALO_PX) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return columns and rows of the pixels of tiles with their halo.

    Parameters
    ----------
    origins
        (n, 2) column and row of the first pixel of each tile.
    halo_px
        Width of the halo, px.

    Returns
    -------
    columns, rows
        (n, s, s) each, read-only, with s = ``TILE_PX`` + 2 ``halo_px``.
    """
    offsets = np.arange(-halo_px, TILE_PX + halo_px, dtype=np.int64)
    size = len(offsets)
    columns = np.broadcast_to((origins[:, 0, None] + offsets)[:, None, :], (len(origins), size, size))
    rows = np.broadcast_to((origins[:, 1, None] + offsets)[:, :, None], (len(origins), size, size))
    return columns, rows


def patches_of(image: NDArray[Any], origins: NDArray[np.int64], halo_px: int = HALO_PX) -> NDArray[Any]:
    """Return a copy of each tile of an image with its halo.

    Parameters
    ----------
    image
        (H, W) or (H, W, c) of any unit.
    origins
        (n, 2) column and row of the first pixel of each tile.
    halo_px
        Width of the halo, px; the image must contain it.

    Returns
    -------
    ndarray
        (n, s, s) or (n, s, s, c), with s = ``TILE_PX`` + 2 ``halo_px``.
    """
    size = TILE_PX + 2 * halo_px
    windows = np.lib.stride_tricks.sliding_window_view(image, (size, size), axis=(0, 1))
    taken = windows[origins[:, 1] - halo_px, origins[:, 0] - halo_px]
    return taken if image.ndim == 2 else np.moveaxis(taken, 1, -1)


@njit(cache=True)
def known_patches(flow_px: Float32, origins: Int64, size: int, halo: int, largest_px: float) -> tuple[Float32, Mask]:
    """Return tiles of a flow, and the pixels that have a value.

    Parameters
    ----------
    flow_px
        (H, W, 2) px.
    origins
        (n, 2) columns and rows of the first pixels of the tiles.
    size, halo
        Side of a tile, and width of the halo around it, px.
    largest_px
        A pixel has a value where both components are smaller than this, px.

    Returns
    -------
    patches_px, is_finite
        (n, size + 2 halo, size + 2 halo, 2) px, 0 where there is no value; (n, size, size) without the halo.
    """
    side = size + 2 * halo
    patches = np.zeros((len(origins), side, side, 2), np.float32)
    is_finite = np.zeros((len(origins), size, size), np.bool_)
    for i in range(len(origins)):
        for j in range(side):
            line = flow_px[origins[i, 1] - halo + j]
            for k in range(side):
                u, v = line[origins[i, 0] - halo + k, 0], line[origins[i, 0] - halo + k, 1]
                if abs(u) < largest_px and abs(v) < largest_px:
                    patches[i, j, k, 0], patches[i, j, k, 1] = u, v
                    if halo <= j < side - halo and halo <= k < side - halo:
                        is_finite[i, j - halo, k - halo] = True
    return patches, is_finite


@njit(cache=True)
def places_of(patches_px: Float32, origins: Int64, halo: int, less_px: Float32) -> tuple[Float32, Float32]:
    """Return the positions to which the flow of tiles leads.

    Parameters
    ----------
    patches_px
        (n, s, s, 2) flow of the tiles with their halo, px.
    origins
        (n, 2) columns and rows of the first pixels of the tiles, without the halo.
    halo
        Width of the halo, px.
    less_px
        (n, 2) flow that is subtracted from that of each tile, px.

    Returns
    -------
    columns, rows
        (n, s, s) px of the second frame.
    """
    columns, rows = np.empty(patches_px.shape[:3], np.float32), np.empty(patches_px.shape[:3], np.float32)
    for i in range(len(origins)):
        for j in range(patches_px.shape[1]):
            for k in range(patches_px.shape[2]):
                columns[i, j, k] = origins[i, 0] - halo + k + (patches_px[i, j, k, 0] - less_px[i, 0])
                rows[i, j, k] = origins[i, 1] - halo + j + (patches_px[i, j, k, 1] - less_px[i, 1])
    return columns, rows


@njit(cache=True)
def means_slopes_sines(flow_px: Float32, usable: Mask, halo: int, step: int) -> tuple[Float64, Float64, Float64]:
    """Return means and slopes of the flow of tiles, and means of its sine, over usable pixels.

    Parameters
    ----------
    flow_px
        (n, s + 2 halo, s + 2 halo, 2) flow of the tiles with their halo, px.
    usable
        (n, s, s) without the halo.
    halo, step
        Width of the halo, and distance of the rows and columns that are read, px.

    Returns
    -------
    means_px, slopes, sines
        (n, 2) mean flow, px; (n, 2, 2) slopes of u and v (second axis) along columns and rows (third axis), px/px;
        (n, 2) mean of sin(2 pi flow). 0 where no pixel is usable.
    """
    count, size = usable.shape[:2]
    means, sines, slopes = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count, 2, 2))
    for i in range(count):
        pixels = u_sum = v_sum = u_sine = v_sine = 0.0
        x_sum = y_sum = xx = yy = xu = xv = yu = yv = 0.0
        for row in range(0, size, step):
            for column in range(0, size, step):
                if not usable[i, row, column]:
                    continue
                u = np.float64(flow_px[i, row + halo, column + halo, 0])
                v = np.float64(flow_px[i, row + halo, column + halo, 1])
                pixels += 1.0
                u_sum += u
                v_sum += v
                u_sine += _sine_of_turns(u)
                v_sine += _sine_of_turns(v)
                x_sum += column
                y_sum += row
                xx += column * column
                yy += row * row
                xu += column * u
                xv += column * v
                yu += row * u
                yv += row * v
        n = max(pixels, 1.0)
        means[i, 0], means[i, 1] = u_sum / n, v_sum / n
        sines[i, 0], sines[i, 1] = u_sine / n, v_sine / n
        # Slope of a line, cov(x, u) / var(x), along each axis separately.
        across, down = max(xx - x_sum * x_sum / n, 1.0), max(yy - y_sum * y_sum / n, 1.0)
        slopes[i, 0, 0], slopes[i, 1, 0] = (xu - x_sum * u_sum / n) / across, (xv - x_sum * v_sum / n) / across
        slopes[i, 0, 1], slopes[i, 1, 1] = (yu - y_sum * u_sum / n) / down, (yv - y_sum * v_sum / n) / down
    return means, slopes, sines


@njit(cache=True)
def _sine_of_turns(turns: float) -> float:
    """Return sin(2 pi ``turns``) to 4e-6, by a power series for the angle folded into a quarter of a turn."""
    rest = turns - np.rint(turns)
    # sin(pi - x) = sin(x) folds the angle into a quarter of a turn, where a short series suffices.
    rest = rest if abs(rest) <= 0.25 else (0.5 if rest > 0 else -0.5) - rest
    x = 2 * np.pi * rest
    square = x * x
    return float(x * (1 - square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)))))


@njit(cache=True)
def mean_derivatives(
    depth_m: Float32, origins: Int64, usable: Mask, first: int, step: int, K: Float64, R: Float64, t_m: Float64
) -> Float64:
    """Return the mean derivatives of the rigid flow of tiles by twist, logarithm of the focal length, and centre.

    The derivatives of ``geometry.rigid_flow`` follow by the chain rule.

    Parameters
    ----------
    depth_m
        (H, W) z-depth at the start of the interval, m.
    origins
        (n, 2) columns and rows of the first pixels of the tiles.
    usable
        (n, s, s) which pixels of each tile are usable.
    first, step
        First row and column of a tile that is read, and the distance to the next, px.
    K
        (3, 3) intrinsics, px.
    R, t_m
        (3, 3) and (3,) m: motion of points from the first to the second camera frame.

    Returns
    -------
    ndarray of float64
        (n, 2, 9) means over usable pixels with a depth: px per rad (3), px per metre (3), px per unit of log f, and
        px per px (2). A pixel behind the camera counts as 0, and so does a tile without usable pixels.
    """
    fx, fy, skew = K[0, 0], K[1, 1], K[0, 1]
    means = np.zeros((len(origins), 2, 9))
    for i in range(len(origins)):
        pixels = 0
        for j in range(first, usable.shape[1], step):
            for k in range(first, usable.shape[2], step):
                column, row = origins[i, 0] + k, origins[i, 1] + j
                depth = depth_m[row, column]
                if not (usable[i, j, k] and 0 < depth < np.inf):
                    continue
                inverse = np.float64(np.float32(1) / depth)
                pixels += 1
                y = (row - K[1, 2]) / fy
                x = (column - K[0, 2] - skew * y) / fx
                X = (R[0, 0] * x + R[0, 1] * y + R[0, 2]) / inverse + t_m[0]
                Y = (R[1, 0] * x + R[1, 1] * y + R[1, 2]) / inverse + t_m[1]
                Z = (R[2, 0] * x + R[2, 1] * y + R[2, 2]) / inverse + t_m[2]
                if not Z > 0:
                    continue
                for axis in range(2):
                    # g: derivative of the flow by the point (X, Y, Z). by_x, by_y: derivative by the ray (x, y, 1).
                    g_x, g_y = (fx / Z, skew / Z) if axis == 0 else (0.0, fy / Z)
                    g_z = -(g_x * X + g_y * Y) / Z
                    by_x = (g_x * R[0, 0] + g_y * R[1, 0] + g_z * R[2, 0]) / inverse
                    by_y = (g_x * R[0, 1] + g_y * R[1, 1] + g_z * R[2, 1]) / inverse
                    of_tile = means[i, axis]
                    of_tile[0] += Y * g_z - Z * g_y  # a rotation w moves the point by w x X1
                    of_tile[1] += Z * g_x - X * g_z
                    of_tile[2] += X * g_y - Y * g_x
                    of_tile[3] += g_x
                    of_tile[4] += g_y
                    of_tile[5] += g_z
                    # d flow / d log f: the projection is proportional to f, the slopes (x, y) of the ray to 1 / f.
                    of_tile[6] += g_x * X + g_y * Y - by_x * x - by_y * y
                    # d flow / d centre: the projection moves by 1 px, the slope of the ray changes by -1 / f.
                    of_tile[7] += (axis == 0) - by_x / fx
                    of_tile[8] += (axis == 1) + (by_x * skew / fx - by_y) / fy
        for axis in range(2):
            for of in range(9):
                means[i, axis, of] /= max(pixels, 1)
    return means
