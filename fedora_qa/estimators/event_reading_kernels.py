"""Compiled loop that reads frames at the times of events. Events come as in ``event_kernels``."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

FINE, COARSE = 6, 4
"""Frames through which a polynomial is laid to read a level, and to tell how well it does."""


_ON, _OFF, _BEYOND, _EVEN_BEYOND = range(4)
"""What is remembered of a pixel: brighter and darker events so far (darker ones negative), and by how much its steps
exceeded the threshold, as either reconstruction of the frames has it."""

_EVEN = 3
"""Column of the divided differences of the even reconstruction; before it those of points from 0, 1 and 2 on."""


@njit(cache=True)
def read_at_events(
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    t: Int64,
    p: NDArray[np.uint8],
    frame_times: Int64,
    images: NDArray[np.floating],
    even_images: NDArray[np.floating],
    usable: Bool,
    log_eps: float,
    every: int,
    tick_s: float,
    pixels: Int64,
    readings: Float64,
) -> int:
    """Read levels at each event between the first and the last frame; return how many were read.

    Levels are what ``images`` (n, h, w) show, or the logarithm of that plus ``log_eps`` where this is not NaN; of
    ``even_images`` likewise. A level is that of the polynomial through the six frames around the event, which must all
    be ``usable`` (n, h, w). Of the pixels, one in ``every`` is read, where it fires twice or more: a single reading
    tells nothing. ``pixels`` (m,) receives row * width + column, ``readings`` (m, 8) the seconds since the first frame,
    the brighter and the darker events so far (darker ones negative), the level, its slope (1/s), what four frames in
    place of six would add to the level, the sign of the event, and the level of ``even_images``.

    With ``tick_s`` > 0 events are those of a sensor that compares whole values once a tick: what their steps exceed
    half a value beyond the threshold by is taken from the level.
    """
    n, height, width = images.shape
    state = np.zeros((height * width, 4))
    seconds, inverses = np.empty(FINE), np.zeros((FINE, FINE))
    divided = np.zeros((FINE, FINE))
    all_usable, known_from = np.empty((height, width), np.bool_), -1
    again = np.zeros(height * width, np.uint8)
    _mark_again(x, y, t, frame_times[0], frame_times[n - 1], width, again)
    # Events of a pixel share its polynomials as long as they share the six frames.
    curves, curve_of, first_curve, last_curve = (
        np.empty((len(pixels), FINE, 4)),
        np.zeros(height * width, np.int32),
        0,
        0,
    )
    rows, frame = 0, 0
    for i in range(len(t)):
        if t[i] <= frame_times[0] or t[i] > frame_times[n - 1]:
            continue
        while frame_times[frame + 1] < t[i]:
            frame += 1
        row, column, sign = int(y[i]), int(x[i]), (1.0 if p[i] == 1 else -1.0)
        at = row * width + column
        if again[at] < 2 or (every > 1 and (x[i] + 3 * y[i]) % every != 0):
            continue
        state[at, _ON if sign > 0.0 else _OFF] += sign
        first = min(max(frame + 1 - FINE // 2, 0), n - FINE)
        inner = min(max(frame + 1 - COARSE // 2, 0), n - COARSE) - first
        if first != known_from:
            known_from, first_curve = first, last_curve
            _prepare(usable[first : first + FINE], frame_times[first : first + FINE], all_usable, seconds, inverses)
            seconds += (frame_times[first] - frame_times[0]) * 1e-9
        if not all_usable[row, column]:
            continue
        if curve_of[at] <= first_curve:
            _divide(even_images, row, column, first, log_eps, inverses, divided)
            curves[last_curve, :, _EVEN] = divided[:, 0]
            _divide(images, row, column, first, log_eps, inverses, divided)
            curves[last_curve, :, :_EVEN] = divided[:, :_EVEN]
            last_curve += 1
            curve_of[at] = last_curve
        curve, now = curve_of[at] - 1, (t[i] - frame_times[0]) * 1e-9
        level, slope = _polynomial(curves, curve, 0, seconds, 0, FINE, now)
        coarse, _ = _polynomial(curves, curve, inner, seconds, inner, COARSE, now)
        even, even_slope = _polynomial(curves, curve, _EVEN, seconds, 0, FINE, now)
        beyond, even_beyond = 0.0, 0.0
        if tick_s > 0.0:
            step, even_step = max(0.0, sign * slope) * tick_s, max(0.0, sign * even_slope) * tick_s
            beyond, even_beyond = _rounded_up(step), _rounded_up(even_step)
            state[at, _BEYOND] += sign * (0.5 * step + beyond)
            state[at, _EVEN_BEYOND] += sign * (0.5 * even_step + even_beyond)
        pixels[rows] = at
        readings[rows, 0], readings[rows, 1], readings[rows, 2] = now, state[at, _ON], state[at, _OFF]
        readings[rows, 3], readings[rows, 4] = level - state[at, _BEYOND] + sign * beyond, slope
        readings[rows, 5], readings[rows, 6] = coarse - level, sign
        readings[rows, 7] = even - state[at, _EVEN_BEYOND] + sign * even_beyond
        rows += 1
    return rows


@njit(cache=True)
def _mark_again(
    x: NDArray[np.uint16], y: NDArray[np.uint16], t: Int64, start: int, stop: int, width: int, again: NDArray[np.uint8]
) -> None:
    """Count the events of each pixel in (start, stop], up to two."""
    for i in range(len(t)):
        if start < t[i] <= stop:
            at = np.int64(y[i]) * width + x[i]
            again[at] = min(again[at] + 1, 2)


@njit(cache=True)
def _prepare(usable: Bool, times: Int64, all_usable: Bool, seconds: Float64, inverses: Float64) -> None:
    """Write where all frames are usable, their times since the first of them, and the inverses of their distances."""
    all_usable[:] = usable[0]
    for j in range(1, len(usable)):
        all_usable &= usable[j]
    for j in range(len(times)):
        seconds[j] = (times[j] - times[0]) * 1e-9
    for order in range(1, len(times)):
        for j in range(len(times) - order):
            inverses[order, j] = 1e9 / (times[j + order] - times[j])


@njit(cache=True)
def _divide(
    images: NDArray[np.floating], row: int, column: int, first: int, log_eps: float, inverses: Float64, divided: Float64
) -> None:
    """Write Newton's divided differences of a pixel: ``divided[order, j]`` is that of points j to j + order."""
    for j in range(FINE):
        value = float(images[first + j, row, column])
        divided[0, j] = value if np.isnan(log_eps) else np.log(max(value + log_eps, 1e-3))
    for order in range(1, FINE):
        for j in range(FINE - order):
            divided[order, j] = (divided[order - 1, j + 1] - divided[order - 1, j]) * inverses[order, j]


