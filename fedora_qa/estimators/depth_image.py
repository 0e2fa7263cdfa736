"""A depth frame made ready to be read between its pixels: inverse depth, how well it is known, and where edges are.

Inverse depth is affine in the pixel on every plane, so that reading it bilinearly is exact there and its second
differences tell how far it may err elsewhere.
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow_mask import edges

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

SINGLE_PRECISION: Final = 2.0**-24
"""Unit roundoff of float32."""

_ROUNDINGS: Final = 8
"""Roundings that meet a depth in single precision: made by some, stored as millimetres, read as metres."""

FINEST_RELATIVE_STEP: Final = 2 * _ROUNDINGS * SINGLE_PRECISION
"""Half of a finer step is within what rounding is allowed anyway."""

_OF_SECOND_DIFFERENCE: Final = 0.25
"""Share of the largest second difference nearby by which a value read between pixels may err.

A smooth surface read bilinearly errs by an eighth of it (Lagrange's remainder): the rest is for derivatives that vary.
White noise of sigma has second differences of 2.4 sigma along each axis and nearby ones of some 6 sigma together, so
that the two frames' shares add up to about 3 sigma, where their difference has at most 1.4.
"""


@dataclass(frozen=True, slots=True)
class DepthImage:
    """What is read of a depth frame.

    Attributes
    ----------
    inverse_per_m
        (H, W) inverse z-depth, 1/m; 0 where invalid.
    error_per_m
        (H, W) how far a value read near each pixel may err, 1/m.
    clearance_px
        (H, W) distance to the nearest pixel that is an edge, invalid, or within the border; 0 there.
    """

    inverse_per_m: Float64
    error_per_m: Float32
    clearance_px: Float32

    @property
    def nearest_per_m(self) -> float:
        """Inverse depth of the nearest surface; 0 where nothing is valid."""
        return float(self.inverse_per_m.max(initial=0.0))

    def moved(self, axis: int, shift_px: int) -> "DepthImage":
        """Return the image moved by whole pixels to the right (axis 0) or down (1); what comes in is no clear place."""
        along = 1 - axis
        inverse_per_m = np.roll(self.inverse_per_m, shift_px, along)
        error_per_m = np.roll(self.error_per_m, shift_px, along)
        clearance_px = np.roll(self.clearance_px, shift_px, along)
        entered = slice(0, shift_px) if shift_px > 0 else slice(shift_px, None)
        clearance_px[(slice(None), entered) if axis == 0 else entered] = 0.0
        return DepthImage(inverse_per_m, error_per_m, clearance_px)


def depth_image(depths_m: NDArray[np.floating], relative_step: float = 0.0) -> DepthImage:
    """Prepare depths (H, W) in metres, NaN or not positive where invalid.

    ``relative_step`` is the largest step of quantised depths as a share of the depth: values err by half of it.
    """
    depths = depths_m.astype(np.float64)
    inverse = np.divide(1.0, depths, out=np.zeros_like(depths), where=np.isfinite(depths) & (depths > 0))
    single = inverse.astype(np.float32)
    bends = np.asarray(cv2.dilate(_bends(inverse), np.ones((3, 3), np.uint8)), dtype=np.float32)
    floor = np.float32(_ROUNDINGS * SINGLE_PRECISION + relative_step / 2)
    clear = (edges(single) == 0).astype(np.uint8)
    return DepthImage(
        inverse_per_m=inverse,
        error_per_m=np.float32(_OF_SECOND_DIFFERENCE) * bends + floor * single,
        clearance_px=np.asarray(cv2.distanceTransform(clear, cv2.DIST_L2, 3), dtype=np.float32),
    )


def _bends(inverse: Float64) -> Float32:
    """Return the absolute second differences along both axes together, (H, W); 0 on the border."""
    bends = np.zeros_like(inverse)
    bends[:, 1:-1] += np.abs(inverse[:, 2:] - 2 * inverse[:, 1:-1] + inverse[:, :-2])
    bends[1:-1] += np.abs(inverse[2:] - 2 * inverse[1:-1] + inverse[:-2])
    return bends.astype(np.float32)
