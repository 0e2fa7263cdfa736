"""How far one frame lies from another along a flow: 1 where they are its ends, 0 where they are the same.

Least squares on ``W - A = s p + a + b (A + W)/2`` with p = -g . u, the change that the flow u makes by the gradient g
of (A + W)/2; a and b absorb exposure. Frames are reduced first until most of the flow is about a pixel, so that s holds
for large flows too. One number a pair of frames: flow of any shape will do, expansion as well as a pan.

The model is that of B. D. Lucas and T. Kanade, "An iterative image registration technique", IJCAI (1981) 674, with the
flow given and one unknown in place of two a window.
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
"""Left, top, right, bottom."""

FEWEST_PIXELS: Final = 64
"""Reduced pixels below which no ratio is estimated."""

SMOOTHING_PX: Final = 1.0
CORRELATED_PIXELS: Final = 4 * pi * SMOOTHING_PX**2
"""Sum of the autocorrelation of white noise behind that smoothing: so many pixels count as one."""

_GAUSSIAN = np.exp(-0.5 * (np.arange(5) / SMOOTHING_PX) ** 2)
_TAPS: Final = np.asarray(_GAUSSIAN / (2 * _GAUSSIAN.sum() - _GAUSSIAN[0]), dtype=np.float32)
"""Weights (5,) of a Gaussian of ``SMOOTHING_PX``, cut at four of it: of its middle and of one side."""

LARGEST_PX: Final = 1.5
"""Frames are reduced until most of the flow is no longer than this: what the smoothing keeps is then nearly linear."""

_SPEED_SAMPLES: Final = 2_000
"""About so many pixels give how long most of the flow is: its rank among all errs by less than a hundredth."""

_MOST_ROWS: Final = 3
"""Of so many rows the mean of a reduced pixel is taken, of two where it has four.

At 1440x1080 the standard error of the ratio is then 0.0122, of all rows 0.0111, and the least fault 0.8% larger, as
half of a flow is allowed for.
"""

_LEAST_STEP_OF_PARTS: Final = 3
"""Parts of large frames are reduced by so many pixels at least.

Less costs more without a gain: of a slower flow at 1440x1080 the reduced pixels are then many all the same, and the
least fault is 1083, without that 1084 thousandths of the flow; of a part 2.26 and 2.32.
"""


class ReductionSettings(NamedTuple):
    """How frames and flow are reduced and regressed.

    Attributes
    ----------
    speed_samples, speed_percentile
        About so many lengths of the flow are taken, of which this percentile is as long as most of it.
    invalid_from_px
        Flow from this length on is not valid.
    reduced_flow_px, least_step_px
        Frames are reduced until most of the flow is no longer than this, by so many pixels at least.
    most_frame_rows, most_flow_rows
        Of so many rows means are taken at most.
    taps
        (5,) weights of the smoothing, of its middle and of one side.
    fewest_pixels
        Valid reduced pixels below which nothing is regressed.
    largest_condition
        Of the normal matrix: beyond, brightness and motion cannot be separated.
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
# A quarter of the speeds and one row of the flow, which is smooth, give as much in a part of a large frame.
_PART_OF_LARGE_FRAME: Final = _WHOLE_FRAME._replace(
    speed_samples=_SPEED_SAMPLES // 4, least_step_px=_LEAST_STEP_OF_PARTS, most_flow_rows=1
)


class RegressionSums(NamedTuple):
    """Sums over valid pixels of predicted change p, level l and change c, of their products, and where levels begin."""

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
    """The ratio s, the diagonal element of the inverse normal matrix for it, and the mean square of the residuals.

    Of these only ``is_determined`` holds where too little is valid, moves or has texture.
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
    standard_error
        From the residuals of the fit, where they are more than rounding.
    rounding_error
        From rounding alone: whether motion and texture suffice, which a fault cannot change.
    """

    ratio: float
    standard_error: float
    rounding_error: float


