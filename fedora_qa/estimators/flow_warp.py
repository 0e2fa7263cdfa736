"""Read images between pixels, so smoothly that interpolation adds next to no error of its own.

Both frames are seen through one kernel: a Gaussian and a cubic B-spline, together of variance 1 px^2. A B-spline read
of an image that was *not* prefiltered is the exact value, between the pixels too, of the image smoothed by that spline,
up to aliases that the spline weakens by (w / (2 pi - w))^4 at frequency w. Bilinear interpolation weakens them by the
square only, which shifts what it reads by some hundredths of a pixel at quarter-pixel positions.

The spline's 16 coefficients are read as four bilinear samples (C. Sigg, M. Hadwiger, Fast Third-Order Texture
Filtering, GPU Gems 2 (2005), ch. 20), which `cv2.remap` does.
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]

REMAP_ROUNDING_PX: Final = 0.0 if int(cv2.__version__.split(".", maxsplit=1)[0]) >= 5 else 1 / 64
"""OpenCV 4 rounds the coordinates of bilinear reads to 1/32 px; OpenCV 5 does not (a test holds it to that)."""

SPLINE_VARIANCE_PX2: Final = 1.0 / 3.0
"""Variance of the cubic B-spline."""

_SPLINE_AT_PIXELS: Final = np.array([1 / 6, 4 / 6, 1 / 6], dtype=np.float32)


def smooth(image: Float32, sigma_px: float = 1.0) -> Float32:
    """Return the image (H, W) blurred by the Gaussian that makes ``sigma_px`` together with the B-spline."""
    sigma = float(np.sqrt(max(sigma_px**2 - SPLINE_VARIANCE_PX2, 1e-6)))
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_REFLECT_101), dtype=np.float32)


def read_at_pixels(smoothed: Float32) -> Float32:
    """Return what `read_between` gives at every pixel centre, (H, W)."""
    spline = _SPLINE_AT_PIXELS
    read = cv2.sepFilter2D(smoothed, cv2.CV_32F, spline, spline, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(read, dtype=np.float32)


def read_between(smoothed: Float32, columns: Float32, rows: Float32) -> Float32:
    """Return the B-spline of ``smoothed`` at any positions (n, m); positions must be finite.

    Positions beyond the image read its border.
    """
    column_left, column_right, right = _pair(columns)
    row_above, row_below, below = _pair(rows)

    def bilinear(at_columns: Float32, at_rows: Float32) -> Float32:
        read = cv2.remap(smoothed, at_columns, at_rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
        return np.asarray(read, dtype=np.float32)

    above = bilinear(column_left, row_above)
    above += right * (bilinear(column_right, row_above) - above)
    under = bilinear(column_left, row_below)
    under += right * (bilinear(column_right, row_below) - under)
    above += below * (under - above)
    return above


def _pair(positions: Float32) -> tuple[Float32, Float32, Float32]:
    """Return the two places whose linear reads make the spline along one axis, and the weight of the second.

    With B-spline weights w0..w3 of the pixels i-1..i+2, the reads are at i - 1 + w1/(w0+w1) and i + 1 + w3/(w2+w3).
    """
    whole = np.floor(positions)
    t = positions - whole
    w0 = (1 - t) ** 3 / 6
    w1 = (t**2 * (3 * t - 6) + 4) / 6
    w3 = t**3 / 6
    first, second = w0 + w1, 1 - w0 - w1
    places = (whole - 1 + w1 / first, whole + 1 + w3 / second, second)
    left, right, weight = (np.asarray(place, dtype=np.float32) for place in places)
    return left, right, weight
