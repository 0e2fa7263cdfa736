"""Which pixels show the same surface point in both frames, from depth and camera motion, never from the flow.

A pixel is visible where its point is away from edges of the depth in both frames, and where the second frame has the
depth that the motion predicts. Two functions give the same result, bit by bit. ``seen_in_both`` reads maps of whole
frames, which serve all rates of flow. ``seen_in_few_tiles`` computes only the parts of each frame that it reads, which
is faster for few tiles of large frames.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.flow.mask import EDGE, LONGEST_FOOTPRINT, inverse_in, is_edge
from fedora_qa.geometry.camera import RigidMotion

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Mask = NDArray[np.bool_]
Edges = NDArray[np.uint8]

_WIDENED = 4
"""Number of pixels by which edges are widened on either side."""

_REACH = _WIDENED + 1
"""Distance, px, of the pixels around a part that its edges depend on."""

_LARGEST_PART = 1 << 16
"""Most pixels of a part that is read as a whole. A tile whose targets spread further is read pixel by pixel."""


class PixelTransfer(NamedTuple):
    """Where a motion moves pixels: p of inverse depth w (1/m) to ``H p + w t_px``, in homogeneous coordinates.

    The third component of the result is the ratio of the depths, Z1 / Z0.

    Attributes
    ----------
    H
        (3, 3) ``K R K^-1``.
    t_px
        (3,) ``K t``, px m in the first two components, m in the third.
    """

    H: Float64
    t_px: Float64


class DepthEdgeMap(NamedTuple):
    """Inverse depth of a frame (H, W) or of a part of it, and its edges.

    Attributes
    ----------
    inverse_per_m
        (H, W) 1/m, 0 where invalid.
    edges
        (H, W) 1 near edges, else 0.
    """

    inverse_per_m: Float32
    edges: Edges


class DepthAgreement(NamedTuple):
    """When two inverse depths agree.

    Attributes
    ----------
    tolerance
        Largest relative mismatch.
    uncertainty_px
        By how much the motion may misplace a pixel, px.
    """

    tolerance: float
    uncertainty_px: float


class _TileTransfer(NamedTuple):
    """Targets in the second frame of the pixels (h, w) of a tile, px, and the ratios of their depths, Z1 / Z0."""

    columns: Float64
    rows: Float64
    ratios: Float64


def seen_in_both(
    K: Float64,
    motion: RigidMotion,
    origins: Int64,
    size: tuple[int, int],
    first: tuple[Float32, Edges],
    second: tuple[Float32, Edges],
    uncertainty_px: float,
) -> Mask:
    """Return which pixels of tiles of the first frame are visible in the second, away from edges in either.

    Parameters
    ----------
    K, motion
        (3, 3) intrinsics, px, and the motion of points from the first to the second camera frame.
    origins, size
        (n, 2) first columns and rows of tiles; height and width of each, px.
    first, second
        Inverse depth, 1/m, 0 where invalid, and edges, 1 or 0, both (H, W), of each frame.
    uncertainty_px
        By how much the motion may misplace a pixel, px. Where the inverse depth has a gradient, its value is
        uncertain by that gradient times this.

    Returns
    -------
    ndarray of bool
        (n, h, w), by tile.
    """
    transfer, agreement = _transfer(K, motion), DepthAgreement(EDGE, uncertainty_px)
    return np.asarray(_seen_in_maps(transfer, origins, size, DepthEdgeMap(*first), DepthEdgeMap(*second), agreement))


def seen_in_few_tiles(
    K: Float64,
    motion: RigidMotion,
    origins: Int64,
    size: tuple[int, int],
    depths_m: tuple[Float32, Float32],
    uncertainty_px: float,
    fewest: int = 0,
) -> Mask:
    """Return the result of `seen_in_both` from the depths of both frames, with edges marked in parts of them only.

    This is faster where tiles are a few hundredths of a large frame.

    Parameters
    ----------
    K, motion, origins, size, uncertainty_px
        As of `seen_in_both`.
    depths_m
        Depth (H, W) of the first and the second frame, m.
    fewest
        Tiles of which fewer pixels than this can be visible may be left empty.

    Returns
    -------
    ndarray of bool
        (n, h, w), by tile.
    """
    limits = np.float32(EDGE), np.float32(LONGEST_FOOTPRINT / K[0, 0])
    transfer, agreement = _transfer(K, motion), DepthAgreement(EDGE, uncertainty_px)
    return np.asarray(_seen_in_parts(transfer, origins, size, depths_m, limits, agreement, fewest))


def _transfer(K: Float64, motion: RigidMotion) -> PixelTransfer:
    # x1 = K R K^-1 x0 + K t / Z0, homogeneously (Hartley and Zisserman, 2nd ed., eq. 9.7).
    return PixelTransfer(K @ motion.R @ np.linalg.inv(K), K @ motion.t_m)


@njit(cache=True)
def _seen_in_maps(
    transfer: PixelTransfer,
    origins: Int64,
    size: tuple[int, int],
    first: DepthEdgeMap,
    second: DepthEdgeMap,
    agreement: DepthAgreement,
) -> Mask:
    """Return which pixels of tiles (n, h, w) are visible, from maps of whole frames."""
    height, width = second.inverse_per_m.shape
    visible = np.zeros((len(origins), size[0], size[1]), np.bool_)
    columns, rows, ratios = np.empty(size[1]), np.empty(size[1]), np.empty(size[1])
    for i in range(len(origins)):
        left, top = origins[i, 0], origins[i, 1]
        for j in range(size[0]):
            inverses = first.inverse_per_m[top + j, left : left + size[1]]
            edges = first.edges[top + j, left : left + size[1]]
            _project(transfer, np.float64(left), np.float64(top + j), inverses, columns, rows, ratios)
            visible_row = visible[i, j]
            for k in range(len(columns)):
                inverse, column, row = np.float64(inverses[k]), columns[k], rows[k]
                if edges[k] or not (inverse > 0 and ratios[k] > 0):
                    continue
                if not (0 <= column <= width - 1 and 0 <= row <= height - 1):
                    continue
                if second.edges[np.uint64(row + 0.5), np.uint64(column + 0.5)]:
                    continue
                visible_row[k] = _agrees(second.inverse_per_m, column, row, inverse, ratios[k], agreement)
    return visible


@njit(cache=True, error_model="numpy")
def _seen_in_parts(
    transfer: PixelTransfer,
    origins: Int64,
    size: tuple[int, int],
    depths_m: tuple[Float32, Float32],
    limits: tuple[np.float32, np.float32],
    agreement: DepthAgreement,
    fewest: int,
) -> Mask:
    """Return which pixels of tiles (n, h, w) are visible, from parts of each depth about the tiles and their targets.

    ``limits`` are those of ``mask.mark_edges``. Tiles are left empty where fewer than ``fewest`` pixels can be visible.
    """
    depth0_m, depth1_m = depths_m
    shape = depth1_m.shape
    height, width = shape
    visible = np.zeros((len(origins), size[0], size[1]), np.bool_)
    targets = _TileTransfer(np.empty(size), np.empty(size), np.empty(size))
    part = np.empty(4, np.int64)
    for i in range(len(origins)):
        left, top = origins[i, 0], origins[i, 1]
        part[0], part[1], part[2], part[3] = left, top, left + size[1], top + size[0]
        inverse0, visible_tile = _inverse_about(depth0_m, part), visible[i]
        edges0 = _edges_in(inverse0, part, shape, limits)
        if size[0] * size[1] - np.count_nonzero(edges0) < fewest:
            continue
        # The tile within the part of the first frame that is read about it.
        rows_above, columns_before = top - max(top - _REACH, 0), left - max(left - _REACH, 0)
        part[0], part[1], part[2], part[3] = width, height, 0, 0
        for j in range(size[0]):
            inverses, edges, visible_row = inverse0[rows_above + j, columns_before:], edges0[j], visible_tile[j]
            columns, rows, ratios = targets.columns[j], targets.rows[j], targets.ratios[j]
            _project(transfer, np.float64(left), np.float64(top + j), inverses, columns, rows, ratios)
            for k in range(len(visible_row)):
                inside = (columns[k] >= 0) & (columns[k] <= width - 1) & (rows[k] >= 0) & (rows[k] <= height - 1)
                visible_row[k] = inside & (edges[k] == 0) & (inverses[k] > 0) & (ratios[k] > 0)
            _widen(part, columns, rows, visible_row)
        if part[2] == 0 or np.count_nonzero(visible_tile) < fewest:
            visible_tile[:] = False
            continue
        is_compact = (part[2] - part[0]) * (part[3] - part[1]) <= _LARGEST_PART
        if is_compact:
            inverse1 = _inverse_about(depth1_m, part)
            edges1 = _edges_in(inverse1, part, shape, limits)
        if is_compact and agreement.uncertainty_px == 0:
            of_tile = inverse0[rows_above:, columns_before:]
            _keep_agreeing(DepthEdgeMap(inverse1, edges1), part, targets, of_tile, agreement.tolerance, visible_tile)
            continue
        for j in range(size[0]):
            for k in range(size[1]):
                if not visible_tile[j, k]:
                    continue
                column, row = int(targets.columns[j, k] + 0.5), int(targets.rows[j, k] + 0.5)
                if not is_compact:
                    part[0], part[1], part[2], part[3] = column, row, column + 1, row + 1
                    inverse1 = _inverse_about(depth1_m, part)
                    edges1 = _edges_in(inverse1, part, shape, limits)
                visible_tile[j, k] = edges1[row - part[1], column - part[0]] == 0 and _agrees(
                    inverse1,
                    targets.columns[j, k] - max(part[0] - _REACH, 0),
                    targets.rows[j, k] - max(part[1] - _REACH, 0),
                    np.float64(inverse0[rows_above + j, columns_before + k]),
                    targets.ratios[j, k],
                    agreement,
                )
    return visible


@njit(cache=True, error_model="numpy")
def _project(
    transfer: PixelTransfer,
    left: float,
    row: float,
    inverses: Float32,
    to_columns: Float64,
    to_rows: Float64,
    ratios: Float64,
) -> None:
    """Write the targets of the pixels (w,) of a row from column ``left`` on, px, and the ratios of their depths."""
    # Numbers that are the same for all pixels are read first: for the compiler, the writes below may change them.
    H, t_px = transfer.H, transfer.t_px
    a, b, c, to_a = H[0, 0], H[0, 1] * row, H[0, 2], t_px[0]
    d, e, f, to_d = H[1, 0], H[1, 1] * row, H[1, 2], t_px[1]
    g, h, i, to_g = H[2, 0], H[2, 1] * row, H[2, 2], t_px[2]
    for k in range(len(ratios)):  # without a branch, so that many are projected at once
        column, inverse = left + np.float64(k), np.float64(inverses[k])
        ratio = g * column + h + i + inverse * to_g
        ratios[k] = ratio
        to_columns[k] = (a * column + b + c + inverse * to_a) / ratio
        to_rows[k] = (d * column + e + f + inverse * to_d) / ratio


@njit(cache=True)
def _agrees(
    inverse_per_m: Float32, column: float, row: float, inverse: float, ratio: float, agreement: DepthAgreement
) -> bool:
    """Return whether the inverse depth at a position of the second frame is that predicted for a point of the first."""
    interpolated, limit = _interpolated(inverse_per_m, column, row), agreement.tolerance
    if agreement.uncertainty_px > 0:
        # Where the inverse depth has a gradient, a misplaced pixel has another inverse depth.
        across = abs(_interpolated(inverse_per_m, column + 1, row) - interpolated)
        down = abs(_interpolated(inverse_per_m, column, row + 1) - interpolated)
        limit += agreement.uncertainty_px * (across + down) / max(interpolated, 1e-6)
    # |w1 Z1/Z0 - 1/Z0| < limit / Z0, with w1 read in the second frame and Z1/Z0 of the motion.
    return bool(abs(interpolated * ratio - inverse) < limit * inverse)


@njit(cache=True)
def _interpolated(image: Float32, x: float, y: float) -> float:
    """Return an image (H, W) at a position, by bilinear interpolation; the image is 0 beyond its border."""
    column, row = int(x), int(y)
    right, below = x - column, y - row
    if column + 1 < image.shape[1] and row + 1 < image.shape[0]:
        # Unsigned: an index that may be negative costs a comparison.
        upper, lower, first = image[row], image[row + 1], np.uint64(column)
        above = upper[first] + right * (upper[first + np.uint64(1)] - upper[first])
        return float(above + below * (lower[first] + right * (lower[first + np.uint64(1)] - lower[first]) - above))
    value = 0.0
    for j in range(2):
        for k in range(2):
            if row + j < image.shape[0] and column + k < image.shape[1]:
                value += (below if j else 1 - below) * (right if k else 1 - right) * image[row + j, column + k]
    return value


@njit(cache=True)
def _keep_agreeing(
    second: DepthEdgeMap, part: Int64, targets: _TileTransfer, inverses: Float32, tolerance: float, visible: Mask
) -> None:
    """Remove from the pixels (h, w) of a tile those near an edge of the second frame or with another depth there.

    ``second`` holds the inverse depth about a part of the second frame, and the edges in it. Each row takes two loops.
    The first computes indices and weights of many positions at once and without a branch, the second reads the values.
    """
    image, near = second.inverse_per_m, second.edges
    values, edges, wide = image.reshape(-1), near.reshape(-1), np.int32(image.shape[1])
    first_column, first_row, edges_wide = np.int32(part[0]), np.int32(part[1]), np.int32(near.shape[1])
    left, top = np.float64(max(part[0] - _REACH, 0)), np.float64(max(part[1] - _REACH, 0))
    last_column, last_row = np.float64(image.shape[1] - 2), np.float64(image.shape[0] - 2)
    any_column, any_row = np.float64(part[0]), np.float64(part[1])  # for pixels that are left out already
    side, next_column, next_row = visible.shape[1], np.uint64(1), np.uint64(image.shape[1])
    indices, edge_indices, weights = np.empty(side, np.uint32), np.empty(side, np.uint32), np.empty((2, side))
    rights, belows = weights
    for j in range(len(visible)):
        visible_row, columns, rows = visible[j], targets.columns[j], targets.rows[j]
        ratios, own_inverses = targets.ratios[j], inverses[j]
        for k in range(side):
            x, y = (columns[k] if visible_row[k] else any_column), (rows[k] if visible_row[k] else any_row)
            edge_indices[k] = (np.int32(y + 0.5) - first_row) * edges_wide + np.int32(x + 0.5) - first_column
            x, y = min(x - left, last_column), min(y - top, last_row)  # a pixel at the border is near an edge anyway
            column, row = np.int32(x), np.int32(y)
            rights[k], belows[k], indices[k] = x - column, y - row, row * wide + column
        for k in range(side):
            index = np.uint64(indices[k])  # unsigned: an index that may be negative costs a comparison
            below, right = index + next_row, rights[k]
            upper = values[index] + right * (values[index + next_column] - values[index])
            lower = values[below] + right * (values[below + next_column] - values[below])
            interpolated = upper + belows[k] * (lower - upper)
            inverse = np.float64(own_inverses[k])
            agrees = abs(interpolated * ratios[k] - inverse) < tolerance * inverse
            visible_row[k] &= agrees & (edges[np.uint64(edge_indices[k])] == 0)


@njit(cache=True)
def _widen(part: Int64, columns: Float64, rows: Float64, counts: Mask) -> None:
    """Widen a part (left, top, right, bottom) so that it contains the pixels nearest to positions (w,) that count."""
    left, top, right, bottom = np.int32(part[0]), np.int32(part[1]), np.int32(part[2]), np.int32(part[3])
    for k in range(len(counts)):
        column, row = np.int32(columns[k] + 0.5), np.int32(rows[k] + 0.5)
        left, right = min(left, column if counts[k] else left), max(right, column + np.int32(1) if counts[k] else right)
        top, bottom = min(top, row if counts[k] else top), max(bottom, row + np.int32(1) if counts[k] else bottom)
    part[0], part[1], part[2], part[3] = left, top, right, bottom


@njit(cache=True)
def _inverse_about(depth_m: Float32, part: Int64) -> Float32:
    """Return 1 / depth, 1/m, of a part (left, top, right, bottom) of a frame and its surroundings.

    It is 0 where depth is invalid.
    """
    height, width = depth_m.shape
    left, right = max(part[0] - _REACH, 0), min(part[2] + _REACH, width)
    top, bottom = max(part[1] - _REACH, 0), min(part[3] + _REACH, height)
    return inverse_in(depth_m, left, top, bottom - top, right - left)


@njit(cache=True)
def _edges_in(
    inverse_per_m: Float32, part: Int64, shape: tuple[int, int], limits: tuple[np.float32, np.float32]
) -> Edges:
    """Return 1 where a part of a frame is within reach of an edge or of the border, else 0.

    ``inverse_per_m`` is that of the part (left, top, right, bottom) and its surroundings, ``shape`` that of the frame.
    There are no edges beyond the frame.
    """
    height, width = shape
    first_column, first_row = max(part[0] - _REACH, 0), max(part[1] - _REACH, 0)
    left, top = part[0] - _WIDENED, part[1] - _WIDENED
    marked = np.zeros((part[3] - part[1] + 2 * _WIDENED, part[2] - part[0] + 2 * _WIDENED), np.uint8)
    start, stop = max(left, 0), min(left + marked.shape[1], width)
    inner_start, inner_stop = max(start, 1), min(stop, width - 1)
    steepest = limits[1] * limits[1]
    for j in range(max(-top, 0), min(len(marked), height - top)):
        row, line = top + j, marked[j]
        if row in (0, height - 1):
            line[start - left : stop - left] = 1
            continue
        if start == 0:
            line[-left] = 1
        if stop == width:
            line[width - 1 - left] = 1
        offset = inner_start - first_column
        above, below = inverse_per_m[row - 1 - first_row, offset:], inverse_per_m[row + 1 - first_row, offset:]
        here = inverse_per_m[row - first_row, offset - 1 :]
        inner = line[inner_start - left : inner_stop - left]
        for k in range(len(inner)):
            inner[k] = is_edge(here[k + 1], here[k], here[k + 2], above[k], below[k], limits[0], steepest)
    # Edges are widened in rows of which any pixel is marked: along columns, then along rows.
    near = np.zeros((part[3] - part[1], part[2] - part[0]), np.uint8)
    spread = np.empty(near.shape[1], np.uint8)
    for j in range(len(marked)):
        line, has_edge = marked[j], np.uint8(0)
        for k in range(len(line)):
            has_edge |= line[k]
        if not has_edge:
            continue
        spread[:] = 0
        for m in range(2 * _WIDENED + 1):
            shifted = line[m:]
            for k in range(len(spread)):
                spread[k] |= shifted[k]
        for m in range(max(j - 2 * _WIDENED, 0), min(j + 1, len(near))):
            into = near[m]
            for k in range(len(spread)):
                into[k] |= spread[k]
    return near
