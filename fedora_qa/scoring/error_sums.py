"""Sums of errors over the pixels of parts of an image, which merge exactly and depend on no order; and the parts.

Errors are stated apart for near and far pixels, beside edges of depth, and on moving objects.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from typing import Any, Final, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.edge_steps import depth_steps
from fedora_qa.scoring.types import Split

Float64 = NDArray[np.float64]

PartKey = tuple[Split, str]

_SPLITS: Final = get_args(Split)

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


@dataclass(frozen=True, slots=True)
class Partition:
    """Pixels divided into parts.

    Attributes
    ----------
    split
        By what.
    parts
        Names of the parts.
    labels
        (H, W) index of the part of each pixel; negative: of none.
    """

    split: Split
    parts: tuple[str, ...]
    labels: NDArray[np.int8]


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


class ErrorSums:
    """Sums of several quantities over the pixels of each part, of every field apart.

    Totals add the sums of all fields with one rounding (``math.fsum``). So they depend neither on the order of the
    fields nor on which of them were summed together.
    """

    def __init__(self) -> None:
        self._fields: dict[PartKey, list[tuple[float, ...]]] = {}
        self._quantities: tuple[str, ...] = ()

    def add(self, values: Mapping[str, Float64], valid: NDArray[np.bool_], partitions: Sequence[Partition]) -> None:
        """Add a field.

        Parameters
        ----------
        values
            Of each quantity (n,), of the valid pixels in their order; the same quantities in every call.
        valid
            (H, W) which pixels these are.
        partitions
            Ways to divide the pixels, each by another split.
        """
        self._quantities = tuple(values)
        # One cell for each combination of parts; along each axis the first cells are of what is of no part. Every
        # quantity is summed once over the cells, and the cells then along each axis.
        cells = tuple(len(partition.parts) + 1 for partition in partitions)
        places = np.ravel_multi_index([partition.labels[valid].clip(-1) + 1 for partition in partitions], cells)
        counts = np.bincount(places, minlength=prod(cells)).reshape(cells)
        sums = np.stack([np.bincount(places, value, prod(cells)).reshape(cells) for value in values.values()], axis=-1)
        for axis, partition in enumerate(partitions):
            others = tuple(other for other in range(len(cells)) if other != axis)
            part_counts, part_sums = counts.sum(axis=others)[1:], sums.sum(axis=others)[1:]
            for part, count, totals in zip(partition.parts, part_counts, part_sums, strict=True):
                # Also of a part without pixels, so that parts keep their order.
                fields = self._fields.setdefault((partition.split, part), [])
                if count:
                    fields.append(tuple(totals.tolist()))

    def merged(self, other: "ErrorSums") -> "ErrorSums":
        """Return the sums over the fields of both."""
        both = ErrorSums()
        both._quantities = self._quantities or other._quantities
        for side in (self, other):
            for key, fields in side._fields.items():
                both._fields.setdefault(key, []).extend(fields)
        return both

    def totals(self) -> dict[PartKey, dict[str, float]]:
        """Return the total of each quantity by part, ``all`` first; a part without a valid pixel has none."""
        return {
            key: dict(zip(self._quantities, map(math.fsum, zip(*fields, strict=True)), strict=True))
            for key, fields in sorted(self._fields.items(), key=lambda entry: _SPLITS.index(entry[0][0]))
            if fields
        }


def share(part: float, whole: float) -> float | None:
    """Return a part of a whole; None where the whole is 0."""
    return part / whole if whole else None
