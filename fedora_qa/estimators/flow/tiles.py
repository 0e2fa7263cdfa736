"""Tiles of an image, which of them to look at, and patches of them."""

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
"""Tiles keep clear of the border by this, where smoothing extrapolates."""


@dataclass(frozen=True, slots=True)
class TileGrid:
    """Whole tiles of an image, centred; ``origins`` (n, 2) are the columns and rows of their first pixels."""

    height: int
    width: int
    origins: NDArray[np.int64]

    @classmethod
    @cache
    def of(cls, height: int, width: int) -> "TileGrid":
        """Cut an image into tiles; none where it is too small."""
        starts = []
        for size in (width, height):
            count = max((size - 2 * _MARGIN_PX) // TILE_PX, 0)
            starts.append((size - count * TILE_PX) // 2 + TILE_PX * np.arange(count, dtype=np.int64))
        columns, rows = np.meshgrid(*starts)
        return cls(height, width, np.stack((columns.ravel(), rows.ravel()), axis=-1))

    def sample(self, share: float, *seed: int) -> NDArray[np.int64]:
        """Return the origins of a share of the tiles, at least one; which ones follows from ``seed`` alone."""
        count = len(self.origins)
        wanted = min(count, max(1, round(share * count)))
        if wanted == count:
            return self.origins
        # Seeded by the caller, so that the choice depends neither on the worker nor on the order of windows.
        chosen = np.random.default_rng(seed).permutation(count)[:wanted]
        return self.origins[np.sort(chosen)]


def pixels_of(origins: NDArray[np.int64], halo_px: int = HALO_PX) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return columns and rows (n, size, size) of each tile with its halo."""
    offsets = np.arange(-halo_px, TILE_PX + halo_px, dtype=np.int64)
    size = len(offsets)
    columns = np.broadcast_to((origins[:, 0, None] + offsets)[:, None, :], (len(origins), size, size))
    rows = np.broadcast_to((origins[:, 1, None] + offsets)[:, :, None], (len(origins), size, size))
    return columns, rows


def patches_of(image: NDArray[Any], origins: NDArray[np.int64], halo_px: int = HALO_PX) -> NDArray[Any]:
    """Return a copy (n, size, size, ...) of each tile of an image with its halo."""
    size = TILE_PX + 2 * halo_px
    windows = np.lib.stride_tricks.sliding_window_view(image, (size, size), axis=(0, 1))
    taken = windows[origins[:, 1] - halo_px, origins[:, 0] - halo_px]
    return taken if image.ndim == 2 else np.moveaxis(taken, 1, -1)


@njit(cache=True)
def known_patches(flow_px: Float32, origins: Int64, size: int, halo: int, largest_px: float) -> tuple[Float32, Mask]:
    """Cut tiles out of a flow, and mark the pixels that have a value.

    Parameters
    ----------
    flow_px
        (H, W, 2) px.
    origins
        (n, 2) columns and rows of the tiles' first pixels.
    size, halo
        Side of a tile, and width of the halo about it, px.
    largest_px
        A pixel has a value where neither component is as large as this.

    Returns
    -------
    patches_px, is_finite
        (n, size + 2 halo, size + 2 halo, 2), 0 where there is no value; (n, size, size) without the halo.
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
    """Return the positions to which tiles of a flow lead.

    Parameters
    ----------
    patches_px
        (n, s, s, 2) flow of the tiles with their halo.
    origins
        (n, 2) columns and rows of the tiles' first pixels, without the halo.
    halo
        Width of the halo, px.
    less_px
        (n, 2) flow that is subtracted from that of each tile.

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
    """Summarise the flow of tiles over their usable pixels, every ``step``-th of every ``step``-th row.

    Parameters
    ----------
    flow_px
        (n, s + 2 halo, s + 2 halo, 2) flow of the tiles with their halo.
    usable
        (n, s, s) without the halo.
    halo, step
        Width of the halo, and distance of the pixels that are read, px.

    Returns
    -------
    means_px, slopes, sines
        (n, 2) mean flow; (n, 2, 2) slopes of u and v (second axis) along columns and rows (third axis), px/px; (n, 2)
        mean of sin(2 pi flow). 0 where no pixel is usable.
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
        # Slope of a line, cov(x, u) / var(x), along each axis by itself.
        across, down = max(xx - x_sum * x_sum / n, 1.0), max(yy - y_sum * y_sum / n, 1.0)
        slopes[i, 0, 0], slopes[i, 1, 0] = (xu - x_sum * u_sum / n) / across, (xv - x_sum * v_sum / n) / across
        slopes[i, 0, 1], slopes[i, 1, 1] = (yu - y_sum * u_sum / n) / down, (yv - y_sum * v_sum / n) / down
    return means, slopes, sines


@njit(cache=True)
def _sine_of_turns(turns: float) -> float:
    """Return the sine of an angle in turns, to 4e-6: its series, once the angle is within a quarter of a turn."""
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
    """Return the mean derivatives (n, 2, 9) of the flow of tiles: by twist, logarithm of the focal length, and centre.

    Of the rigid flow (``geometry.rigid_flow``) by the chain rule: px per rad, per metre, per unit of log f, and per px.
    Over the usable pixels (n, s, s) of each tile that have a depth, every ``step``-th of every ``step``-th row from
    ``first`` on; ``depth_m`` is (H, W), ``origins`` (n, 2) are first columns and rows. 0 where there is none, and of
    pixels that end behind the camera.
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
                    # g: how the flow changes with the point; the point of a ray (x, y, 1) with depth and the ray.
                    g_x, g_y = (fx / Z, skew / Z) if axis == 0 else (0.0, fy / Z)
                    g_z = -(g_x * X + g_y * Y) / Z
                    by_x = (g_x * R[0, 0] + g_y * R[1, 0] + g_z * R[2, 0]) / inverse
                    by_y = (g_x * R[0, 1] + g_y * R[1, 1] + g_z * R[2, 1]) / inverse
                    of_tile = means[i, axis]
                    of_tile[0] += Y * g_z - Z * g_y  # a turn w moves the point by w x X1
                    of_tile[1] += Z * g_x - X * g_z
                    of_tile[2] += X * g_y - Y * g_x
                    of_tile[3] += g_x
                    of_tile[4] += g_y
                    of_tile[5] += g_z
                    # d flow / d log f: the projection grows with f, the slopes (x, y) of the ray shrink with it.
                    of_tile[6] += g_x * X + g_y * Y - by_x * x - by_y * y
                    # d flow / d centre: the projection moves by 1 px, the ray by 1 / f the other way.
                    of_tile[7] += (axis == 0) - by_x / fx
                    of_tile[8] += (axis == 1) + (by_x * skew / fx - by_y) / fy
        for axis in range(2):
            for of in range(9):
                means[i, axis, of] /= max(pixels, 1)
    return means
