"""Compiled loop that finds bracketed level samples. Events come by pixel."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]
Bool = NDArray[np.bool_]

_FEWEST = 4
"""Events of a pixel that has a sample."""


@njit(cache=True)
def sample_levels(
    starts: Int32,
    timestamped: Int64,
    frame_times: Int64,
    light: Float32,
    other_light: Float32,
    error: Float32,
    least_light: float,
    hidden: Int64,
    every: int,
    longest_gap: int,
    least_gap: int,
    off_over_on: float,
    places: Int32,
    regressors: Float64,
) -> int:
    """Write a row for each two successive level samples of a pixel; return how many.

    A sample is a frame time t1 <= t < t2 between two events of one polarity at most ``longest_gap`` ns apart, at a
    pixel whose frame is not darker than ``least_light`` in either of two images (n, h, w), to an ``error`` (n, h, w)
    that is finite, with an event before and one after them at a third to three times their gap: a cubic through less
    even events swings. Pixels that are ``hidden``, sorted, have none.
    Events closer than ``least_gap`` ns break the chain of a pixel: between them events may be lost.
    Of the pixels, one in ``every`` is followed. Events come by pixel, as in ``event_pixel_kernels``.

    ``off_over_on`` is the ratio of the thresholds, good to first order. ``places`` (m, 3) receives pixel, earlier and
    later frame; ``regressors`` (m, 7) the brighter and darker events between the samples, fractions included (darker
    ones count negative), the change of their rates, 1/s, the longer of the two gaps, s, and what straight lines would
    add to the first two.
    """
    _, height, width = light.shape
    rows, concealed = 0, 0
    for row in range(height):
        for column in range(width):
            at = row * width + column
            begin, stop = starts[at], starts[at + 1]
            if stop - begin < _FEWEST or (every > 1 and (column + 3 * row) % every != 0):
                continue
            concealed = _passed(hidden, concealed, at)
            if concealed > 0 and hidden[concealed - 1] == at:
                continue
            frame, known, sampled = 0, False, 0
            on = (timestamped[begin] & 1) + (timestamped[begin + 1] & 1) + (timestamped[begin + 2] & 1)
            level_on, level_off, slope, gap_s, more_on, more_off = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(begin + 3, stop):
                one, other = timestamped[i - 2], timestamped[i - 1]
                brighter = other & 1
                t1, t2, t3 = one >> 1, other >> 1, timestamped[i] >> 1
                on_before, off_before, on = on, i - begin - on, on + (timestamped[i] & 1)
                if t3 - t2 < least_gap:
                    known = False
                    continue
                gap = t2 - t1
                if one & 1 != brighter or gap <= 0 or gap > longest_gap:
                    continue
                t0 = timestamped[i - 3] >> 1
                if not (gap <= 3 * (t1 - t0) <= 9 * gap and gap <= 3 * (t3 - t2) <= 9 * gap):
                    continue
                while frame < len(frame_times) and frame_times[frame] < t2:
                    frame += 1
                if frame == 0 or frame_times[frame - 1] < t1:
                    continue
                if _dark(light[frame - 1], other_light[frame - 1], error[frame - 1], least_light, row, column):
                    continue
                step = 1.0 if timestamped[i] & 1 == brighter else -(off_over_on if brighter else 1.0 / off_over_on)
                since = frame_times[0]
                share, rate = _between(
                    (t0 - since) * 1e-9,
                    (t1 - since) * 1e-9,
                    (t2 - since) * 1e-9,
                    (t3 - since) * 1e-9,
                    step,
                    (frame_times[frame - 1] - since) * 1e-9,
                )
                # The event at t2 is counted; the sample lies before it.
                now_on = on_before + (share - 1.0 if brighter else 0.0)
                now_off = off_before + (0.0 if brighter else share - 1.0)
                now_slope, now_gap_s = (rate if brighter else -rate), gap * 1e-9
                straight = (frame_times[frame - 1] - t1) / gap - share
                now_more_on, now_more_off = (straight, 0.0) if brighter else (0.0, straight)
                if known:
                    places[rows, 0], places[rows, 1], places[rows, 2] = at, sampled, frame - 1
                    regressors[rows, 0], regressors[rows, 1] = now_on - level_on, level_off - now_off
                    regressors[rows, 2] = max(now_slope, 0.0) - max(slope, 0.0)
                    regressors[rows, 3] = min(now_slope, 0.0) - min(slope, 0.0)
                    regressors[rows, 4] = max(now_gap_s, gap_s)
                    regressors[rows, 5], regressors[rows, 6] = now_more_on - more_on, more_off - now_more_off
                    rows += 1
                known, sampled, gap_s, slope = True, frame - 1, now_gap_s, now_slope
                level_on, level_off, more_on, more_off = now_on, now_off, now_more_on, now_more_off
    return rows


@njit(cache=True)
def _passed(hidden: Int64, before: int, at: int) -> int:
    """Return how many sorted pixels are not beyond one, of which so many were not ``before``."""
    while before < len(hidden) and hidden[before] <= at:
        before += 1
    return before


@njit(cache=True)
def _dark(light: Float32, other_light: Float32, error: Float32, least_light: float, row: int, column: int) -> bool:
    """Whether a pixel is darker than is told in either image (h, w), or unknown."""
    bright = light[row, column] >= least_light and other_light[row, column] >= least_light
    return not (bright and error[row, column] < np.inf)


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


@njit(cache=True)
def weigh(X: Float64, y: Float64, weights: Float64, matrix: Float64, vector: Float64) -> None:
    """Write the normal equations X'WX (k, k) and X'Wy (k,) of y (m,) on X (m, k)."""
    parameters = X.shape[1]
    matrix[:], vector[:] = 0.0, 0.0
    for i in range(len(y)):
        for j in range(parameters):
            weighted = weights[i] * X[i, j]
            vector[j] += weighted * y[i]
            for k in range(j + 1):
                matrix[j, k] += weighted * X[i, k]
    for j in range(parameters):
        for k in range(j):
            matrix[k, j] = matrix[j, k]


@njit(cache=True)
def residuals(X: Float64, y: Float64, theta: Float64, residual: Float64) -> None:
    """Write |y - X theta| (m,)."""
    for i in range(len(y)):
        left = y[i]
        for j in range(X.shape[1]):
            left -= X[i, j] * theta[j]
        residual[i] = abs(left)


_SINGULAR = 1e-13
"""Share of its diagonal to which elimination must not bring a pivot: what is left then is rounding."""


@njit(cache=True)
def solve(matrix: Float64, vector: Float64, theta: Float64) -> bool:
    """Write the solution (k,) of normal equations by elimination; return False where these are singular."""
    k = len(vector)
    left = matrix.copy()
    theta[:] = vector
    for i in range(k):
        if not left[i, i] > _SINGULAR * matrix[i, i]:
            return False
        for j in range(i + 1, k):
            share = left[j, i] / left[i, i]
            for m in range(i, k):
                left[j, m] -= share * left[i, m]
            theta[j] -= share * theta[i]
    for i in range(k - 1, -1, -1):
        for j in range(i + 1, k):
            theta[i] -= left[i, j] * theta[j]
        theta[i] /= left[i, i]
    return True


@njit(cache=True)
def huber(X: Float64, y: Float64, tuning: float, iterations: int, weights: Float64) -> bool:
    """Write the weights (m,) of Huber's M-estimate of y (m,) on X (m, k), by iterated least squares.

    Beyond ``tuning`` standard deviations residuals weigh less; the scale is from their median absolute value. Return
    False where equations are singular: weights are then worth nothing.
    """
    parameters = X.shape[1]
    matrix, vector, theta = np.empty((parameters, parameters)), np.empty(parameters), np.empty(parameters)
    residual = np.empty(len(y))
    weights[:] = 1.0
    for _ in range(iterations):
        weigh(X, y, weights, matrix, vector)
        if not solve(matrix, vector, theta):
            return False
        residuals(X, y, theta, residual)
        scale = MAD_TO_SIGMA * median_of(residual)
        if scale == 0.0:
            return True
        for i in range(len(y)):
            weights[i] = min(1.0, tuning * scale / max(residual[i], 1e-300))
    return True
