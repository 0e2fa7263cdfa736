"""Ratio of the displacement between two frames to a flow: 1 for the ends of the flow, 0 for equal frames.

Least squares on ``W - A = s p + a + b (A + W)/2`` with the frames A and W and p = -g . u, the change that the flow u
makes with the gradient g of (A + W)/2; a and b absorb exposure. Frames are reduced first until most of the flow is
about a pixel, so that s is correct for large flows too. A pair of frames gives one number, for a flow of any shape:
expansion as well as a pan.

The model is that of B. D. Lucas and T. Kanade, "An iterative image registration technique", IJCAI (1981) 674, with the
flow given and one unknown in place of two for each window.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.quantile_kernels import percentile_of
from fedora_qa.estimators.images.luma import LUMA_ROUNDING_VARIANCE_DN2

Float32 = NDArray[np.float32]
Bools = NDArray[np.bool_]
Box = tuple[int, int, int, int]
"""Left, top, right, bottom, px, half-open."""

FEWEST_PIXELS: Final = 64
"""Reduced pixels below which no ratio is estimated."""

SMOOTHING_PX: Final = 1.0
CORRELATED_PIXELS: Final = 4 * pi * SMOOTHING_PX**2
"""Sum of the autocorrelation of white noise after that smoothing: this many pixels count as one."""

_GAUSSIAN = np.exp(-0.5 * (np.arange(5) / SMOOTHING_PX) ** 2)
_TAPS: Final = np.asarray(_GAUSSIAN / (2 * _GAUSSIAN.sum() - _GAUSSIAN[0]), dtype=np.float32)
"""Weights (5,) of a Gaussian of ``SMOOTHING_PX``, cut at four standard deviations: of its middle and of one side."""

LARGEST_PX: Final = 1.5
"""Frames are reduced until most of the flow is no longer than this; the smoothed image is nearly linear over it."""

_SPEED_SAMPLES: Final = 2_000
"""About this many pixels give the length of most of the flow: its rank among all errs by less than a hundredth."""

_MOST_ROWS: Final = 3
"""Most rows of which the mean of a reduced pixel is taken; of four rows it is taken of two.

At 1440x1080 the standard error of the ratio is then 0.0122, with all rows 0.0111. The least detected fault is 0.8%
larger, as the limit allows half of a flow.
"""

_LEAST_STEP_OF_PARTS: Final = 3
"""Least reduction of parts of large frames, px.

