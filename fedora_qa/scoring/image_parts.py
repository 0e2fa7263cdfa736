"""Parts of an image of which errors are stated apart: near and far, beside edges of depth, on moving objects."""

from itertools import pairwise
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.edge_steps import depth_steps
from fedora_qa.scoring.error_sums import Partition

DEPTH_EDGES_M: Final = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Depths that divide near from far, m: octaves, as flow and disparity are proportional to 1 / Z."""

_DEPTH_PARTS: Final = (
    "below 1 m",
    *(f"{near:g} to {far:g} m" for near, far in pairwise(DEPTH_EDGES_M)),
    "32 m and beyond",
)

NEAR_EDGE_PX: Final = 10.0
"""A pixel closer than this to a step of depth is near an edge: the distance that MPI-Sintel has for boundaries of
occlusion (D. Butler et al., A naturalistic open source movie for optical flow evaluation, ECCV 2012)."""


def whole_image(height: int, width: int) -> Partition:
    """Return all pixels as one part."""
    return Partition("all", ("all",), np.zeros((height, width), np.int8))


def by_depth(depth_m: NDArray[Any]) -> Partition:
    """Divide pixels by z-depth (H, W), m; those without a depth are of no part."""
    labels = np.digitize(depth_m, DEPTH_EDGES_M)
    return Partition("depth", _DEPTH_PARTS, np.where(depth_m > 0, labels, -1).astype(np.int8))


def near_edges(depth_m: NDArray[np.float32], farthest_m: float) -> Partition:
    """Divide pixels into those near an edge of depth, and the others.

    Parameters
    ----------
    depth_m
        (H, W) z-depth, m; NaN where it is farther than ``farthest_m``.
    farthest_m
        End of the range of depth, m.
    """
    apart = np.ones(depth_m.shape, np.uint8)
    for axis in (0, 1):
        steps = depth_steps(depth_m, axis, farthest_m=farthest_m)
        # A step lies between two pixels: both are at the edge.
        for side in (np.floor, np.ceil):
            apart[side(steps.rows).astype(int), side(steps.columns).astype(int)] = 0
    if apart.all():
        distances_px = np.full(depth_m.shape, np.inf)
    else:
        distances_px = cv2.distanceTransform(apart, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    labels = np.where(distances_px < NEAR_EDGE_PX, 0, 1).astype(np.int8)
    return Partition("edges", ("near an edge of depth", "away from edges"), labels)


def by_motion(moving: NDArray[Any]) -> Partition:
    """Divide pixels by a mask (H, W) that is not 0 on objects that move by themselves."""
    labels = np.where(moving != 0, 0, 1).astype(np.int8)
    return Partition("motion", ("moving objects", "static world"), labels)
