"""Compiled loop that finds bracketed level samples. Events come as in ``event_kernels``."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]
Bool = NDArray[np.bool_]
Columns = NDArray[np.uint16]
Polarities = NDArray[np.uint8]

_T2, _T1, _T0, _SIGN2, _SIGN1, _ON, _OFF, _BEFORE = range(8)
"""What is remembered of a pixel, in one line of the cache: the times of its last three events, the signs of the last
two, its counts so far and the frame before its last event."""
_FRAME, _LEVEL_ON, _LEVEL_OFF, _SLOPE, _GAP, _MORE_ON, _MORE_OFF = range(7)
"""And of its last sample: the frame (one more, so that 0 is none), levels, slope and gap, and what a straight line
between the events would add to the levels."""


@njit(cache=True)
def sample_levels(
    x: Columns,
    y: Columns,
    t: Int64,
    p: Polarities,
    frame_times: Int64,
    usable: Bool,
    every: int,
    longest_gap: int,
    least_gap: int,
    off_over_on: float,
    places: Int32,
    regressors: Float64,
) -> int:
    """Write a row for each two successive level samples of a pixel; return how many.

    A sample is a frame time t1 <= t < t2 between two events of one polarity at most ``longest_gap`` ns apart, at a
    pixel whose frame is ``usable`` (n, h, w), with an event before and one after them at a third to three times their
    gap: a cubic through less even events swings.
    Events closer than ``least_gap`` ns break the chain of a pixel: between them events may be lost.
    Of the pixels, one in ``every`` is followed.

    ``off_over_on`` is the ratio of the thresholds, good to first order. ``places`` (m, 3) receives pixel, earlier and
    later frame; ``regressors`` (m, 7) the brighter and darker events between the samples, fractions included (darker
    ones count negative), the change of their rates, 1/s, the longer of the two gaps, s, and what straight lines would
    add to the first two.
    """
    width = usable.shape[2]
    # Zeros, so that memory is touched only where pixels fire.
    pixels, samples = np.zeros((usable.shape[1] * width, 8)), np.zeros((usable.shape[1] * width, 7))
    frame, rows = 0, 0
    for i in range(len(t)):
        while frame < len(frame_times) and frame_times[frame] < t[i]:
            frame += 1
        if every > 1 and (x[i] + 3 * y[i]) % every != 0:
            continue
        at = y[i] * width + x[i]
        pixel, known = pixels[at], samples[at]
        now, sign = (t[i] - frame_times[0]) * 1e-9, (1.0 if p[i] == 1 else -1.0)
        before, sample = pixel[_ON] + pixel[_OFF], int(pixel[_BEFORE])
        if before >= 1.0 and now - pixel[_T2] < least_gap * 1e-9:
            known[_FRAME] = 0.0
        elif before >= 3.0 and sample >= 0 and pixel[_SIGN1] == pixel[_SIGN2]:
            at_frame = (frame_times[sample] - frame_times[0]) * 1e-9
            gap = pixel[_T2] - pixel[_T1]
            if (
                pixel[_T1] <= at_frame
                and 0.0 < gap <= longest_gap * 1e-9
                and gap <= 3.0 * (pixel[_T1] - pixel[_T0]) <= 9.0 * gap
                and gap <= 3.0 * (now - pixel[_T2]) <= 9.0 * gap
                and usable[sample, y[i], x[i]]
            ):
                brighter = pixel[_SIGN2] > 0.0
                step = 1.0 if sign == pixel[_SIGN2] else -(off_over_on if brighter else 1.0 / off_over_on)
                share, rate = _between(pixel[_T0], pixel[_T1], pixel[_T2], now, step, at_frame)
                # The last event has been counted; the sample lies before it.
                level_on = pixel[_ON] + (share - 1.0 if brighter else 0.0)
                level_off = pixel[_OFF] + (0.0 if brighter else share - 1.0)
                slope = rate if brighter else -rate
                straight = (at_frame - pixel[_T1]) / gap - share
                more_on, more_off = (straight, 0.0) if brighter else (0.0, straight)
                if known[_FRAME] > 0.0:
                    places[rows, 0], places[rows, 1], places[rows, 2] = at, int(known[_FRAME]) - 1, sample
                    regressors[rows, 0] = level_on - known[_LEVEL_ON]
                    regressors[rows, 1] = known[_LEVEL_OFF] - level_off
                    regressors[rows, 2] = max(slope, 0.0) - max(known[_SLOPE], 0.0)
                    regressors[rows, 3] = min(slope, 0.0) - min(known[_SLOPE], 0.0)
                    regressors[rows, 4] = max(gap, known[_GAP])
                    regressors[rows, 5] = more_on - known[_MORE_ON]
                    regressors[rows, 6] = known[_MORE_OFF] - more_off
                    rows += 1
                known[_FRAME], known[_GAP] = sample + 1, gap
                known[_MORE_ON], known[_MORE_OFF] = more_on, more_off
                known[_LEVEL_ON], known[_LEVEL_OFF], known[_SLOPE] = level_on, level_off, slope
        pixel[_T0], pixel[_T1], pixel[_T2] = pixel[_T1], pixel[_T2], now
        pixel[_SIGN1], pixel[_SIGN2] = pixel[_SIGN2], sign
        pixel[_BEFORE] = frame - 1
        pixel[_ON if sign > 0.0 else _OFF] += 1.0
    return rows


@njit(cache=True)
def _between(t0: float, t1: float, t2: float, t3: float, step: float, t: float) -> tuple[float, float]:
    """Return the level at t, and its rate, of the cubic through (t0, -1), (t1, 0), (t2, 1), (t3, 1 + step).

    Newton's divided differences. The level before t1 is one event lower whatever the event at t0 was.
    """
    first, second, third = 1.0 / (t1 - t0), 1.0 / (t2 - t1), step / (t3 - t2)
    earlier, later = (second - first) / (t2 - t0), (third - second) / (t3 - t1)
    bend = (later - earlier) / (t3 - t0)
    a, b, c = t - t1, t - t2, t - t0
    level = a * second + a * b * (earlier + bend * c)
    rate = second + (a + b) * earlier + (a * b + (a + b) * c) * bend
    return level, rate


@njit(cache=True)
def mark_usable(sharp_dn: Float32, even_dn: Float32, error_dn: Float32, least_dn: float, usable: Bool) -> None:
    """Mark in ``usable`` (h, w) the pixels not darker than ``least_dn`` in either image whose error is finite."""
    for row in range(usable.shape[0]):
        for column in range(usable.shape[1]):
            darker = min(sharp_dn[row, column], even_dn[row, column])
            usable[row, column] = (darker >= least_dn) & (error_dn[row, column] < np.inf)


@njit(cache=True)
def sum_blocks(
    X: Float64,
    y: Float64,
    weights: Float64,
    block_of_row: Int64,
    times_s: Float64,
    matrices: Float64,
    vectors: Float64,
    sums: Float64,
) -> None:
    """Add normal equations of y (m,) on X (m, k) to those of their block.

    ``matrices`` (b, k, k), ``vectors`` (b, k); ``sums`` (b, 4) of w y^2, w, 1 and the times.
    """
    for i in range(len(y)):
        block, weight = block_of_row[i], weights[i]
        for j in range(X.shape[1]):
            weighted = weight * X[i, j]
            vectors[block, j] += weighted * y[i]
            for k in range(j + 1):
                matrices[block, j, k] += weighted * X[i, k]
        sums[block, 0] += weight * y[i] * y[i]
        sums[block, 1] += weight
        sums[block, 2] += 1.0
        sums[block, 3] += times_s[i]
    for j in range(X.shape[1]):
        for k in range(j):
            matrices[:, k, j] = matrices[:, j, k]