@njit(cache=True, inline="always")
def _polynomial(
    curves: Float64, curve: int, column: int, seconds: Float64, first: int, points: int, now: float
) -> tuple[float, float]:
    """Return value and slope at ``now`` of the polynomial through so many points from the ``first`` on.

    ``curves[curve, :, column]`` are the divided differences of these points.
    """
    value, slope = curves[curve, points - 1, column], 0.0
    for order in range(points - 2, -1, -1):
        since = now - seconds[first + order]
        slope = slope * since + value
        value = value * since + curves[curve, order, column]
    return value, slope


@njit(cache=True)
def number_pixels(pixels: Int64, most: int, numbers: Int64) -> int:
    """Write numbers of the different ``pixels`` (m,), below ``most``, as they first appear; return how many."""
    known, count = np.zeros(most, np.int32), 0
    for i in range(len(pixels)):
        if known[pixels[i]] == 0:
            count += 1
            known[pixels[i]] = count
        numbers[i] = known[pixels[i]] - 1
    return count


@njit(cache=True, inline="always")
def _rounded_up(step: float) -> float:
    """Return by how much rounding to whole values exceeds a value, on average, that has passed a half by U step.

    U is uniform over 0..1: the mean of 1/2 - frac(U step).
    """
    if step < 1e-9:
        return 0.5
    whole = float(np.floor(step))
    return 0.5 - (whole + (step - whole) ** 2) / (2.0 * step)
