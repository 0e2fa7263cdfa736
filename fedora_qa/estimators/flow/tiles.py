"""Tiles of an image, samples of them, and patches of the image in them."""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.flow.residual import HALO_PX, TILE_PX

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Mask = NDArray[np.bool_]
_MARGIN_PX: Final = 8
"""Distance of tiles from the border, where smoothing extrapolates."""


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
