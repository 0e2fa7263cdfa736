"""Compiled loops over events that are carried along a flow.

Events come as columns: ``x``, ``y`` (px) and ``tau``, the instant in intervals of the flow after its start. A flow
(H, W, 2) is the displacement over the interval, px of its own grid, of the point that is at a pixel at the start.
A view (6,) of it says where pixels of the event camera lie on that grid, as scale and offset of columns, then of rows,
and how many pixels of the event camera are one of its own, along columns and rows. It is read bilinearly, and only
where it is asked for.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Columns = NDArray[np.uint16]

MARGIN_OF_CANVAS_PX = 8
"""By which a canvas is larger than the image on every side, so that votes need not be cut."""

VOTE_PX = 8
"""A vote covers so many pixels both ways; farther than 4 px from its place it is less than 4e-4 of its peak."""

PARTS = 128
"""Votes lie at whole parts of a pixel: what that rounds off has a variance of 5e-6 px^2."""

_ROUNDS = 3
"""Steps towards the pixel at which an event's point was at the start."""


@njit(cache=True)
def flows_at(flow_px: Float32, view: Float64, x: Columns, y: Columns) -> Float64:
    """Return the flow (n, 2), px of the event camera, at its pixels; NaN where there is none."""
    flows = np.empty((len(x), 2))
    for i in range(len(x)):
        flows[i, 0], flows[i, 1] = _flow_at(flow_px, view, int(x[i]), int(y[i]))
    return flows


@njit(cache=True)
def _flow_at(flow_px: Float32, view: Float64, column: int, row: int) -> tuple[float, float]:
    at_column, at_row = view[0] * column + view[1], view[2] * row + view[3]
    if not (0 <= at_column <= flow_px.shape[1] - 1 and 0 <= at_row <= flow_px.shape[0] - 1):
        return np.nan, np.nan
    left, top = int(at_column), int(at_row)
    right, below = at_column - left, at_row - top
    u, v = np.float64(flow_px[top, left, 0]), np.float64(flow_px[top, left, 1])
    if right > 0 or below > 0:
        beyond_left, beyond_top = left + (right > 0), top + (below > 0)
        b, c, d = right * (1 - below), (1 - right) * below, right * below
        beside, under, across = flow_px[top, beyond_left], flow_px[beyond_top, left], flow_px[beyond_top, beyond_left]
        u = (1 - right) * (1 - below) * u + b * beside[0] + c * under[0] + d * across[0]
        v = (1 - right) * (1 - below) * v + b * beside[1] + c * under[1] + d * across[1]
    return u * view[4], v * view[5]


@njit(cache=True)
def carry(
    x: Columns,
    y: Columns,
    tau: Float64,
    flow_px: Float32,
    view: Float64,
    flows: Float64,
    turns: Float64,
    shape: tuple[int, int],
) -> Float32:
    """Return where events are at the middle of the interval, (k, n, 2) column and row, by the flow times each turn.

    Along the turned flow at the pixel that a point gets to the event from; ``flows`` (n, 2) are those at the events.
    """
    places = np.empty((len(turns), len(x), 2), np.float32)
    for i in range(len(x)):
        for k in range(len(turns)):
            turn = turns[k]
            column, row = int(x[i]), int(y[i])
            u, v = flows[i, 0], flows[i, 1]
            du, dv = turn[0, 0] * u + turn[0, 1] * v, turn[1, 0] * u + turn[1, 1] * v
            for _ in range(_ROUNDS - 1):
                before_column, before_row = x[i] - tau[i] * du, y[i] - tau[i] * dv
                if not (0.0 <= before_column <= shape[1] - 1 and 0.0 <= before_row <= shape[0] - 1):
                    break
                next_column, next_row = int(before_column + 0.5), int(before_row + 0.5)
                if next_column == column and next_row == row:
                    break
                column, row = next_column, next_row
                u, v = _flow_at(flow_px, view, column, row)
                if not (np.isfinite(u) and np.isfinite(v)):
                    break
                du, dv = turn[0, 0] * u + turn[0, 1] * v, turn[1, 0] * u + turn[1, 1] * v
            places[k, i, 0], places[k, i, 1] = x[i] + (0.5 - tau[i]) * du, y[i] + (0.5 - tau[i]) * dv
    return places


