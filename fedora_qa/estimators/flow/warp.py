"""Read images between pixels, so smoothly that interpolation adds next to no error of its own.

Both frames are seen through one kernel: a Gaussian and a cubic B-spline, together of variance 1 px^2. A B-spline read
of an image that was *not* prefiltered is the exact value, between the pixels too, of the image smoothed by that spline,
up to aliases that the spline weakens by (w / (2 pi - w))^4 at frequency w. Bilinear interpolation weakens them by the
square only, which shifts what it reads by some hundredths of a pixel at quarter-pixel positions.

A compiled loop sums the spline's 16 coefficients. docs/flow-interpolation.md measures this and other ways to read.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.warp_kernels import read_spline
from fedora_qa.estimators.images.remapping import read_at

Float32 = NDArray[np.float32]

REMAP_ROUNDING_PX: Final = 0.0 if int(cv2.__version__.split(".", maxsplit=1)[0]) >= 5 else 1 / 64
"""OpenCV 4 rounds the coordinates of bilinear reads to 1/32 px; OpenCV 5 does not (a test holds it to that)."""

SPLINE_VARIANCE_PX2: Final = 1.0 / 3.0
"""Variance of the cubic B-spline."""

_SPLINE_AT_PIXELS: Final = np.array([1 / 6, 4 / 6, 1 / 6], dtype=np.float32)


def smooth(image: Float32, sigma_px: float = 1.0) -> Float32:
    """Return the image (H, W) blurred by the Gaussian that makes ``sigma_px`` together with the B-spline."""
    taps = smoothing_taps(sigma_px)
    return np.asarray(cv2.sepFilter2D(image, cv2.CV_32F, taps, taps, borderType=cv2.BORDER_REFLECT_101))


@cache
def smoothing_taps(sigma_px: float = 1.0) -> Float32:
    """Return the weights of that Gaussian, four standard deviations to either side, of sum 1."""
    sigma = float(np.sqrt(max(sigma_px**2 - SPLINE_VARIANCE_PX2, 1e-6)))
    return np.asarray(cv2.getGaussianKernel(round(8 * sigma + 1) | 1, sigma, cv2.CV_32F), dtype=np.float32)[:, 0]


@cache
def taps_at_pixels(sigma_px: float = 1.0) -> Float32:
    """Return the weights of Gaussian and B-spline together, which see an image at its pixels, of sum 1."""
    return np.convolve(smoothing_taps(sigma_px), _SPLINE_AT_PIXELS)


def read_at_pixels(smoothed: Float32) -> Float32:
    """Return what `read_between` gives at every pixel centre, (H, W)."""
    spline = _SPLINE_AT_PIXELS
    read = cv2.sepFilter2D(smoothed, cv2.CV_32F, spline, spline, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(read, dtype=np.float32)


def read_between(smoothed: Float32, columns: Float32, rows: Float32) -> Float32:
    """Return the B-spline of ``smoothed`` at any positions (n, m); beyond the image, that of its border."""
    return np.asarray(read_spline(smoothed, columns, rows), dtype=np.float32)


def blur(image: Float32, sigma_px: float = 1.0) -> Float32:
    """Return the image (H, W) blurred by a Gaussian, to be read by `read_bilinear`."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT_101), dtype=np.float32)


def read_bilinear(image: Float32, columns: Float32, rows: Float32) -> Float32:
    """Return an image bilinearly at any positions (n, m); positions must be finite, and read the border beyond it."""
    return read_at(image, columns, rows, cv2.INTER_LINEAR, cv2.BORDER_REFLECT_101)


@dataclass(frozen=True, slots=True)
class Interpolator:
    """One way to see frames between their pixels; docs/flow-interpolation.md measures them.

    Attributes
    ----------
    smoothed
        Image (H, W) and width in px to the image that is read.
    at_pixels
        What ``between`` gives at every pixel centre of that, (H, W).
    between
        That image and finite positions (n, m), columns and rows, to what is seen there.
    """

    smoothed: Callable[[Float32, float], Float32]
    at_pixels: Callable[[Float32], Float32]
    between: Callable[[Float32, Float32, Float32], Float32]


BILINEAR: Final = Interpolator(blur, lambda blurred: blurred, read_bilinear)
SPLINE: Final = Interpolator(smooth, read_at_pixels, read_between)
