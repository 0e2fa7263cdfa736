"""Compiled loops over events that are carried along a flow.

Events come as columns: ``x``, ``y`` (px) and ``tau``, the instant in intervals of the flow after its start. A flow
(h, w, 2) is the displacement over the interval of the point that is at a pixel at the start, px, as the event camera
sees it; NaN where there is none.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Columns = NDArray[np.uint16]

PARTS = 128
"""Votes lie at whole parts of a node: what that rounds off has a variance of 2e-5 px^2."""

_ROUNDS = 3
"""Steps towards the pixel at which an event's point was at the start."""


@njit(cache=True)
def flow_as_seen(flow_px: Float32, view: Float64, height: int, width: int) -> Float32:
    """Return a flow (H, W, 2), px of its own grid, as the event camera sees it: bilinearly, (height, width, 2).

    The view (6,) says where pixels of the event camera lie on that grid, as scale and offset of columns, then of rows,
    and how many pixels of the event camera are one of its own, along columns and rows.
    """
    seen = np.empty((height, width, 2), np.float32)
    first, last, right = np.empty(width, np.int64), np.empty(width, np.int64), np.empty(width, np.float32)
    for column in range(width):
        at = view[0] * column + view[1]
        first[column] = int(at) if 0 <= at <= flow_px.shape[1] - 1 else -1
        right[column] = np.float32(at - first[column])
        last[column] = first[column] + (right[column] > 0)  # a pixel is read as it stands, whatever lies beside it
    scale = np.float32(view[4]), np.float32(view[5])
    for row in range(height):
        at, line = view[2] * row + view[3], seen[row]
        if not 0 <= at <= flow_px.shape[0] - 1:
            line[:] = np.nan
            continue
        top, below = int(at), np.float32(at - int(at))
        upper, lower = flow_px[top], flow_px[top + (below > 0)]
        for column in range(width):
            if first[column] < 0:
                line[column] = np.nan
                continue
            a, b, share = np.uint64(first[column]), np.uint64(last[column]), right[column]
            for k in range(2):
                above = upper[a, k] + share * (upper[b, k] - upper[a, k])
                under = lower[a, k] + share * (lower[b, k] - lower[a, k])
                line[column, k] = (above + below * (under - above)) * scale[k]
    return seen


@njit(cache=True)
def squares_under(
    x: Columns,
    y: Columns,
    tau: Float64,
    flow_px: Float32,
    turns: Float64,
    weights: Float32,
    side: float,
    node_px: float,
) -> Float64:
    """Return the sum of squares (k,), per px^2, of the image of votes under a flow times each turn (k, 2, 2).

    Nodes are ``node_px`` apart; ``weights`` (PARTS, 4) are those of a vote on the nodes about it, by the part of a node
    where it lies. Of all votes each node then gives a share ``side`` to either neighbour, along both axes. Events that
    are carried beyond the image have no vote.
    """
    height, width = flow_px.shape[:2]
    per_px = 1.0 / node_px
    image = np.empty((int((height - 1) * per_px) + 8, int((width - 1) * per_px) + 8), np.float32)
    columns, rows = np.empty(len(x)), np.empty(len(x))
    squares = np.empty(len(turns))
    for k in range(len(turns)):
        count = carry(x, y, tau, flow_px, turns[k], columns, rows)
        image[:] = 0
        for i in range(count):
            _vote(image, columns[i] * per_px, rows[i] * per_px, weights)
        squares[k] = _sum_of_squares(image, np.float32(side)) * per_px * per_px
    return squares


