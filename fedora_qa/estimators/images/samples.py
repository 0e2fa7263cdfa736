"""Images at some of their points: slopes, noise, the same points along a flow, and tracked corners."""

from math import isqrt
from typing import Final

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

_REACH: Final = 5
_POINTS: Final = 5_000
"""Approximate number of points from which the steepness of an image is estimated: fifty lie in its steepest
hundredth."""

_DENSER: Final = 4
"""Factor by which points lie denser along rows, and rows farther apart, where points are at least 8 px apart.

Whole rows are smoothed, which takes more time than their points. Points two pixels apart or more still differ.
"""

WHITE_NOISE_GAIN: Final = 36.0
"""Sum of the squares of the weights of the difference of two Laplacians, (1, -2, 1) by (1, -2, 1) (Immerkaer 1996)."""

_GAUSSIAN = np.exp(-0.5 * np.arange(-_REACH + 1, _REACH) ** 2)
_GAUSSIAN = np.pad(_GAUSSIAN / _GAUSSIAN.sum(), 2)
_SMOOTH, _SLOPE = _GAUSSIAN[1:-1], (_GAUSSIAN[:-2] - _GAUSSIAN[2:]) / 2
"""Weights (11,) of a Gaussian of sigma 1, cut at 4 sigma, and of its central differences."""

CORNERS: Final = 500
FEWEST_CORNERS: Final = 10
"""Corners of which a tenth can be stated."""

FARTHEST_SHARE: Final = 0.1
"""Share of the corners that move at least as far as stated: more than are tracked to a wrong place."""

RETURN_PX: Final = 0.1
"""Largest distance, px, at which a corner ends that is tracked to the next image and back."""

_WINDOW: Final = (15, 15)
"""Columns and rows around a corner that are compared, px; with three halvings of the image they reach 60 px."""

_WHITE_DN: Final = 255.0


