"""Compiled look at few tiles of large frames: of each depth only the parts about the tiles, and where these lead to.

What ``flow_mask_kernels`` says with maps of whole frames, to the bit.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.flow.mask_kernels import between, inverse_in

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Mask = NDArray[np.bool_]
Edges = NDArray[np.uint8]

_WIDENED = 4
"""Pixels by which edges are widened on either side."""

_ABOUT = _WIDENED + 1
"""Pixels about a part that its edges depend on."""

_MOST = 1 << 16
"""Pixels of a part up to which it is looked at as one; a tile that is torn further apart is so pixel by pixel."""


@njit(cache=True, error_model="numpy")
def seen_in_parts(
    H: Float64,
    t_px: Float64,
    origins: Int64,
    size: tuple[int, int],
    depth0_m: Float32,
    depth1_m: Float32,
    bends: tuple[np.float32, np.float32],
    tolerance: float,
    uncertainty_px: float,
    fewest: int,
) -> Mask:
    """Return which pixels of tiles (n, h, w), away from edges of the first frame, reappear in a second frame.

    As ``seen_again``, from the depths (H, W) themselves; ``bends`` are the limits of ``mark_edges``. None of tiles of
    which so few pixels may that they are fewer than the ``fewest``.
    """
    shape = depth1_m.shape
    height, width = shape
    seen = np.zeros((len(origins), size[0], size[1]), np.bool_)
    x1, y1, ratio = np.empty(size), np.empty(size), np.empty(size)
    part = np.empty(4, np.int64)
    for i in range(len(origins)):
        left, top = origins[i, 0], origins[i, 1]
        part[0], part[1], part[2], part[3] = left, top, left + size[1], top + size[0]
        inverse0, of_tile = _inverse_about(depth0_m, part), seen[i]
        near0 = _edges_in(inverse0, part, shape, bends)
        if size[0] * size[1] - np.count_nonzero(near0) < fewest:
            continue
        above, before = top - max(top - _ABOUT, 0), left - max(left - _ABOUT, 0)
        part[0], part[1], part[2], part[3] = width, height, 0, 0
        for j in range(size[0]):
            values, near, of_row = inverse0[above + j, before:], near0[j], of_tile[j]
            y, to_x, to_y, rest = np.float64(top + j), x1[j], y1[j], ratio[j]
            _project(H, t_px, np.float64(left), y, values, to_x, to_y, rest)
            for k in range(len(of_row)):
                inside = (to_x[k] >= 0) & (to_x[k] <= width - 1) & (to_y[k] >= 0) & (to_y[k] <= height - 1)
                of_row[k] = inside & (near[k] == 0) & (values[k] > 0) & (rest[k] > 0)
            _widen(part, to_x, to_y, of_row)
        if part[2] == 0 or np.count_nonzero(of_tile) < fewest:
            of_tile[:] = False
            continue
        is_one = (part[2] - part[0]) * (part[3] - part[1]) <= _MOST
        if is_one:
            inverse1 = _inverse_about(depth1_m, part)
            near1 = _edges_in(inverse1, part, shape, bends)
        if is_one and uncertainty_px == 0:
            _keep_what_agrees(inverse1, near1, part, x1, y1, ratio, inverse0[above:, before:], tolerance, of_tile)
            continue
        for j in range(size[0]):
            for k in range(size[1]):
                if not of_tile[j, k]:
                    continue
                at_column, at_row = int(x1[j, k] + 0.5), int(y1[j, k] + 0.5)
                if not is_one:
                    part[0], part[1], part[2], part[3] = at_column, at_row, at_column + 1, at_row + 1
                    inverse1 = _inverse_about(depth1_m, part)
                    near1 = _edges_in(inverse1, part, shape, bends)
                of_tile[j, k] = near1[at_row - part[1], at_column - part[0]] == 0 and _agrees(
                    inverse1,
                    x1[j, k] - max(part[0] - _ABOUT, 0),
                    y1[j, k] - max(part[1] - _ABOUT, 0),
                    np.float64(inverse0[above + j, before + k]),
                    ratio[j, k],
                    tolerance,
                    uncertainty_px,
                )
    return seen


@njit(cache=True, error_model="numpy")
def _project(
    H: Float64, t_px: Float64, left: float, y: float, inverses: Float32, to_x: Float64, to_y: Float64, rest: Float64
) -> None:
    """Write where pixels (w,) of a row get to, from the column ``left`` on, and the ratios of their depths.

    Numbers that are the same for all are taken out first: they might lie where is written to.
    """
    a, b, c, to_a = H[0, 0], H[0, 1] * y, H[0, 2], t_px[0]
    d, e, f, to_d = H[1, 0], H[1, 1] * y, H[1, 2], t_px[1]
    g, h, i, to_g = H[2, 0], H[2, 1] * y, H[2, 2], t_px[2]
    for k in range(len(rest)):  # without a branch, so that many are projected at once
        x, inverse = left + np.float64(k), np.float64(inverses[k])
        ratio = g * x + h + i + inverse * to_g
        rest[k] = ratio
        to_x[k] = (a * x + b + c + inverse * to_a) / ratio
        to_y[k] = (d * x + e + f + inverse * to_d) / ratio


@njit(cache=True)
def _keep_what_agrees(
    image: Float32,
    near: Edges,
    part: Int64,
    columns: Float64,
    rows: Float64,
    ratios: Float64,
    inverses: Float32,
    tolerance: float,
    kept: Mask,
) -> None:
    """Leave out of the pixels (h, w) of a tile those near an edge of the second frame, or whose depth is another there.

    ``image`` and ``near`` are the inverse depth about a part of the second frame, and the edges in it. Row by row first
    where, of many places at once and without a branch, then what lies there.
    """
    values, edges, wide = image.reshape(-1), near.reshape(-1), np.int32(image.shape[1])
    first_column, first_row, of_near = np.int32(part[0]), np.int32(part[1]), np.int32(near.shape[1])
    left, top = np.float64(max(part[0] - _ABOUT, 0)), np.float64(max(part[1] - _ABOUT, 0))
    last_column, last_row = np.float64(image.shape[1] - 2), np.float64(image.shape[0] - 2)
    some_column, some_row = np.float64(part[0]), np.float64(part[1])
    side, one, under = kept.shape[1], np.uint64(1), np.uint64(image.shape[1])
    firsts, to_edges, shares = np.empty(side, np.uint32), np.empty(side, np.uint32), np.empty((2, side))
    rights, belows = shares
    for j in range(len(kept)):
        of_row, to_x, to_y, rest, own = kept[j], columns[j], rows[j], ratios[j], inverses[j]
        for k in range(side):
            x, y = (to_x[k] if of_row[k] else some_column), (to_y[k] if of_row[k] else some_row)
            to_edges[k] = (np.int32(y + 0.5) - first_row) * of_near + np.int32(x + 0.5) - first_column
            x, y = min(x - left, last_column), min(y - top, last_row)  # what lies at the border is near an edge anyhow
            column, row = np.int32(x), np.int32(y)
            rights[k], belows[k], firsts[k] = x - column, y - row, row * wide + column
        for k in range(side):
            at = np.uint64(firsts[k])  # unsigned: an index that may be negative costs a comparison
            below, right = at + under, rights[k]
            over = values[at] + right * (values[at + one] - values[at])
            found = over + belows[k] * (values[below] + right * (values[below + one] - values[below]) - over)
            inverse = np.float64(own[k])
            agrees = abs(found * rest[k] - inverse) < tolerance * inverse
            of_row[k] &= agrees & (edges[np.uint64(to_edges[k])] == 0)


@njit(cache=True)
def _widen(part: Int64, columns: Float64, rows: Float64, counts: Mask) -> None:
    """Widen a part (left, top, right, bottom) by the pixels nearest to places (w,) that count."""
    left, top, right, bottom = np.int32(part[0]), np.int32(part[1]), np.int32(part[2]), np.int32(part[3])
    for k in range(len(counts)):
        column, row = np.int32(columns[k] + 0.5), np.int32(rows[k] + 0.5)
        left, right = min(left, column if counts[k] else left), max(right, column + np.int32(1) if counts[k] else right)
        top, bottom = min(top, row if counts[k] else top), max(bottom, row + np.int32(1) if counts[k] else bottom)
    part[0], part[1], part[2], part[3] = left, top, right, bottom


@njit(cache=True)
def _agrees(
    image: Float32, x: float, y: float, inverse: float, ratio: float, tolerance: float, uncertainty_px: float
) -> bool:
    """Whether an inverse depth, at a place of the second frame, is what it must be for a point of the first."""
    found, allowed = between(image, x, y), tolerance
    if uncertainty_px > 0:
        across = abs(between(image, x + 1, y) - found)
        down = abs(between(image, x, y + 1) - found)
        allowed += uncertainty_px * (across + down) / max(found, 1e-6)
    return bool(abs(found * ratio - inverse) < allowed * inverse)


@njit(cache=True)
def _inverse_about(depth_m: Float32, part: Int64) -> Float32:
    """Return 1 / depth of a part (left, top, right, bottom) of a frame and of what lies about it, 0 where invalid."""
    height, width = depth_m.shape
    left, right = max(part[0] - _ABOUT, 0), min(part[2] + _ABOUT, width)
    top, bottom = max(part[1] - _ABOUT, 0), min(part[3] + _ABOUT, height)
    return inverse_in(depth_m, left, top, bottom - top, right - left)


@njit(cache=True)
def _edges_in(
    inverse_per_m: Float32, part: Int64, shape: tuple[int, int], bends: tuple[np.float32, np.float32]
) -> Edges:
    """Return 1 where a part (left, top, right, bottom) of a frame is within reach of an edge or its border, else 0.

    ``inverse_per_m`` is that of the part and about it, ``shape`` that of the frame. Beyond it nothing is an edge.
    """
    height, width = shape
    first_column, first_row = max(part[0] - _ABOUT, 0), max(part[1] - _ABOUT, 0)
    left, top = part[0] - _WIDENED, part[1] - _WIDENED
    marked = np.zeros((part[3] - part[1] + 2 * _WIDENED, part[2] - part[0] + 2 * _WIDENED), np.uint8)
    start, stop = max(left, 0), min(left + marked.shape[1], width)
    inner, end = max(start, 1), min(stop, width - 1)
    steepest = bends[1] * bends[1]
    for j in range(max(-top, 0), min(len(marked), height - top)):
        row, line = top + j, marked[j]
        if row in (0, height - 1):
            line[start - left : stop - left] = 1
            continue
        if start == 0:
            line[-left] = 1
        if stop == width:
            line[width - 1 - left] = 1
        at = inner - first_column
        above, below = inverse_per_m[row - 1 - first_row, at:], inverse_per_m[row + 1 - first_row, at:]
        here = inverse_per_m[row - first_row, at - 1 :]
        into = line[inner - left : end - left]
        for k in range(len(into)):
            value, before, behind = here[k + 1], here[k], here[k + 2]
            over, under = above[k], below[k]
            bend = abs(before + behind + over + under - np.float32(4) * value)
            across, down = np.float32(0.5) * (behind - before), np.float32(0.5) * (under - over)
            steep = across * across + down * down > steepest * value * value
            into[k] = (bend > bends[0] * value) | steep | (value <= 0)
    near = np.zeros((part[3] - part[1], part[2] - part[0]), np.uint8)
    spread = np.empty(near.shape[1], np.uint8)
    for j in range(len(marked)):
        line, found = marked[j], np.uint8(0)
        for k in range(len(line)):
            found |= line[k]
        if not found:
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