@njit(cache=True)
def carry(
    x: Columns, y: Columns, tau: Float64, flow_px: Float32, turn: Float64, columns: Float64, rows: Float64
) -> int:
    """Write where events are at the middle of the interval, if within the image; return how many are.

    Along the flow, times a matrix (2, 2), at the pixel that a point gets to the event from. All steps towards that
    pixel are taken without a branch, though most are idle: which are, no machine can guess.
    """
    a, b, c, d = turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1]
    right, bottom = np.float64(flow_px.shape[1] - 1), np.float64(flow_px.shape[0] - 1)
    count = 0
    for i in range(len(x)):
        column, row = np.uint64(x[i]), np.uint64(y[i])  # unsigned: an index that may be negative costs a comparison
        at_column, at_row = np.float64(x[i]), np.float64(y[i])
        du = dv = 0.0
        for _ in range(_ROUNDS):
            u, v = np.float64(flow_px[row, column, 0]), np.float64(flow_px[row, column, 1])
            known = np.isfinite(u + v)
            du, dv = (a * u + b * v if known else du), (c * u + d * v if known else dv)
            before_column, before_row = at_column - tau[i] * du, at_row - tau[i] * dv
            inside = (before_column >= 0) & (before_column <= right) & (before_row >= 0) & (before_row <= bottom)
            column = np.uint64(np.int64(before_column + 0.5)) if inside else column
            row = np.uint64(np.int64(before_row + 0.5)) if inside else row
        columns[count], rows[count] = at_column + (0.5 - tau[i]) * du, at_row + (0.5 - tau[i]) * dv
        stays = (columns[count] >= 0) & (columns[count] <= right) & (rows[count] >= 0) & (rows[count] <= bottom)
        count += int(stays)
    return count


@njit(cache=True)
def _vote(image: Float32, column: float, row: float, weights: Float32) -> None:
    left, top = np.uint64(column), np.uint64(row)
    across, down = weights[np.uint64((column - left) * PARTS)], weights[np.uint64((row - top) * PARTS)]
    first, second, third, fourth = across[0], across[1], across[2], across[3]
    for k in range(4):
        line, share = image[top + np.uint64(k + 2)][left + np.uint64(2) : left + np.uint64(6)], down[k]
        before = (line[0], line[1], line[2], line[3])  # so that none waits for another
        line[0], line[1] = before[0] + share * first, before[1] + share * second
        line[2], line[3] = before[2] + share * third, before[3] + share * fourth


@njit(cache=True, fastmath={"reassoc", "contract"})
def _sum_of_squares(image: Float32, side: np.float32) -> float:
    """Return the sum of squares of an image of which each pixel gives a share to either neighbour along both axes."""
    total, middle = 0.0, np.float32(1) - side - side
    mixed = np.empty(image.shape[1], np.float32)
    for row in range(1, len(image) - 1):
        above, here, below, of_row = image[row - 1], image[row], image[row + 1], np.float32(0)
        for column in range(len(mixed)):
            mixed[column] = middle * here[column] + side * (above[column] + below[column])
        left, right = mixed[:-2], mixed[2:]
        for column in range(len(left)):
            value = middle * mixed[column + 1] + side * (left[column] + right[column])
            of_row += value * value
        total += float(of_row)
    return total


@njit(cache=True)
def meetings_with_oneself(
    pixels: Int64, tau: Float64, flows: Float32, turns: Float64, shared: Float64, node_px: float, memory: int
) -> Float64:
    """Return for each turn (k,) the density that events of one pixel leave where others of it are carried to.

    By the flow (n, 2) at the pixel itself, times the turn. ``shared`` is what two votes on a line share, by their
    distance in parts of a node; nothing beyond. Events come by pixel, those of one in order of time; each is held
    against the ``memory`` before it.
    """
    met = np.zeros(len(turns))
    for i in range(1, len(pixels)):
        for j in range(i - 1, max(i - 1 - memory, -1), -1):
            if pixels[j] != pixels[i]:
                break
            parts = abs(tau[i] - tau[j]) * PARTS / node_px
            u, v = np.float64(flows[i, 0]), np.float64(flows[i, 1])
            for k in range(len(turns)):
                du, dv = turns[k, 0, 0] * u + turns[k, 0, 1] * v, turns[k, 1, 0] * u + turns[k, 1, 1] * v
                across, down = parts * abs(du) + 0.5, parts * abs(dv) + 0.5
                if across < len(shared) and down < len(shared):
                    met[k] += 2.0 * shared[int(across)] * shared[int(down)] / (node_px * node_px)
    return met
