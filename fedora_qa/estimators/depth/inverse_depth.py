"""A depth frame made ready to be read between its pixels: inverse depth, how well it is known, and where edges are.

Inverse depth is affine in the pixel on every plane, so that reading it bilinearly is exact there and its second
differences tell how far it may err elsewhere.
"""

from dataclasses import dataclass, replace
from math import ceil, sqrt
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth_kernels import edges_and_errors
from fedora_qa.estimators.flow.mask import EDGE

Depths = NDArray[np.floating[Any]]
Float32 = NDArray[np.float32]
Marks = NDArray[np.uint8]

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

_WIDENED_PX: Final = 9
"""Edges are widened by 4 px on either side, as ``flow_mask`` widens them."""

_PLACES: Final = 180_000
"""Pixels from which on distances from edges are told by blocks, at least so many of them in an image.

At 1440x1080 blocks of 3 px take an eighth of the time, and at most 6 px off the distance, 3 px as a rule: the limit of
``depth.consistency`` in its worst tile is 1.7% larger than with blocks of 2 px, of 4 px it were 3.3%.
"""


@dataclass(frozen=True, slots=True)
class DepthImage:
    """What is read of a depth frame.

    Attributes
    ----------
    depths_m
        (H, W) z-depth, m; not positive, infinite or NaN where invalid.
    error_per_m
        (H, W) how far a value of inverse depth read near each pixel may err, 1/m, besides by ``of_step``.
    of_step
        Share of itself by which every value may err as well: half of the largest step of quantised depths.
    near_edge
        (H, W) 1 within 4 px of an edge, of an invalid pixel or of the border, else 0.
    clearance_px
        (h, w) by how much each block of pixels is clear of the nearest pixel that is near an edge, at least; 0 there.
    nearest_per_m
        Inverse depth of the nearest surface; 0 where nothing is valid.
    block_px
        Side of those blocks; the last ones may stand out over the image.
    """

    depths_m: Depths
    error_per_m: Float32
    of_step: float
    near_edge: Marks
    clearance_px: Float32
    nearest_per_m: float
    block_px: int

    def moved(self, axis: int, shift_px: int) -> "DepthImage":
        """Return the image moved by whole pixels to the right (axis 0) or down (1); what comes in is no clear place."""
        along = 1 - axis
        entered = slice(0, shift_px) if shift_px > 0 else slice(shift_px, None)
        at = (slice(None), entered) if axis == 0 else (entered,)
        near_edge = np.roll(self.near_edge, shift_px, along)
        near_edge[at] = 1
        clearance_px = _clearance_px(near_edge, self.block_px)
        depths_m, error_per_m = (np.roll(image, shift_px, along) for image in (self.depths_m, self.error_per_m))
        return replace(self, depths_m=depths_m, error_per_m=error_per_m, near_edge=near_edge, clearance_px=clearance_px)


def depth_image(depths_m: Depths, relative_step: float = 0.0, least_block_px: int = 1) -> DepthImage:
    """Prepare depths (H, W) in metres, NaN or not positive where invalid.

    ``relative_step`` is the largest step of quantised depths as a share of the depth; distances from edges are told by
    blocks of ``least_block_px`` at least.
    """
    depths_m = np.ascontiguousarray(depths_m)
    single_m = np.asarray(depths_m, dtype=np.float32)
    marks, error_per_m = np.empty(depths_m.shape, np.uint8), np.empty(depths_m.shape, np.float32)
    floor = _ROUNDINGS * SINGLE_PRECISION
    nearest_per_m = edges_and_errors(single_m, EDGE, _OF_SECOND_DIFFERENCE, floor, marks, error_per_m)
    near_edge = np.asarray(cv2.dilate(marks, np.ones((_WIDENED_PX, _WIDENED_PX), np.uint8)), dtype=np.uint8)
    block_px = max(least_block_px, ceil(sqrt(depths_m.size / _PLACES)))
    clearance_px = _clearance_px(near_edge, block_px)
    return DepthImage(depths_m, error_per_m, relative_step / 2, near_edge, clearance_px, float(nearest_per_m), block_px)


def _clearance_px(near_edge: Marks, block_px: int) -> Float32:
    """Return the least distance of each block's pixels from marks (H, W): two blocks' offsets are taken off."""
    clear = np.asarray(near_edge == 0).view(np.uint8)
    if block_px == 1:
        return np.asarray(cv2.distanceTransform(clear, cv2.DIST_L2, 3), dtype=np.float32)
    # A pixel of the eroded image is that of the block that begins with it; what lies beyond the border counts as clear.
    blocks = cv2.erode(clear, np.ones((block_px, block_px), np.uint8), anchor=(0, 0))[::block_px, ::block_px]
    distances = np.asarray(cv2.distanceTransform(np.ascontiguousarray(blocks), cv2.DIST_L2, 3), dtype=np.float32)
    farther_px = np.float32(sqrt(2.0) * (block_px - 1))
    return np.asarray(np.maximum(np.float32(block_px) * distances - farther_px, np.float32(0)))