A smaller reduction takes more time without a benefit: for a slow flow at 1440x1080 there are still many reduced pixels.
The least detected fault is 1.083 of the flow, without this limit 1.084; of a part it is 2.26 and 2.32.
"""


class ReductionSettings(NamedTuple):
    """How frames and flow are reduced and regressed.

    Attributes
    ----------
    speed_samples, speed_percentile
        Approximate number of lengths of the flow that are sampled, and their percentile that stands for most of the
        flow.
    invalid_from_px
        Flow of this length or longer is not valid, px.
    reduced_flow_px, least_step_px
        Frames are reduced until most of the flow is no longer than this, by at least this number of pixels.
    most_frame_rows, most_flow_rows
        Largest number of rows of which a mean of the frame, and of the flow, is taken.
    taps
        (5,) weights of the smoothing, of its middle and of one side.
    fewest_pixels
        Number of valid reduced pixels below which nothing is regressed.
    largest_condition
        Largest condition of the normal matrix: beyond it brightness and motion cannot be separated.
    """

    speed_samples: int
    speed_percentile: float
    invalid_from_px: float
    reduced_flow_px: float
    least_step_px: int
    most_frame_rows: int
    most_flow_rows: int
    taps: Float32
    fewest_pixels: int
    largest_condition: float


_WHOLE_FRAME: Final = ReductionSettings(
    _SPEED_SAMPLES, 90.0, 1e4, LARGEST_PX, 1, _MOST_ROWS, _MOST_ROWS, _TAPS, FEWEST_PIXELS, 1e10
)
# In a part of a large frame a quarter of the lengths and one row of the flow suffice, as the flow is smooth.
_PART_OF_LARGE_FRAME: Final = _WHOLE_FRAME._replace(
    speed_samples=_SPEED_SAMPLES // 4, least_step_px=_LEAST_STEP_OF_PARTS, most_flow_rows=1
)


class RegressionSums(NamedTuple):
    """Sums over valid pixels for the regression of the change of brightness.

    Attributes
    ----------
    pixels
        Number of valid pixels.
    predicted, level, change
        Sums of the predicted change p, the level l less ``base_level``, and the change c, DN.
    pp, pl, ll, pc, lc, cc
        Sums of their products, DN^2.
    base_level
        Level that is subtracted, DN.
    """

    pixels: float
    predicted: float
    level: float
    change: float
    pp: float
    pl: float
    ll: float
    pc: float
    lc: float
    cc: float
    base_level: float


_NO_SUMS: Final = RegressionSums(*(0.0,) * 11)


class FlowRegression(NamedTuple):
    """The solution of the regression.

    Attributes
    ----------
    is_determined
        False where too little is valid, moves or has texture; the other values are then 0.
    ratio
        The ratio s of the displacement to the flow.
    inverse_element
        Diagonal element for s of the inverse normal matrix, 1/DN^2.
    residual_dn2
        Mean square of the residuals, DN^2.
    """

    is_determined: bool
    ratio: float
    inverse_element: float
    residual_dn2: float


@dataclass(frozen=True, slots=True)
class FlowRatio:
    """The ratio s of the displacement between two frames to the flow.

    Attributes
    ----------
    ratio
        1 where the frames are the ends of the flow.
    standard_error
        From the residuals of the fit, where they exceed rounding.
    rounding_error
        Standard error from rounding alone: it states whether motion and texture suffice, and does not depend on a
        fault.
    """

    ratio: float
    standard_error: float
    rounding_error: float


def flow_ratio(before: Float32, after: Float32, flow_px: Float32, box: Box | None = None) -> FlowRatio | None:
    """Return the ratio of the displacement from ``before`` to ``after`` to the flow.

    Parameters
    ----------
    before, after
        (H, W) frames, DN.
    flow_px
        (H, W, 2) from the first frame on, px, NaN where invalid.
    box
        Left, top, right, bottom of the part that is used, px; None: all.

    Returns
    -------
    FlowRatio or None
        None where too little of the flow is valid, moves or has texture.

    Raises
    ------
    ValueError
        Frames and flow differ in their size.
    """
    whole = (0, 0, before.shape[1], before.shape[0])
    fit, pixels, _ = _regress_in_box(before, after, flow_px, box or whole, _WHOLE_FRAME)
    return _with_errors(fit, pixels) if fit.is_determined else None


def flow_ratios_of_parts(
    before: Float32, after: Float32, flow_px: Float32, boxes: Sequence[Box]
) -> tuple[FlowRatio | None, list[FlowRatio | None]]:
    """Return the ratio of all parts together, with one gain and bias of brightness, and that of each part alone.

    This is for large frames. Each part is reduced according to its own flow. The regressed value is the change in DN,
    for a reduced pixel of any size.

    Parameters
    ----------
    before, after, flow_px
        As in ``flow_ratio``.
    boxes
        Left, top, right, bottom of each part, px.

    Returns
    -------
    total, parts
        The ratio of all parts, and one for each box; None where too little of the flow is valid, moves or has
        texture.

    Raises
    ------
    ValueError
        Frames and flow differ in their size.
    """
    ratios: list[FlowRatio | None] = []
    sums_of_parts, pixels_per_mean = [_NO_SUMS], 0.0
    for box in boxes:
        fit, pixels, sums = _regress_in_box(before, after, flow_px, box, _PART_OF_LARGE_FRAME)
        ratios.append(_with_errors(fit, pixels) if fit.is_determined else None)
        if sums.pixels:
            # Levels from 0 in place of a base, so that sums of parts with other bases can be added: with l = l' + base,
            # sum of l^2 = sum of l'^2 + 2 base sum of l' + n base^2, and so for the products.
            count, p_sum, l_sum, c_sum, pp, pl, ll, pc, lc, cc, base = sums
            pl, ll, lc = pl + base * p_sum, ll + base * (2 * l_sum + base * count), lc + base * c_sum
            sums_of_parts.append(RegressionSums(count, p_sum, l_sum + base * count, c_sum, pp, pl, ll, pc, lc, cc, 0.0))
            pixels_per_mean += sums.pixels / pixels
    total = RegressionSums(*(sum(column) for column in zip(*sums_of_parts, strict=True)))
    fit = FlowRegression(*_regression_of(tuple(total), FEWEST_PIXELS, _WHOLE_FRAME.largest_condition))
    return _with_errors(fit, total.pixels / pixels_per_mean) if fit.is_determined else None, ratios


def _regress_in_box(
    before: Float32, after: Float32, flow_px: Float32, box: Box, settings: ReductionSettings
) -> tuple[FlowRegression, int, RegressionSums]:
    """Return the regression within a box, the number of pixels of each mean, and the sums, 0 if pixels are too few."""
    if not before.shape == after.shape == flow_px.shape[:2]:
        raise ValueError(f"Expected frames on the flow's grid {flow_px.shape[:2]}, got {before.shape}, {after.shape}")
    fit, pixels, sums = _regression_in_box(before, after, np.ascontiguousarray(flow_px), box, settings)
    return FlowRegression(*fit), pixels, RegressionSums(*sums)


def _with_errors(fit: FlowRegression, pixels: float) -> FlowRatio:
    """Return a ratio with its errors.

    Smoothing reduces the variance of rounding by the same factor as the number of independent pixels.
    """
    rounding_dn2 = 2 * LUMA_ROUNDING_VARIANCE_DN2 / pixels
    # Smoothing correlates the residuals: one in CORRELATED_PIXELS of them is independent.
    standard_error = sqrt(fit.inverse_element * max(CORRELATED_PIXELS * fit.residual_dn2, rounding_dn2))
    return FlowRatio(fit.ratio, standard_error, sqrt(fit.inverse_element * rounding_dn2))


@njit(cache=True)
def is_constant(image: Float32) -> bool:
    """Return whether all pixels (H, W) have one value; most images differ in their first row."""
    first = image[0, 0]
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            if image[row, column] != first:
                return False
    return True


@njit(cache=True)
def reduced(image: Float32, box: Box, step: int, skip: int) -> Float32:
    """Return the means of a box of an image over blocks of ``step`` by ``step`` pixels, as many as fit.

    Parameters
    ----------
    image
        (H, W) DN.
    box
        Left, top, right, bottom, px.
    step
        Side of a block, px.
    skip
        Every ``skip``-th row of a block is read.

    Returns
    -------
    ndarray of float32
        (h, w) DN.
    """
    left, top, right, bottom = box
    rows, columns = (bottom - top) // step, (right - left) // step
    means = np.zeros((rows, columns), np.float32)
    sums, weight = np.empty(columns * step, np.float32), np.float32(1.0 / (step * _rows_taken(step, skip)))
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
            of_row[column] *= weight
    return means


@njit(cache=True)
def reduced_flow(flow_px: Float32, box: Box, step: int, skip: int, invalid_from_px: float) -> tuple[Float32, Bools]:
    """Return the means of a flow over the blocks of ``reduced``, and where all their pixels are valid.

    Parameters
    ----------
    flow_px
        (H, W, 2) px, NaN where invalid.
    box
        Left, top, right, bottom, px.
    step
        Side of a block, px.
    skip
        Every ``skip``-th row of a block is read.
    invalid_from_px
        Flow with a component of this size or larger is not valid, px.

    Returns
    -------
    means_px, valid
        (h, w, 2) px of the reduced image, 0 where not valid; (h, w), False on the rim of two pixels, whose slopes
        reach beyond the image.
    """
    left, top, right, bottom = box
    rows, columns = (bottom - top) // step, (right - left) // step
    means, valid = np.zeros((rows, columns, 2), np.float32), np.zeros((rows, columns), np.bool_)
    wide, weight = 2 * columns * step, np.float32(1.0 / (step * step * _rows_taken(step, skip)))
    most, sums = np.float32(invalid_from_px), np.empty(wide, np.float32)
    lines = flow_px.reshape(flow_px.shape[0], 2 * flow_px.shape[1])  # u and v alternate
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
                means[row, column, 0], means[row, column, 1] = u * weight, v * weight
                valid[row, column] = True
    return means, valid


@njit(cache=True)
def _rows_taken(step: int, skip: int) -> int:
    """Return the number of rows that are read if every ``skip``-th of ``step`` rows is."""
    return (step + skip - 1) // skip


@njit(cache=True)
def _smooth(image: Float32, taps: Float32) -> Float32:
    """Return an image (h, w) smoothed along both axes by taps (5,), those of the middle and of one side.

    Beyond the border the image is mirrored. The taps are written out, as loops over nine of them take four times as
    long.
    """
    height, width = image.shape
    a, b, c, d, e = taps
    line, across = np.empty(width + 8, np.float32), np.empty((height + 8, width), np.float32)
    for row in range(height + 8):
        pixels = image[_mirrored(row - 4, height)]
        for i in range(width):
            line[4 + i] = pixels[i]
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
    """Return the index within 0 ... size - 1 of the pixel that continues an image beyond its border, mirrored."""
    if size == 1:
        return 0
    place = abs(place) % (2 * size - 2)
    return min(place, 2 * size - 2 - place)


@njit(cache=True)
def _regression_sums(before: Float32, after: Float32, flow_px: Float32, valid: Bools) -> tuple[float, ...]:
    """Return ``RegressionSums`` of two smooth images (h, w) and a flow (h, w, 2) between them.

    The level of a pixel in the middle is subtracted from all levels, so that their squares lose no digits.
    """
    rows, columns = valid.shape
    mean = np.empty((rows, columns))
    for row in range(rows):
        for column in range(columns):
            mean[row, column] = 0.5 * (np.float64(before[row, column]) + np.float64(after[row, column]))
    count, base = 0, mean[rows // 2, columns // 2]
    p_sum = l_sum = c_sum = pp = pl = ll = pc = lc = cc = 0.0  # of predicted change, level and change
    for row in range(2, rows - 2):
        here, above, over, under, below = mean[row], mean[row - 1], mean[row - 2], mean[row + 1], mean[row + 2]
        for column in range(2, columns - 2):
            if valid[row, column]:
                right = _slope(here[column - 2], here[column - 1], here[column + 1], here[column + 2])
                down = _slope(over[column], above[column], under[column], below[column])
                predicted = -(right * flow_px[row, column, 0] + down * flow_px[row, column, 1])  # p = -g . u
                level = here[column] - base
                change = np.float64(after[row, column]) - np.float64(before[row, column])
                p_sum, l_sum, c_sum = p_sum + predicted, l_sum + level, c_sum + change
                pp, pl, pc = pp + predicted * predicted, pl + predicted * level, pc + predicted * change
                ll, lc, cc = ll + level * level, lc + level * change, cc + change * change
                count += 1
    return float(count), p_sum, l_sum, c_sum, pp, pl, ll, pc, lc, cc, base


@njit(cache=True)
def _slope(two_back: float, back: float, ahead: float, two_ahead: float) -> float:
    """Return the derivative by five taps: exact for quartics, 3% too small at 1 rad/px."""
    return (8.0 * (ahead - back) - (two_ahead - two_back)) / 12.0


@njit(cache=True)
def _regression_of(sums: tuple[float, ...], fewest: int, largest_condition: float) -> tuple[bool, float, float, float]:
    """Return the regression of the change on the predicted change, gain and bias: the fields of ``FlowRegression``.

    ``largest_condition`` bounds, within a factor of three, the condition of the scaled normal matrix.
    """
    count, p_sum, l_sum, c_sum, pp, pl, ll, pc, lc, cc, _ = sums
    if count < max(fewest, 1):
        return False, 0.0, 0.0, 0.0
    middle = l_sum / count  # the mean level is subtracted, so that the condition is that of the image alone
    pl, ll, lc = pl - middle * p_sum, max(ll - middle * l_sum, 0.0), lc - middle * c_sum
    if pp <= 0.0 or ll <= 0.0:
        return False, 0.0, 0.0, 0.0
    # Scaled matrix with the rows (1, a, b), (a, 1, 0), (b, 0, 1): its least eigenvalue is about its determinant over
    # the sum of its principal minors, 3 - a^2 - b^2.
    a, b = p_sum / np.sqrt(pp * count), pl / np.sqrt(pp * ll)
    determinant = 1.0 - a * a - b * b
    if not determinant * largest_condition >= 3.0 - a * a - b * b:
        return False, 0.0, 0.0, 0.0
    # Cramer's rule for s: bias and gain are eliminated, as their columns are orthogonal.
    inverse_element = 1.0 / (pp * determinant)
    ratio = inverse_element * (pc - p_sum * c_sum / count - pl * lc / ll)
    bias, gain = (c_sum - p_sum * ratio) / count, (lc - pl * ratio) / ll
    residual_squares = max(cc - ratio * pc - bias * c_sum - gain * lc, 0.0)
    return True, ratio, inverse_element, residual_squares / count


@njit(cache=True)
def _regression_in_box(
    before: Float32, after: Float32, flow_px: Float32, box: Box, settings: ReductionSettings
) -> tuple[tuple[bool, float, float, float], int, tuple[float, ...]]:
    """Return the regression of two frames within a box, the number of pixels of each mean, and the sums.

    Frames (H, W) and flow (H, W, 2) are reduced and smoothed first. The sums are 0 where there are too few pixels.
    """
    left, top, right, bottom = box
    nothing = (False, 0.0, 0.0, 0.0), 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    # Length of most of the flow, from the valid lengths at every ``stride``-th row and column.
    stride = max(1, int(np.sqrt((right - left) * (bottom - top) // settings.speed_samples)))
    lengths_px = np.empty(((bottom - top) // stride + 1) * ((right - left) // stride + 1))
    count = 0
    for row in range(top, bottom, stride):
        for column in range(left, right, stride):
            u, v = np.float64(flow_px[row, column, 0]), np.float64(flow_px[row, column, 1])
            length_px = np.sqrt(u * u + v * v)
            if length_px < settings.invalid_from_px:
                lengths_px[count] = length_px
                count += 1
    speed_px = percentile_of(lengths_px[:count], settings.speed_percentile)
    if not speed_px < settings.invalid_from_px:
        return nothing
    # Displacement shrinks with the reduced image: speed / step is at most ``reduced_flow_px``.
    step = max(settings.least_step_px, int(np.ceil(speed_px / settings.reduced_flow_px)))
    if min(right - left, bottom - top) < step:
        return nothing
    skip = (step + settings.most_frame_rows - 1) // settings.most_frame_rows
    skip_of_flow = (step + settings.most_flow_rows - 1) // settings.most_flow_rows
    flow, valid = reduced_flow(flow_px, box, step, skip_of_flow, settings.invalid_from_px)
    if np.count_nonzero(valid) < settings.fewest_pixels:
        return nothing
    first = _smooth(reduced(before, box, step, skip), settings.taps)
    second = _smooth(reduced(after, box, step, skip), settings.taps)
    sums = _regression_sums(first, second, flow, valid)
    fit = _regression_of(sums, settings.fewest_pixels, settings.largest_condition)
    return fit, step * _rows_taken(step, skip), sums