def steepness(luma: Float32, percentile: float) -> float:
    """Return a percentile of the slopes of an image, estimated from some of its points.

    Parameters
    ----------
    luma
        (H, W) DN.
    percentile
        Of the slopes of the image, smoothed with sigma 1 px; 0 to 100.

    Returns
    -------
    float
        Slope, DN/px.
    """
    stride = max(1, isqrt(luma.size // _POINTS))
    denser = _DENSER if stride >= 2 * _DENSER else 1
    return float(np.percentile(_slopes(luma, (stride * denser, stride // denser), _SMOOTH, _SLOPE), percentile))


@njit(cache=True)
def _slopes(luma: Float32, strides: tuple[int, int], smooth: Float64, slope: Float64) -> Float64:
    """Return the slopes at every ``strides[0]``-th row and ``strides[1]``-th column, row by row, DN/px.

    Beyond the border the image has the values of the border.
    """
    height, width = luma.shape
    reach, taps = len(smooth) // 2, len(smooth)
    across = (width + strides[1] - 1) // strides[1]
    slopes = np.empty(((height + strides[0] - 1) // strides[0]) * across)
    level, change = np.empty(width + 2 * reach), np.empty(width + 2 * reach)
    for i in range(len(slopes) // across):
        level[:], change[:] = 0.0, 0.0
        for k in range(taps):  # along columns first, for a whole row at once
            line = luma[min(max(i * strides[0] + k - reach, 0), height - 1)]
            level_weight, change_weight = smooth[k], slope[k]
            for column in range(width):
                level[column + reach] += level_weight * line[column]
                change[column + reach] -= change_weight * line[column]
        for k in range(reach):
            level[k], change[k] = level[reach], change[reach]
            level[width + reach + k], change[width + reach + k] = level[width + reach - 1], change[width + reach - 1]
        for j in range(across):
            right = down = 0.0
            start, stop = j * strides[1], j * strides[1] + taps
            levels, changes = level[start:stop], change[start:stop]
            for k in range(taps):
                right -= slope[k] * levels[k]
                down += smooth[k] * changes[k]
            slopes[i * across + j] = np.sqrt(right * right + down * down)
    return slopes


def along_the_flow(before: Float32, after: Float32, flow_px: Float32, step: int) -> tuple[Float32, Float32]:
    """Return the same points in two images, each averaged over 3 x 3 pixels.

    Parameters
    ----------
    before, after
        (H, W) DN.
    flow_px
        (H, W, 2) from the first image to the second, px.
    step
        Points are every ``step``-th row and column of the first image.

    Returns
    -------
    before_dn, after_dn
        (h, w) DN; NaN in the second where a point lies outside the image, or the flow is not finite.

    Raises
    ------
    ValueError
        Images and flow differ in their size.
    """
    if not before.shape == after.shape == flow_px.shape[:2]:
        raise ValueError(f"Expected frames on the flow's grid {flow_px.shape[:2]}, got {before.shape}, {after.shape}")
    return _along_the_flow(before, after, flow_px, step)


@njit(cache=True)
def _along_the_flow(before: Float32, after: Float32, flow_px: Float32, step: int) -> tuple[Float32, Float32]:
    height, width = before.shape
    rows, columns = (height + step - 1) // step, (width + step - 1) // step
    first, second = np.empty((rows, columns), np.float32), np.full((rows, columns), np.nan, np.float32)
    pixels = np.ascontiguousarray(after).reshape(-1)
    for i in range(rows):
        row = i * step
        for k in range(columns):
            first[i, k] = _mean_around(before, row, k * step)
        for k in range(columns):
            column = k * step
            x = column + np.float64(flow_px[row, column, 0])
            y = row + np.float64(flow_px[row, column, 1])
            if 1.0 <= x < width - 2 and 1.0 <= y < height - 2:
                second[i, k] = _mean_within(pixels, width, x, y)
            elif 0.0 <= x <= width - 1 and 0.0 <= y <= height - 1:  # false where the flow is NaN
                second[i, k] = _mean_at_border(after, x, y)
    return first, second


@njit(cache=True)
def _mean_within(pixels: Float32, width: int, x: float, y: float) -> float:
    """Return the bilinear mean of 3 x 3 pixels around a position inside an image whose rows follow one another.

    The four means around it share sixteen pixels, which are read once.
    """
    left, top = int(x), int(y)
    right_weight, down_weight = x - left, y - top
    first, wide = np.uint64((top - 1) * width + left - 1), np.uint64(width)  # a signed index costs a comparison
    total = 0.0
    for i in range(4):
        a, b = pixels[first], pixels[first + np.uint64(1)]
        c, d = pixels[first + np.uint64(2)], pixels[first + np.uint64(3)]
        across = (1.0 - right_weight) * a + b + c + right_weight * d
        total += across * (1.0 - down_weight if i == 0 else down_weight if i == 3 else 1.0)
        first += wide
    return float(total / 9.0)


@njit(cache=True)
def _mean_at_border(image: Float32, x: float, y: float) -> float:
    """Return the bilinear mean of 3 x 3 pixels around a position near the border, from the four means around it."""
    height, width = image.shape
    left, top = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    right_weight, down_weight = x - left, y - top
    right, below = min(left + 1, width - 1), min(top + 1, height - 1)
    above = (1.0 - right_weight) * _mean_around(image, top, left) + right_weight * _mean_around(image, top, right)
    under = (1.0 - right_weight) * _mean_around(image, below, left) + right_weight * _mean_around(image, below, right)
    return float((1.0 - down_weight) * above + down_weight * under)


@njit(cache=True)
def _mean_around(image: Float32, row: int, column: int) -> float:
    """Return the mean of a pixel and its eight neighbours; beyond the border the image is mirrored."""
    height, width = image.shape
    total = 0.0
    if 0 < row < height - 1 and 0 < column < width - 1:
        first = np.uint64(column - 1)
        for i in range(row - 1, row + 2):
            line = image[np.uint64(i)]
            total += line[first] + line[first + np.uint64(1)] + line[first + np.uint64(2)]
        return float(total / 9.0)
    for i in range(row - 1, row + 2):
        line = image[min(abs(i), 2 * (height - 1) - abs(i)) if height > 1 else 0]
        for k in range(column - 1, column + 2):
            total += line[min(abs(k), 2 * (width - 1) - abs(k)) if width > 1 else 0]
    return total / 9.0


def noise_variances(patches: Float32) -> Float64:
    """Return an upper bound of the variance of white noise in patches of an image.

    The response is the difference of two discrete Laplacians. For white noise of variance s^2 it has the variance 36
    s^2, and it is zero for any image that bends along one axis only. Fine texture adds to it, so that the result is an
    upper bound.

    The mean of the absolute responses is sqrt(2 / pi) times the standard deviation for normal noise. A few large
    responses, at edges, have less effect on it than on the mean square.

    Parameters
    ----------
    patches
        (n, h, w), h and w at least 3, of any unit.

    Returns
    -------
    ndarray of float64
        (n,), in the square of that unit.

    Sources
    -------
    J. Immerkaer, Fast Noise Variance Estimation, Comput. Vis. Image Underst. 64 (1996) 300.
    """
    mean_responses = _mean_responses(patches)
    variances: Float64 = np.pi / 2 * mean_responses**2 / WHITE_NOISE_GAIN  # Immerkaer's sqrt(pi / 2) mean / 6, squared
    return variances


@njit(cache=True, fastmath={"reassoc"})
def _mean_responses(patches: Float32) -> Float64:
    """Return the mean absolute response (n,) of the difference of two Laplacians to each patch (n, h, w)."""
    height, width = patches.shape[1] - 2, patches.shape[2] - 2
    means, down = np.empty(len(patches)), np.empty(width + 2, np.float32)
    for i in range(len(patches)):
        total = 0.0
        for j in range(height):
            above, here, below, of_row = patches[i, j], patches[i, j + 1], patches[i, j + 2], np.float32(0)
            for k in range(width + 2):
                # The operator is separable: 1 -2 1 down the columns, then 1 -2 1 along the row.
                down[k] = above[k] - np.float32(2) * here[k] + below[k]
            for k in range(width):
                of_row += abs(down[k] - np.float32(2) * down[k + 1] + down[k + 2])
            total += np.float64(of_row)
        means[i] = total / (height * width)
    return means


def tracked_motion_px(light_dn: NDArray[np.float32]) -> float:
    """Return a distance that the image moves at least, somewhere, from one frame to the next.

    A tenth of the corners (J. Shi, C. Tomasi, "Good features to track", CVPR 1994) move as far, by the tracker of Lucas
    and Kanade on a pyramid (J.-Y. Bouguet, 2000). Corners that are not tracked back to their place are left out
    (forward-backward error: Z. Kalal, K. Mikolajczyk, J. Matas, ICPR 2010).

    Parameters
    ----------
    light_dn
        (2, h, w) light of both frames, linear DN.

    Returns
    -------
    float
        In px, less the error of a track; 0 where too few corners are tracked.
    """
    # The tracker takes 8 bits: the root spreads dark values, of which linear bits have few.
    codes = np.clip(light_dn, 0, _WHITE_DN)
    codes *= _WHITE_DN
    before, after = np.rint(np.sqrt(codes, out=codes), out=codes).astype(np.uint8)
    corners = cv2.goodFeaturesToTrack(before, CORNERS, 0.01, 5)
    if corners is None:
        return 0.0
    # The fourth argument only receives the result.
    ahead, is_ahead, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, corners.copy(), winSize=_WINDOW, maxLevel=3)
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(after, before, ahead, ahead.copy(), winSize=_WINDOW, maxLevel=3)
    steps, returns = (ahead - corners)[:, 0], (back - corners)[:, 0]
    tracked = (is_ahead[:, 0] == 1) & (is_back[:, 0] == 1) & (np.hypot(*returns.T) <= RETURN_PX)
    if np.count_nonzero(tracked) < FEWEST_CORNERS:
        return 0.0
    farthest_px = float(np.quantile(np.hypot(*steps[tracked].T), 1 - FARTHEST_SHARE))
    return max(farthest_px - RETURN_PX, 0.0)