@njit(cache=True, fastmath={"reassoc"})
def sum_of_squares(places: Float32, weights: Float32, canvas: Float32) -> float:
    """Return the sum of squares of the image of votes at places (n, 2), column and row; none beyond the image.

    Each vote adds to the sum what it changes, so that no image need be gone through; the ``canvas`` (h + 16, w + 16) is
    all zero before and after. ``weights`` (PARTS, VOTE_PX) are those of a vote by the part of a pixel where it lies.
    """
    total = 0.0
    for i in range(len(places)):
        left, top, right, down = _corner(places[i, 0], places[i, 1], canvas)
        if left < 0:
            continue
        of = weights[right]
        across = (of[0], of[1], of[2], of[3], of[4], of[5], of[6], of[7])
        for k in range(VOTE_PX):
            total += _vote(canvas[top + k][left : left + VOTE_PX], weights[down, k], across)
    for i in range(len(places)):
        left, top, _, _ = _corner(places[i, 0], places[i, 1], canvas)
        if left >= 0:
            for k in range(VOTE_PX):
                canvas[top + k][left : left + VOTE_PX] = 0
    return total


@njit(cache=True, fastmath={"reassoc"})
def _vote(line: Float32, share: float, across: tuple[float, ...]) -> float:
    """Add a share of eight weights to a line of eight pixels; return what that adds to the sum of squares."""
    votes = (
        share * across[0], share * across[1], share * across[2], share * across[3],
        share * across[4], share * across[5], share * across[6], share * across[7],
    )  # fmt: skip
    before = (line[0], line[1], line[2], line[3], line[4], line[5], line[6], line[7])  # so that none waits for another
    added = np.float32(0)
    for j in range(VOTE_PX):
        added += votes[j] * (before[j] + before[j] + votes[j])
        line[j] = before[j] + votes[j]
    return float(added)


@njit(cache=True)
def _corner(column: float, row: float, canvas: Float32) -> tuple[int, int, int, int]:
    """Return the first column and row of a vote on the canvas, and its parts of a pixel; -1 beyond the image."""
    height, width = canvas.shape[0] - 2 * MARGIN_OF_CANVAS_PX, canvas.shape[1] - 2 * MARGIN_OF_CANVAS_PX
    if not (0 <= column <= width - 1 and 0 <= row <= height - 1):
        return -1, -1, 0, 0
    right, down = int(column * PARTS + np.float32(0.5)), int(row * PARTS + np.float32(0.5))
    corner = MARGIN_OF_CANVAS_PX - 3
    return right // PARTS + corner, down // PARTS + corner, right % PARTS, down % PARTS


@njit(cache=True)
def meetings_with_oneself(
    pixels: Int64, tau: Float64, flows: Float64, which: Int64, turns: Float64, sigma: float, memory: int
) -> Float64:
    """Return for each candidate (k,) the density that events of one pixel leave where others of it are carried to.

    By the flow at the pixel itself, candidate i by ``flows[which[i]]`` of (m, n, 2), times ``turns[i]``; the density is
    that of a vote of standard deviation ``sigma`` px on another like it. Events come by pixel, those of one in order of
    time; each is held against the ``memory`` before it.
    """
    met = np.zeros(len(turns))
    for i in range(1, len(pixels)):
        for j in range(i - 1, max(i - 1 - memory, -1), -1):
            if pixels[j] != pixels[i]:
                break
            squared = (tau[i] - tau[j]) ** 2 / (4.0 * sigma * sigma)
            for k in range(len(turns)):
                u, v = flows[which[k], i, 0], flows[which[k], i, 1]
                du, dv = turns[k, 0, 0] * u + turns[k, 0, 1] * v, turns[k, 1, 0] * u + turns[k, 1, 1] * v
                apart = squared * (du * du + dv * dv)
                if apart < 40.0:
                    met[k] += 2.0 * np.exp(-apart) / (4.0 * np.pi * sigma * sigma)
    return met
