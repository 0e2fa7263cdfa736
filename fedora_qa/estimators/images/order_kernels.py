"""Compiled loops over frames and the flow between them, reduced by whole pixels. Arrays in, arrays and numbers out."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.quantile_kernels import percentile_of

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Bools = NDArray[np.bool_]
Box = tuple[int, int, int, int]
Sums = tuple[float, float, float, float, float, float, float, float, float, float, float]


@njit(cache=True)
def is_of_one_value(image: Float32) -> bool:
    """Return whether all pixels (H, W) have one value; most images say no in their first row."""
    first = image[0, 0]
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            if image[row, column] != first:
                return False
    return True


@njit(cache=True)
def most_of_the_flow(flow_px: Float32, box: Box, largest_px: float, percent: float, stride: int) -> float:
    """Return the percentile of the length of a flow (H, W, 2) at every so many-th pixel; NaN where none is valid.

    ``box`` is left, top, right, bottom. Valid are lengths below ``largest_px``.
    """
    left, top, right, bottom = box
    lengths = np.empty(((bottom - top) // stride + 1) * ((right - left) // stride + 1))
    count = 0
    for row in range(top, bottom, stride):
        for column in range(left, right, stride):
            u, v = np.float64(flow_px[row, column, 0]), np.float64(flow_px[row, column, 1])
            length = np.sqrt(u * u + v * v)
            if length < largest_px:
                lengths[count] = length
                count += 1
    return percentile_of(lengths[:count], percent)


@njit(cache=True)
def reduced(image: Float32, box: Box, step: int, skip: int) -> Float32:
    """Return the means of ``step`` x ``step`` pixels of a box, as many as fit, by every ``skip``-th of their rows."""
    left, top, right, bottom = box
    rows, columns = (bottom - top) // step, (right - left) // step
    means = np.zeros((rows, columns), np.float32)
    sums, share = np.empty(columns * step, np.float32), np.float32(1.0 / (step * _lines(step, skip)))
    for row in range(rows):
        sums[:] = 0
        for line in range(top + row * step, top + (row + 1) * step, skip):
            pixels = image[line, left : left + columns * step]
            for column in range(columns * step):
                sums[column] += pixels[column]
        of_row = means[row]
        for i in range(step):
            for column in range(columns):
                of_row[column] += sums[column * step + i]
        for column in range(columns):
            of_row[column] *= share
    return means


@njit(cache=True)
def reduced_flow(flow_px: Float32, box: Box, step: int, skip: int, largest_px: float) -> tuple[Float32, Bools]:
    """Return the means (h, w, 2) of a flow over the pixels of ``reduced``, in px of its images; where all are valid.

    Valid are components shorter than ``largest_px``. Marked as valid is nothing on the rim, two pixels wide, whose
    slopes reach beyond the image.
    """
    left, top, right, bottom = box
    rows, columns = (bottom - top) // step, (right - left) // step
    means, valid = np.zeros((rows, columns, 2), np.float32), np.zeros((rows, columns), np.bool_)
    wide, share = 2 * columns * step, np.float32(1.0 / (step * step * _lines(step, skip)))
    most, sums = np.float32(largest_px), np.empty(wide, np.float32)
    lines = flow_px.reshape(flow_px.shape[0], 2 * flow_px.shape[1])  # u and v by turns
    for row in range(2, rows - 2):
        sums[:] = 0
        for line in range(top + row * step, top + (row + 1) * step, skip):
            values = lines[line, 2 * left : 2 * left + wide]
            for i in range(wide):
                sums[i] += values[i] if abs(values[i]) < most else np.float32(np.nan)
        for column in range(2, columns - 2):
            u, v = np.float32(0), np.float32(0)
            for i in range(2 * column * step, 2 * (column + 1) * step, 2):
                u += sums[i]
                v += sums[i + 1]
            if not np.isnan(u + v):
                means[row, column, 0], means[row, column, 1] = u * share, v * share
                valid[row, column] = True
    return means, valid


@njit(cache=True)
def _lines(step: int, skip: int) -> int:
    """Return how many of ``step`` rows are every ``skip``-th."""
    return (step + skip - 1) // skip


@njit(cache=True)
def smooth(image: Float32, taps: Float32) -> Float32:
    """Return an image (h, w) smoothed along both axes by taps (5,), those of the middle and of one side.

    Beyond the border the image is mirrored. The taps stand one by one, as loops over nine of them take four times as
    long.
    """
    height, width = image.shape
    a, b, c, d, e = taps
    line, across = np.empty(width + 8, np.float32), np.empty((height + 8, width), np.float32)
    for row in range(height + 8):
        pixels = image[_mirrored(row - 4, height)]
        line[4 : width + 4] = pixels
        for i in range(1, 5):
            line[4 - i], line[width + 3 + i] = pixels[_mirrored(i, width)], pixels[_mirrored(width - 1 + i, width)]
        for i in range(width):
            across[row, i] = (
                a * line[i + 4] + b * (line[i + 3] + line[i + 5]) + c * (line[i + 2] + line[i + 6])
                + d * (line[i + 1] + line[i + 7]) + e * (line[i] + line[i + 8])
            )  # fmt: skip
    smoothed = np.empty((height, width), np.float32)
    for row in range(height):
        for i in range(width):
            smoothed[row, i] = (
                a * across[row + 4, i] + b * (across[row + 3, i] + across[row + 5, i])
                + c * (across[row + 2, i] + across[row + 6, i]) + d * (across[row + 1, i] + across[row + 7, i])
                + e * (across[row, i] + across[row + 8, i])
            )  # fmt: skip
    return smoothed


@njit(cache=True)
def _mirrored(place: int, size: int) -> int:
    """Return the place within 0 ... size - 1 at which an image goes on beyond its border, mirrored about its end."""
    if size == 1:
        return 0
    place = abs(place) % (2 * size - 2)
    return min(place, 2 * size - 2 - place)


@njit(cache=True)
def motion_sums(before: Float32, after: Float32, flow_px: Float32, valid: Bools) -> Sums:
    """Return the sums of what a flow (h, w, 2) predicts, of level and of change between two smooth images (h, w).

    Of number, predicted, level, change; of the products predicted x predicted, predicted x level, level x level,
    predicted x change, level x change, change x change. Levels are from a pixel of the middle on, which is the last.
    """
    rows, columns = valid.shape
    mean = np.empty((rows, columns))
    for row in range(rows):
        for column in range(columns):
            mean[row, column] = 0.5 * (np.float64(before[row, column]) + np.float64(after[row, column]))
    count, base = 0, mean[rows // 2, columns // 2]
    p_sum = l_sum = c_sum = pp = pl = ll = pc = lc = cc = 0.0  # of what is predicted, level and change
    for row in range(2, rows - 2):
        here, above, over, under, below = mean[row], mean[row - 1], mean[row - 2], mean[row + 1], mean[row + 2]
        for column in range(2, columns - 2):
            if valid[row, column]:
                right = _slope(here[column - 2], here[column - 1], here[column + 1], here[column + 2])
                down = _slope(over[column], above[column], under[column], below[column])
                predicted = -(right * flow_px[row, column, 0] + down * flow_px[row, column, 1])
                level = here[column] - base
                change = np.float64(after[row, column]) - np.float64(before[row, column])
                p_sum, l_sum, c_sum = p_sum + predicted, l_sum + level, c_sum + change
                pp, pl, pc = pp + predicted * predicted, pl + predicted * level, pc + predicted * change
                ll, lc, cc = ll + level * level, lc + level * change, cc + change * change
                count += 1
    return float(count), p_sum, l_sum, c_sum, pp, pl, ll, pc, lc, cc, base


@njit(cache=True)
def share_of_sums(sums: Sums, fewest: int, condition: float) -> tuple[bool, float, float, float]:
    """Regress the change on what is predicted, gain and bias, from ``motion_sums``.

    Returns whether there is an answer, the share, the first diagonal element of the inverse normal matrix, and the mean
    square of what is left. ``condition`` bounds, within a factor of three, the condition of the scaled matrix.
    """
    count, p_sum, l_sum, c_sum, pp, pl, ll, pc, lc, cc, _ = sums
    if count < max(fewest, 1):
        return False, 0.0, 0.0, 0.0
    middle = l_sum / count  # levels from their mean on, so that the condition tells of the image alone
    pl, ll, lc = pl - middle * p_sum, max(ll - middle * l_sum, 0.0), lc - middle * c_sum
    if pp <= 0.0 or ll <= 0.0:
        return False, 0.0, 0.0, 0.0
    # Of 1, a, b / a, 1, 0 / b, 0, 1, the scaled matrix: its least eigenvalue is about the determinant by the sum of
    # its minors.
    a, b = p_sum / np.sqrt(pp * count), pl / np.sqrt(pp * ll)
    determinant = 1.0 - a * a - b * b
    if not determinant * condition >= 3.0 - a * a - b * b:
        return False, 0.0, 0.0, 0.0
    first = 1.0 / (pp * determinant)
    share = first * (pc - p_sum * c_sum / count - pl * lc / ll)
    bias, gain = (c_sum - p_sum * share) / count, (lc - pl * share) / ll
    left = max(cc - share * pc - bias * c_sum - gain * lc, 0.0)
    return True, share, first, left / count


@njit(cache=True)
def _slope(back_two: float, back_one: float, one: float, two: float) -> float:
    """Return the derivative: five taps, exact for quartics, 3% small at 1 rad/px."""
    return (8.0 * (one - back_one) - (two - back_two)) / 12.0


@njit(cache=True)
def share_in_box(
    before: Float32, after: Float32, flow_px: Float32, box: Box, speeds: int, percent: float, largest_px: float,
    reduced_px: float, least: int, lines: tuple[int, int], taps: Float32, fewest: int, condition: float,
) -> tuple[bool, float, float, float, int, Sums]:  # fmt: skip
    """Return ``share_of_sums`` of two frames (H, W), reduced and smoothed, within a box; of how many pixels a mean is.

    And the sums, of which the number is 0 where there are too few pixels.

    Parameters
    ----------
    flow_px
        (H, W, 2), not valid from ``largest_px`` on.
    speeds, percent
        About so many of its lengths are looked at, of which this percentile is as long as most of it.
    reduced_px, least, lines
        Frames are reduced until that is no longer than this, by so many pixels at least; of so many rows the means are
        taken at most, those of frames and those of the flow.
    """
    left, top, right, bottom = box
    nothing = (False, 0.0, 0.0, 0.0, 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    stride = max(1, int(np.sqrt((right - left) * (bottom - top) // speeds)))
    speed_px = most_of_the_flow(flow_px, box, largest_px, percent, stride)
    if not speed_px < largest_px:
        return nothing
    step = max(least, int(np.ceil(speed_px / reduced_px)))
    if min(right - left, bottom - top) < step:
        return nothing
    skip, of_flow = (step + lines[0] - 1) // lines[0], (step + lines[1] - 1) // lines[1]
    flow, valid = reduced_flow(flow_px, box, step, of_flow, largest_px)
    if np.count_nonzero(valid) < fewest:
        return nothing
    first, second = smooth(reduced(before, box, step, skip), taps), smooth(reduced(after, box, step, skip), taps)
    sums = motion_sums(first, second, flow, valid)
    found, share, inverse, left_dn2 = share_of_sums(sums, fewest, condition)
    return found, share, inverse, left_dn2, step * _lines(step, skip), sums
