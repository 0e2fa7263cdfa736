"""Compiled loops that read frames at the times of events. Events come by pixel, as in ``event_pixel_kernels``."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

FINE, COARSE = 6, 4
"""Frames through which a polynomial is laid to read a level, and to tell how well it does."""

SECONDS, ON, OFF, LEVEL, SLOPE, COARSER, SIGN, EVEN, CORNER = range(9)
"""Columns of readings: seconds since the first frame, brighter and darker events of the pixel so far (darker ones
negative), the level, its slope (1/s), what four frames in place of six would add to it, the sign of the event, the
level of the even reconstruction, and how far two parabolas lie apart."""

READ = 9
"""So many columns."""


@njit(cache=True)
def read_at_events(
    starts: Int32,
    timestamped: Int64,
    frame_times: Int64,
    seconds: Float64,
    inverses: Float64,
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
    tells nothing. ``seconds`` (n,) are the frames' times since the first, ``inverses`` (n - 5, 6, 6) one over the
    distances of each six, 1/s: [first, order, j] of frames j and j + order of them. ``pixels`` (m,) receives
    row * width + column, ``readings`` (m, 9) the columns that are named above.

    With ``tick_s`` > 0 events are those of a sensor that compares whole values once a tick: what their steps exceed
    half a value beyond the threshold by is taken from the level.

    The corner is what lies between the parabolas through the first and the last three of the four frames around. They
    share the frames t1 and t2, so that with the divided difference of third order they differ by
    L[t0, t1, t2, t3] (t3 - t0) (t - t1) (t - t2). Where light stops to change between two frames that is of the size of
    what any polynomial cuts off the corner.
    """
    n, height, width = images.shape
    # What the pixels of a row that are read show at all frames, and the divided differences of six of them.
    levels, even_levels, usable_at = np.empty((width, n)), np.empty((width, n)), np.empty((width, n), np.bool_)
    divided, even, chosen = np.empty((FINE, FINE)), np.empty((FINE, FINE)), np.empty(width, np.int64)
    rows = 0
    for row in range(height):
        count = _choose(starts, row * width, width, (-3 * row) % every, every, chosen)
        for frame in range(n):
            _gather(images[frame, row], chosen, count, log_eps, levels[:, frame])
            _gather(even_images[frame, row], chosen, count, log_eps, even_levels[:, frame])
            for k in range(count):
                usable_at[k, frame] = usable[frame, row, chosen[k]]
        for k in range(count):
            at = row * width + chosen[k]
            begin, stop = _between(timestamped, starts[at], starts[at + 1], frame_times[0], frame_times[n - 1])
            if stop - begin < 2:
                continue
            frame, known_from, known = 0, -1, False
            on, off, beyond, even_beyond = 0.0, 0.0, 0.0, 0.0
            for i in range(begin, stop):
                t, sign = timestamped[i] >> 1, 1.0 if timestamped[i] & 1 else -1.0
                while frame_times[frame + 1] < t:
                    frame += 1
                on, off = on + max(sign, 0.0), off + min(sign, 0.0)
                first = min(max(frame + 1 - FINE // 2, 0), n - FINE)
                if first != known_from:
                    known_from, known = first, True
                    for j in range(first, first + FINE):
                        known &= usable_at[k, j]
                    if known:
                        divide(levels[k], first, inverses[first], divided)
                        divide(even_levels[k], first, inverses[first], even)
                if not known:
                    continue
                inner = min(max(frame + 1 - COARSE // 2, 0), n - COARSE)
                now = (t - frame_times[0]) * 1e-9
                level, slope = polynomial(divided, 0, seconds, first, FINE, now)
                coarse, _ = polynomial(divided, inner - first, seconds, inner, COARSE, now)
                even_level, even_slope = polynomial(even, 0, seconds, first, FINE, now)
                more, even_more = 0.0, 0.0
                if tick_s > 0.0:
                    step, even_step = max(0.0, sign * slope) * tick_s, max(0.0, sign * even_slope) * tick_s
                    more, even_more = _rounded_up(step), _rounded_up(even_step)
                    beyond += sign * (0.5 * step + more)
                    even_beyond += sign * (0.5 * even_step + even_more)
                pixels[rows] = at
                readings[rows, SECONDS], readings[rows, ON], readings[rows, OFF] = now, on, off
                readings[rows, LEVEL], readings[rows, SLOPE] = level - beyond + sign * more, slope
                readings[rows, COARSER], readings[rows, SIGN] = coarse - level, sign
                readings[rows, EVEN] = even_level - even_beyond + sign * even_more
                ends = seconds[inner + 3] - seconds[inner]
                inside = (now - seconds[inner + 1]) * (now - seconds[inner + 2])
                readings[rows, CORNER] = divided[3, inner - first] * ends * inside
                rows += 1
    return rows


@njit(cache=True)
def _choose(starts: Int32, first: int, width: int, begin: int, every: int, chosen: Int64) -> int:
    """Write which pixels of a row fire twice or more, of every so many from one on; return how many they are."""
    count = 0
    for column in range(begin, width, every):
        if starts[first + column + 1] - starts[first + column] > 1:
            chosen[count] = column
            count += 1
    return count


@njit(cache=True)
def _gather(image: NDArray[np.floating], chosen: Int64, count: int, log_eps: float, levels: Float64) -> None:
    """Write what an image's row shows at the chosen pixels: by themselves, as their reading would wait for each."""
    for k in range(count):
        levels[k] = image[chosen[k]]
    if not np.isnan(log_eps):
        for k in range(count):
            levels[k] = np.log(max(levels[k] + log_eps, 1e-3))


@njit(cache=True)
def _between(timestamped: Int64, begin: int, stop: int, after: int, until: int) -> tuple[int, int]:
    """Return which events of a pixel are later than an instant, and not later than another."""
    while begin < stop and timestamped[begin] >> 1 <= after:
        begin += 1
    while begin < stop and timestamped[stop - 1] >> 1 > until:
        stop -= 1
    return begin, stop


@njit(cache=True)
def centre_readings(
    pixels: Int64,
    readings: Float64,
    kept: Bool,
    leak_rate_hz: float,
    by_place: float,
    error: float,
    centred: Float64,
) -> int:
    """Take from what is read the mean of its pixel, and weigh it; return how many readings are left.

    Of ``readings`` (m, 9) those that are ``kept`` count, at pixels with two of them or more. Each weighs
    1 / (1 + (e / error)^2), e being what four frames would add, the corner, and ``by_place`` times what the even
    reconstruction does, all less the pixel's mean. ``pixels`` and the first column of ``readings`` are moved to the
    front; ``centred`` (m, 8) receives P, -M, L', |L'|, the level, that of four frames, the even one, each less its
    weighted mean, and the weight.
    """
    rows, begin, values = 0, 0, np.empty(7)
    sums = np.empty(7)
    while begin < len(pixels):
        stop, count, apart = begin, 0, 0.0
        while stop < len(pixels) and pixels[stop] == pixels[begin]:
            if kept[stop]:
                count += 1
                apart += readings[stop, EVEN] - readings[stop, LEVEL]
            stop += 1
        if count > 1:
            total, first = 0.0, rows
            sums[:] = 0.0
            for i in range(begin, stop):
                if not kept[i]:
                    continue
                place = by_place * (readings[i, EVEN] - readings[i, LEVEL] - apart / count)
                errors = readings[i, COARSER] ** 2 + readings[i, CORNER] ** 2 + place**2
                weight = 1.0 / (1.0 + errors / error**2)
                values[0] = readings[i, ON] - leak_rate_hz * readings[i, SECONDS]
                values[1], values[2], values[3] = readings[i, OFF], readings[i, SLOPE], abs(readings[i, SLOPE])
                values[4], values[5] = readings[i, LEVEL], readings[i, LEVEL] + readings[i, COARSER]
                values[6] = readings[i, EVEN]
                for j in range(7):
                    sums[j] += weight * values[j]
                    centred[rows, j] = values[j]
                centred[rows, 7] = weight
                total += weight
                pixels[rows], readings[rows, SECONDS] = pixels[i], readings[i, SECONDS]
                rows += 1
            sums /= max(total, 1e-300)
            for i in range(first, rows):
                for j in range(7):
                    centred[i, j] -= sums[j]
        begin = stop
    return rows


@njit(cache=True)
def divide(levels: Float64, first: int, inverses: Float64, divided: Float64) -> None:
    """Write Newton's divided differences of six levels: ``divided[order, j]`` is that of points j to j + order."""
    for j in range(FINE):
        divided[0, j] = levels[first + j]
    for order in range(1, FINE):
        for j in range(FINE - order):
            divided[order, j] = (divided[order - 1, j + 1] - divided[order - 1, j]) * inverses[order, j]


@njit(cache=True)
def polynomial(
    divided: Float64, column: int, seconds: Float64, first: int, points: int, now: float
) -> tuple[float, float]:
    """Return value and slope at ``now`` of the polynomial through so many points from the ``first`` on.

    ``divided[:, column]`` are the divided differences of these points, whose times are ``seconds``.
    """
    value, slope = divided[points - 1, column], 0.0
    for order in range(points - 2, -1, -1):
        since = now - seconds[first + order]
        slope = slope * since + value
        value = value * since + divided[order, column]
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