def flow_ratio(before: Float32, after: Float32, flow_px: Float32, box: Box | None = None) -> FlowRatio | None:
    """Estimate how far ``after`` lies from ``before`` along the flow.

    Parameters
    ----------
    before, after
        (H, W) frames, DN.
    flow_px
        (H, W, 2) from the first frame on, NaN where invalid.
    box
        Left, top, right, bottom of the part that is used; None: all.

    Returns
    -------
    The ratio; None where too little of the flow is valid.

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
    """Estimate the ratio of all parts together, with one gain and bias of brightness, and that of each by itself.

    For large frames. Each part is reduced by as much as its own flow asks for: what is regressed is the change in DN,
    whatever the size of a pixel.

    Parameters
    ----------
    before, after, flow_px
        As in ``flow_ratio``.
    boxes
        Left, top, right, bottom of each part.

    Returns
    -------
    The ratio of all, and one for each box; None where too little of the flow is valid.

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
    """Return the regression within a box, of how many pixels a mean is, and the sums, none of them if too few."""
    if not before.shape == after.shape == flow_px.shape[:2]:
        raise ValueError(f"Expected frames on the flow's grid {flow_px.shape[:2]}, got {before.shape}, {after.shape}")
    fit, pixels, sums = _regression_in_box(before, after, np.ascontiguousarray(flow_px), box, settings)
    return FlowRegression(*fit), pixels, RegressionSums(*sums)


def _with_errors(fit: FlowRegression, pixels: float) -> FlowRatio:
    """Return a ratio with its errors; smoothing lowers the rounding's variance as it lowers the number of pixels."""
    rounding_dn2 = 2 * LUMA_ROUNDING_VARIANCE_DN2 / pixels
    # Residuals are correlated by the smoothing: as many fewer of them are independent.
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
    """Return the means of ``step`` x ``step`` pixels of a box, as many as fit, by every ``skip``-th of their rows."""
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
    """Return the means (h, w, 2) of a flow over the pixels of ``reduced``, in px of its images; where all are valid.

    Valid are components shorter than ``invalid_from_px``. Marked as valid is nothing on the rim, two pixels wide, whose
    slopes reach beyond the image.
    """
    left, top, right, bottom = box
    rows, columns = (bottom - top) // step, (right - left) // step
    means, valid = np.zeros((rows, columns, 2), np.float32), np.zeros((rows, columns), np.bool_)
    wide, weight = 2 * columns * step, np.float32(1.0 / (step * step * _rows_taken(step, skip)))
    most, sums = np.float32(invalid_from_px), np.empty(wide, np.float32)
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
                means[row, column, 0], means[row, column, 1] = u * weight, v * weight
                valid[row, column] = True
    return means, valid


@njit(cache=True)
def _rows_taken(step: int, skip: int) -> int:
    """Return how many of ``step`` rows are every ``skip``-th."""
    return (step + skip - 1) // skip


@njit(cache=True)
def _smooth(image: Float32, taps: Float32) -> Float32:
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
def _regression_sums(before: Float32, after: Float32, flow_px: Float32, valid: Bools) -> tuple[float, ...]:
    """Return ``RegressionSums`` of two smooth images (h, w) and a flow (h, w, 2) between them.

    Levels are from that of a pixel in the middle on, so that their squares lose no digits.
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
    """Return the derivative: five taps, exact for quartics, 3% small at 1 rad/px."""
    return (8.0 * (ahead - back) - (two_ahead - two_back)) / 12.0


@njit(cache=True)
def _regression_of(sums: tuple[float, ...], fewest: int, largest_condition: float) -> tuple[bool, float, float, float]:
    """Regress the change on what is predicted, gain and bias: the fields of ``FlowRegression``.

    ``largest_condition`` bounds, within a factor of three, the condition of the scaled normal matrix.
    """
    count, p_sum, l_sum, c_sum, pp, pl, ll, pc, lc, cc, _ = sums
    if count < max(fewest, 1):
        return False, 0.0, 0.0, 0.0
    middle = l_sum / count  # levels from their mean on, so that the condition is that of the image alone
    pl, ll, lc = pl - middle * p_sum, max(ll - middle * l_sum, 0.0), lc - middle * c_sum
    if pp <= 0.0 or ll <= 0.0:
        return False, 0.0, 0.0, 0.0
    # Of 1, a, b / a, 1, 0 / b, 0, 1, the scaled matrix: its least eigenvalue is about the determinant by the sum of
    # its minors.
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
    """Return the regression of two frames (H, W), reduced and smoothed, within a box; of how many pixels a mean is.

    And the sums, of which the number is 0 where there are too few pixels. ``flow_px`` is (H, W, 2).
    """
    left, top, right, bottom = box
    nothing = (False, 0.0, 0.0, 0.0), 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    # How long most of the flow is, by the valid lengths at every so many-th pixel.
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
