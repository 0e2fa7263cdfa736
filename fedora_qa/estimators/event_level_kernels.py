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


_FEWEST = 4
"""Events of a pixel that has a sample."""


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
    fired = np.zeros(usable.shape[1] * width, np.uint8)
    for i in range(len(t)):
        at = np.int64(y[i]) * width + x[i]
        fired[at] = min(fired[at] + 1, _FEWEST)
    frame, rows = 0, 0
    for i in range(len(t)):
        while frame < len(frame_times) and frame_times[frame] < t[i]:
            frame += 1
        if every > 1 and (x[i] + 3 * y[i]) % every != 0:
            continue
        at = np.int64(y[i]) * width + x[i]
        if fired[at] < _FEWEST:
            continue
        now, sign = (t[i] - frame_times[0]) * 1e-9, (1.0 if p[i] == 1 else -1.0)
        before, sample = pixels[at, _ON] + pixels[at, _OFF], int(pixels[at, _BEFORE])
        if before >= 1.0 and now - pixels[at, _T2] < least_gap * 1e-9:
            samples[at, _FRAME] = 0.0
        elif before >= 3.0 and sample >= 0 and pixels[at, _SIGN1] == pixels[at, _SIGN2]:
            at_frame = (frame_times[sample] - frame_times[0]) * 1e-9
            gap = pixels[at, _T2] - pixels[at, _T1]
            if (
                pixels[at, _T1] <= at_frame
                and 0.0 < gap <= longest_gap * 1e-9
                and gap <= 3.0 * (pixels[at, _T1] - pixels[at, _T0]) <= 9.0 * gap
                and gap <= 3.0 * (now - pixels[at, _T2]) <= 9.0 * gap
                and usable[sample, y[i], x[i]]
            ):
                brighter = pixels[at, _SIGN2] > 0.0
                step = 1.0 if sign == pixels[at, _SIGN2] else -(off_over_on if brighter else 1.0 / off_over_on)
                share, rate = _between(pixels[at, _T0], pixels[at, _T1], pixels[at, _T2], now, step, at_frame)
                # The last event has been counted; the sample lies before it.
                level_on = pixels[at, _ON] + (share - 1.0 if brighter else 0.0)
                level_off = pixels[at, _OFF] + (0.0 if brighter else share - 1.0)
                slope = rate if brighter else -rate
                straight = (at_frame - pixels[at, _T1]) / gap - share
                more_on, more_off = (straight, 0.0) if brighter else (0.0, straight)
                if samples[at, _FRAME] > 0.0:
                    places[rows, 0], places[rows, 1], places[rows, 2] = at, int(samples[at, _FRAME]) - 1, sample
                    regressors[rows, 0] = level_on - samples[at, _LEVEL_ON]
                    regressors[rows, 1] = samples[at, _LEVEL_OFF] - level_off
                    regressors[rows, 2] = max(slope, 0.0) - max(samples[at, _SLOPE], 0.0)
                    regressors[rows, 3] = min(slope, 0.0) - min(samples[at, _SLOPE], 0.0)
                    regressors[rows, 4] = max(gap, samples[at, _GAP])
                    regressors[rows, 5] = more_on - samples[at, _MORE_ON]
                    regressors[rows, 6] = samples[at, _MORE_OFF] - more_off
                    rows += 1
                samples[at, _FRAME], samples[at, _GAP] = sample + 1, gap
                samples[at, _MORE_ON], samples[at, _MORE_OFF] = more_on, more_off
                samples[at, _LEVEL_ON], samples[at, _LEVEL_OFF], samples[at, _SLOPE] = level_on, level_off, slope
        pixels[at, _T0], pixels[at, _T1], pixels[at, _T2] = pixels[at, _T1], pixels[at, _T2], now
        pixels[at, _SIGN1], pixels[at, _SIGN2] = pixels[at, _SIGN2], sign
        pixels[at, _BEFORE] = frame - 1
        pixels[at, _ON if sign > 0.0 else _OFF] += 1.0
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
