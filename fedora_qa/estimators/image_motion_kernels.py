"""Compiled loops over frames and the flow between them, reduced by whole pixels. Arrays in, arrays and numbers out."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Bools = NDArray[np.bool_]
Box = tuple[int, int, int, int]


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
    return float(np.percentile(lengths[:count], percent)) if count else np.nan


@njit(cache=True)
def reduced(image: Float32, box: Box, step: int) -> Float32:
    """Return the means of ``step`` x ``step`` pixels of a box, as many as fit."""
    left, top, right, bottom = box
    rows, columns = (bottom - top) // step, (right - left) // step
    means = np.empty((rows, columns), np.float32)
    sums, share = np.empty(columns * step, np.float32), np.float32(1.0 / (step * step))
    for row in range(rows):
        sums[:] = 0
        for line in range(top + row * step, top + (row + 1) * step):
            pixels = image[line, left : left + columns * step]
            for column in range(columns * step):
                sums[column] += pixels[column]
        for column in range(columns):
            total = np.float32(0)
            for i in range(column * step, (column + 1) * step):
                total += sums[i]
            means[row, column] = total * share
    return means


@njit(cache=True)
def reduced_flow(flow_px: Float32, box: Box, step: int, largest_px: float) -> tuple[Float32, Bools]:
    """Return the means (h, w, 2) of a flow over ``step`` x ``step`` pixels of a box, and where all of these are valid.

    Marked as valid is nothing on the rim, two pixels wide, whose slopes reach beyond the image.
    """
    left, top, right, bottom = box
    rows, columns = (bottom - top) // step, (right - left) // step
    means, valid = np.zeros((rows, columns, 2), np.float32), np.zeros((rows, columns), np.bool_)
    wide = columns * step
    u, v, bad = np.empty(wide, np.float32), np.empty(wide, np.float32), np.empty(wide, np.int32)
    most, share = np.float32(largest_px) ** 2, np.float32(1.0 / (step * step))
    for row in range(2, rows - 2):
        u[:], v[:], bad[:] = 0, 0, 0
        for line in range(top + row * step, top + (row + 1) * step):
            pixels = flow_px[line, left : left + wide]
            for i in range(wide):
                right_px, down_px = pixels[i, 0], pixels[i, 1]
                bad[i] += 0 if right_px * right_px + down_px * down_px < most else 1
                u[i] += right_px
                v[i] += down_px
        for column in range(2, columns - 2):
            right_sum, down_sum, of_block = np.float32(0), np.float32(0), 0
            for i in range(column * step, (column + 1) * step):
                right_sum += u[i]
                down_sum += v[i]
                of_block += bad[i]
            if of_block == 0:
                means[row, column, 0], means[row, column, 1] = right_sum * share, down_sum * share
                valid[row, column] = True
    return means, valid


@njit(cache=True)
def share_of_flow(
    before: Float32, after: Float32, flow_px: Float32, valid: Bools, fewest: int, condition: float
) -> tuple[bool, float, float, float]:
    """Regress the change between two smooth images (h, w) on what a flow (h, w, 2), in their pixels, predicts.

    Returns whether there is an answer, the share, the first diagonal element of the inverse normal matrix, and the mean
    square of what is left. ``condition`` bounds the condition of the scaled matrix.
    """
    rows, columns = valid.shape
    predicted, level, change = np.empty(valid.size), np.empty(valid.size), np.empty(valid.size)
    mean = np.empty((rows, columns))
    for row in range(rows):
        for column in range(columns):
            mean[row, column] = 0.5 * (np.float64(before[row, column]) + np.float64(after[row, column]))
    count = 0
    for row in range(2, rows - 2):
        here, above, over, under, below = mean[row], mean[row - 1], mean[row - 2], mean[row + 1], mean[row + 2]
        for column in range(2, columns - 2):
            if valid[row, column]:
                right = _slope(here[column - 2], here[column - 1], here[column + 1], here[column + 2])
                down = _slope(over[column], above[column], under[column], below[column])
                predicted[count] = -(right * flow_px[row, column, 0] + down * flow_px[row, column, 1])
                level[count] = here[column]
                change[count] = np.float64(after[row, column]) - np.float64(before[row, column])
                count += 1
    if count < fewest:
        return False, 0.0, 0.0, 0.0
    design = np.ones((count, 3))
    design[:, 0] = predicted[:count]
    design[:, 2] = level[:count] - level[:count].mean()
    matrix = design.T @ design
    scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)) + 1e-300)
    # A column of zeros leaves a row of zeros, of infinite condition.
    if not np.linalg.cond(matrix / scale) <= condition:
        return False, 0.0, 0.0, 0.0
    inverse = np.linalg.inv(matrix)
    solution = inverse @ (design.T @ change[:count])
    left = change[:count] - design @ solution
    return True, float(solution[0]), float(inverse[0, 0]), float(np.mean(left * left))


@njit(cache=True)
def _slope(back_two: float, back_one: float, one: float, two: float) -> float:
    """Return the derivative: five taps, exact for quartics, 3% small at 1 rad/px."""
    return (8.0 * (one - back_one) - (two - back_two)) / 12.0
