"""How far one frame lies from another along a flow: 1 where they are its ends, 0 where they are the same.

Least squares on ``W - A = s p + a + b (A + W)/2`` with p = -g . u, the change that the flow u makes by the gradient g
of (A + W)/2; a and b absorb exposure. Frames are reduced first until most of the flow is about a pixel, so that s holds
for large flows too. One number a pair of frames: flow of any shape will do, expansion as well as a pan.
"""

from dataclasses import dataclass
from math import ceil, pi
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.residual_flow import LUMA_ROUNDING_VARIANCE_DN2

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

FEWEST_PIXELS: Final = 64
"""Reduced pixels below which nothing is said."""

SMOOTHING_PX: Final = 1.0
CORRELATED_PIXELS: Final = 4 * pi * SMOOTHING_PX**2
"""Sum of the autocorrelation of white noise behind that smoothing: so many pixels count as one."""

LARGEST_PX: Final = 1.5
"""Frames are reduced until most of the flow is no longer than this: what the smoothing keeps is then nearly linear."""

_MOST_OF_THE_FLOW: Final = 90.0
_LARGEST_FLOW_PX: Final = 1e4


@dataclass(frozen=True, slots=True)
class MotionShare:
    """The share s of the flow by which two frames lie apart.

    Attributes
    ----------
    standard_error
        From what the fit leaves, where that is more than rounding.
    rounding_error
        From rounding alone: whether there is enough motion and texture to tell, which a fault cannot change.
    """

    share: float
    standard_error: float
    rounding_error: float


def motion_share(before: Float32, after: Float32, flow_px: Float32) -> MotionShare | None:
    """Return how far ``after`` lies from ``before`` along the flow; None where too little of the flow is valid.

    Parameters
    ----------
    before, after
        (H, W) frames, DN.
    flow_px
        (H, W, 2) from the first frame on, NaN where invalid.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        speeds_px = np.hypot(flow_px[..., 0], flow_px[..., 1])
        valid = np.asarray(speeds_px < _LARGEST_FLOW_PX)
    if np.count_nonzero(valid) < FEWEST_PIXELS:
        return None
    speed_px = np.percentile(speeds_px[valid], _MOST_OF_THE_FLOW)
    step = max(1, ceil(speed_px / LARGEST_PX))
    if min(valid.shape) < step:
        return None
    whole = _without_rim(_reduced(valid.astype(np.float32), step) > 1 - 1e-3)
    if np.count_nonzero(whole) < FEWEST_PIXELS:
        return None
    flow = _reduced(np.asarray(np.where(valid[..., None], flow_px, 0), dtype=np.float32), step)[whole] / step
    first, second = (_smooth(_reduced(frame, step)) for frame in (before, after))
    mean: Float64 = 0.5 * (first + second)
    right, down = _slope(mean, axis=1), _slope(mean, axis=0)
    predicted = -(right[whole] * flow[:, 0] + down[whole] * flow[:, 1])
    level = mean[whole] - mean[whole].mean()
    design = np.column_stack([predicted, np.ones_like(level), level])
    return _fit(design, (second - first)[whole], 2 * LUMA_ROUNDING_VARIANCE_DN2 / step**2)


def _fit(design: Float64, change: Float64, rounding_variance_dn2: float) -> MotionShare | None:
    """Return the first coefficient; smoothing lowers the rounding's variance as it lowers the number of pixels."""
    matrix = design.T @ design
    if np.linalg.cond(matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)) + 1e-300)) > 1e10:
        return None
    inverse = np.linalg.inv(matrix)
    solution = inverse @ (design.T @ change)
    left = float(np.mean((change - design @ solution) ** 2))
    errors = np.sqrt(
        inverse[0, 0] * np.array([max(CORRELATED_PIXELS * left, rounding_variance_dn2), rounding_variance_dn2])
    )
    return MotionShare(float(solution[0]), float(errors[0]), float(errors[1]))


def _without_rim(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the mask without the rim whose slopes would reach beyond the image."""
    inner = np.zeros_like(mask)
    inner[2:-2, 2:-2] = mask[2:-2, 2:-2]
    return inner


def _slope(image: Float64, axis: int) -> Float64:
    """Return the derivative: five taps, exact for quartics, 3% small at 1 rad/px."""
    ahead, behind = (np.roll(image, -by, axis) for by in (1, 2)), (np.roll(image, by, axis) for by in (1, 2))
    (one, two), (back_one, back_two) = ahead, behind
    slope: Float64 = (8 * (one - back_one) - (two - back_two)) / 12
    return slope


def _smooth(image: Float32) -> Float64:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), SMOOTHING_PX), dtype=np.float64)


def _reduced(image: Float32, step: int) -> Float32:
    """Return the means of ``step`` x ``step`` pixels."""
    if step == 1:
        return image
    rows, columns = image.shape[0] // step, image.shape[1] // step
    cut = np.ascontiguousarray(image[: rows * step, : columns * step])
    return np.asarray(cv2.resize(cut, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.float32)
