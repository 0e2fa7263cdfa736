"""Compiled loop that reads frames at the times of events. Events come as in ``event_kernels``."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

FINE, COARSE = 6, 4
"""Frames through which a polynomial is laid to read a level, and to tell how well it does."""


@njit(cache=True)
def read_at_events(
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    t: Int64,
    p: NDArray[np.uint8],
    frame_times: Int64,
    levels: Float64,
    every: int,
    tick_s: float,
    pixels: Int64,
    readings: Float64,
) -> int:
    """Read ``levels`` (n, h, w) at each event between the first and the last frame; return how many were read.

    A level is that of the polynomial through the six frames around the event, which must all be finite. Of the pixels,
    one in ``every`` is read. ``pixels`` (m,) receives row * width + column, ``readings`` (m, 7) the seconds since the
    first frame, the brighter and the darker events so far (darker ones negative), the level, its slope (1/s), what
    four frames in place of six would add to the level, and the sign of the event.

    With ``tick_s`` > 0 events are those of a sensor that compares whole values once a tick: what their steps exceed
    half a value beyond the threshold by is taken from the level.
    """
    n, width = len(frame_times), levels.shape[2]
    state = np.zeros((levels.shape[1] * width, 3))
    rows, frame = 0, 0
    for i in range(len(t)):
        if t[i] <= frame_times[0] or t[i] > frame_times[n - 1]:
            continue
        while frame_times[frame + 1] < t[i]:
            frame += 1
        if (x[i] + 3 * y[i]) % every != 0:
            continue
        at, sign = y[i] * width + x[i], (1.0 if p[i] == 1 else -1.0)
        state[at, 0 if sign > 0.0 else 1] += sign
        first = min(max(frame + 1 - FINE // 2, 0), n - FINE)
        inner = min(max(frame + 1 - COARSE // 2, 0), n - COARSE)
        seconds = (frame_times[first : first + FINE] - frame_times[0]) * 1e-9
        seen = levels[first : first + FINE, y[i], x[i]]
        if not np.all(np.isfinite(seen)):
            continue
        now = (t[i] - frame_times[0]) * 1e-9
        level, slope = _polynomial(seconds, seen, now)
        within = slice(inner - first, inner - first + COARSE)
        coarse, _ = _polynomial(seconds[within], seen[within], now)
        beyond = 0.0
        if tick_s > 0.0:
            step = max(0.0, sign * slope) * tick_s
            beyond = _rounded_up(step)
            state[at, 2] += sign * (0.5 * step + beyond)
        pixels[rows] = at
        readings[rows, 0], readings[rows, 1], readings[rows, 2] = now, state[at, 0], state[at, 1]
        readings[rows, 3], readings[rows, 4] = level - state[at, 2] + sign * beyond, slope
        readings[rows, 5], readings[rows, 6] = coarse - level, sign
        rows += 1
    return rows


@njit(cache=True)
def _polynomial(seconds: Float64, levels: Float64, now: float) -> tuple[float, float]:
    """Return value and slope at ``now`` of the polynomial through the points, by Newton's divided differences."""
    n = len(seconds)
    divided = levels.copy()
    for order in range(1, n):
        for i in range(n - 1, order - 1, -1):
            divided[i] = (divided[i] - divided[i - 1]) / (seconds[i] - seconds[i - order])
    value, slope = divided[n - 1], 0.0
    for i in range(n - 2, -1, -1):
        slope = slope * (now - seconds[i]) + value
        value = value * (now - seconds[i]) + divided[i]
    return value, slope


@njit(cache=True)
def _rounded_up(step: float) -> float:
    """Return by how much rounding to whole values exceeds a value, on average, that has passed a half by U step.

    U is uniform over 0..1: the mean of 1/2 - frac(U step).
    """
    if step < 1e-9:
        return 0.5
    whole = float(np.floor(step))
    return 0.5 - (whole + (step - whole) ** 2) / (2.0 * step)
