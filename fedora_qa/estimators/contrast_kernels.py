"""Compiled loops over events that are carried along a flow.

Events come as columns: ``x``, ``y`` (px) and ``tau``, the instant in intervals of the flow after its start. A flow
(h, w, 2) is the displacement over the interval, px of the event camera, of the point that is at a pixel at the start.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Columns = NDArray[np.uint16]

_ROUNDS = 3
"""Steps towards the pixel at which an event's point was at the start."""


@njit(cache=True)
def vote_warped(
    x: Columns, y: Columns, tau: Float64, fields: Float32, which: Int64, turns: Float64, margin: float, images: Float64
) -> int:
    """Add each event, carried to the middle of the interval, to ``images`` (k, h, w); return how many were carried.

    Image i is carried by ``fields[which[i]]`` of (m, h, w, 2), times ``turns[i]`` (2, 2). An event counts for all
    images or none: it must have a flow in every field, and lie farther from the border than one and a half times its
    way, or than ``margin`` px. One that is carried out of the image leaves no vote. Votes are quadratic B-splines,
    whose variance is 1/4 px^2 wherever the event ends.
    """
    height, width = fields.shape[1], fields.shape[2]
    carried = 0
    for i in range(len(x)):
        if not _is_usable(x[i], y[i], tau[i], fields, margin):
            continue
        carried += 1
        for k in range(len(turns)):
            du, dv = _displacement(x[i], y[i], tau[i], fields[which[k]], turns[k])
            column, row = x[i] + (0.5 - tau[i]) * du, y[i] + (0.5 - tau[i]) * dv
            if 1.0 <= column <= width - 2.0 and 1.0 <= row <= height - 2.0:
                _vote(images[k], column, row)
    return carried


@njit(cache=True)
def _is_usable(x: int, y: int, tau: float, fields: Float32, margin: float) -> bool:
    """Whether an event has a flow in every field, and room for its way: see ``vote_warped``."""
    longest = _longest(fields, y, x)
    if not np.isfinite(longest):
        return False
    clear = min(1.5 * abs(tau - 0.5) * longest + 2.0, margin)
    return bool(clear <= x <= fields.shape[2] - 1 - clear and clear <= y <= fields.shape[1] - 1 - clear)


@njit(cache=True)
def _longest(fields: Float32, row: int, column: int) -> float:
    """Return the largest component of all fields at a pixel, px; infinite where any has none."""
    longest = 0.0
    for m in range(len(fields)):
        u, v = fields[m, row, column, 0], fields[m, row, column, 1]
        if not (np.isfinite(u) and np.isfinite(v)):
            return np.inf
        longest = max(longest, abs(u), abs(v))
    return longest


@njit(cache=True)
def _displacement(x: int, y: int, tau: float, flow: Float32, turn: Float64) -> tuple[float, float]:
    """Return the turned flow (px) at the pixel from which a point gets to (x, y) at ``tau``."""
    column, row = int(x), int(y)
    du, dv = 0.0, 0.0
    for _ in range(_ROUNDS):
        u, v = flow[row, column, 0], flow[row, column, 1]
        if not (np.isfinite(u) and np.isfinite(v)):
            break
        du, dv = turn[0, 0] * u + turn[0, 1] * v, turn[1, 0] * u + turn[1, 1] * v
        before_column, before_row = x - tau * du, y - tau * dv
        if not (0.0 <= before_column <= flow.shape[1] - 1 and 0.0 <= before_row <= flow.shape[0] - 1):
            break
        column, row = int(np.rint(before_column)), int(np.rint(before_row))
    return du, dv


@njit(cache=True)
def _vote(image: Float64, column: float, row: float) -> None:
    """Add a quadratic B-spline around a place that is at least 1 px inside the image."""
    at_column, at_row = int(np.rint(column)), int(np.rint(row))
    a, b = column - at_column, row - at_row
    for j in range(-1, 2):
        down = 0.75 - b * b if j == 0 else 0.5 * (0.5 + j * b) ** 2
        for i in range(-1, 2):
            right = 0.75 - a * a if i == 0 else 0.5 * (0.5 + i * a) ** 2
            image[at_row + j, at_column + i] += down * right


@njit(cache=True)
def meetings_with_oneself(
    x: Columns,
    y: Columns,
    tau: Float64,
    fields: Float32,
    which: Int64,
    turns: Float64,
    margin: float,
    sigma: float,
    memory: int,
) -> Float64:
    """Return for each candidate (k,) the density that events of one pixel leave where others of it are carried to.

    As ``vote_warped``, but by the flow at the pixel itself; the density is that of a vote of standard deviation
    ``sigma`` px on another like it. Of each pixel the last ``memory`` events are remembered.
    """
    height, width = fields.shape[1], fields.shape[2]
    before = np.full((height * width, memory), np.nan)
    known = np.zeros(height * width, np.int64)
    met = np.zeros(len(turns))
    for i in range(len(x)):
        if not _is_usable(x[i], y[i], tau[i], fields, margin):
            continue
        at = y[i] * width + x[i]
        for k in range(len(turns)) if known[at] else range(0):
            u, v = fields[which[k], y[i], x[i], 0], fields[which[k], y[i], x[i], 1]
            du, dv = turns[k, 0, 0] * u + turns[k, 0, 1] * v, turns[k, 1, 0] * u + turns[k, 1, 1] * v
            for j in range(min(known[at], memory)):
                apart = (tau[i] - before[at, j]) ** 2 * (du * du + dv * dv)
                met[k] += 2.0 * np.exp(-apart / (4.0 * sigma * sigma)) / (4.0 * np.pi * sigma * sigma)
        before[at, known[at] % memory] = tau[i]
        known[at] += 1
    return met
