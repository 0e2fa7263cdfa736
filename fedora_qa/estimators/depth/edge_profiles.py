"""How strong image edges are around steps of depth, and where they are strongest.

A picture in which each pixel is the mean over its own square shows a sharp edge as a difference of neighbours that
follows, over edges at all places within their pixel, the quadratic B-spline: 1/8, 3/4, 1/8 at the steps of a depth
sampled at pixel centres. The centroid of a quadratic B-spline over three samples is its exact place, because B-splines
reproduce straight lines (I. J. Schoenberg, Quart. Appl. Math. 4 (1946)).
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.edge_kernels import add_profiles
from fedora_qa.estimators.depth.edge_steps import DepthSteps

Float64 = NDArray[np.float64]

RADIUS_PX: Final = 12
"""Farthest shift along an axis that is looked for."""

TILES: Final = 4
"""Tiles of the image in each direction over which profiles are kept apart, for the spread between them."""

_EDGE: Final = np.array([1 / 8, 3 / 4, 1 / 8])
"""What an edge looks like: the filter that finds it best."""

REACH: Final = 1
"""Samples on either side of the peak that belong to it."""

_SURROUNDINGS: Final = 4
"""Samples on either side of the peak that are looked at: those beyond the reach tell the background there."""

FARTHEST_PX: Final = RADIUS_PX - _SURROUNDINGS
"""Farthest shift that is found: peak and background must lie in the profile."""


@dataclass(frozen=True, slots=True)
class EdgePeaks:
    """Where profiles peak, px, and how much of the edge strength lies in each peak beyond the background, 0 to 1."""

    places_px: Float64
    shares: Float64


def tile_profiles(
    strength: NDArray[Any], steps: DepthSteps, axis: int, at: tuple[Float64, Float64], *, first_px: float
) -> Float64:
    """Return sums of edge profiles along an axis, (2, tiles, 2 R + 1): far side first, then near side first.

    Each step of depth has one voice: its profile is divided by its sum.

    Parameters
    ----------
    strength
        (h, w) edge strength; along the axis its first value lies at ``first_px`` (1/2 for differences of neighbours).
    at
        Columns and rows (n,) of the steps in that image, px.
    """
    return _tile_profiles(strength, (False, False), steps, axis, at, first_px, differences=False)


def difference_profiles(
    picture: NDArray[Any], steps: DepthSteps, axis: int, at: tuple[Float64, Float64],
    mirrored: tuple[bool, bool] = (False, False),
) -> Float64:  # fmt: skip
    """Return ``tile_profiles`` of the absolute differences of a picture's (h, w) neighbours along the axis.

    ``mirrored`` says whether the picture is looked at left to right, and top to bottom.
    """
    return _tile_profiles(picture, mirrored, steps, axis, at, 0.5, differences=True)


def _tile_profiles(
    picture: NDArray[Any], mirrored: tuple[bool, bool], steps: DepthSteps, axis: int, at: tuple[Float64, Float64],
    first_px: float, *, differences: bool,
) -> Float64:  # fmt: skip
    values = np.ascontiguousarray(picture, dtype=np.float32)
    height, width = values.shape
    # Where each column and row of pixels begins among all of them, and how far it is to the next.
    columns, rows = (width - 1, -1, width) if mirrored[0] else (0, 1, width), (0, width, height)
    if mirrored[1]:
        rows = ((height - 1) * width, -width, height)
    along, across = (columns, rows) if axis == 0 else (rows, columns)
    sums = np.zeros((2, TILES, TILES, 2 * RADIUS_PX + 1))
    add_profiles(
        values.ravel(), along[0] + across[0], along[1], across[1], (along[2], across[2]), differences, first_px,
        at[axis], at[1 - axis], steps.near_first, TILES, sums,
    )  # fmt: skip
    return sums.reshape(2, TILES * TILES, -1)


def find_places(profiles: Float64) -> NDArray[np.intp]:
    """Return the sample at which each profile (..., 2 R + 1) peaks, among those whose surroundings lie in it."""
    first, last = RADIUS_PX - FARTHEST_PX, profiles.shape[-1] - (RADIUS_PX - FARTHEST_PX)
    before, at, after = (profiles[..., first + i : last + i] for i in (-1, 0, 1))
    edges = _EDGE[0] * before + _EDGE[1] * at + _EDGE[2] * after
    places: NDArray[np.intp] = first + np.argmax(edges, axis=-1)
    return places


def peaks_near(profiles: Float64, middles: NDArray[np.intp], reach: int = REACH) -> EdgePeaks:
    """Return the centroids around the samples ``middles`` (...), after taking off a background that may step there."""
    offsets, surroundings = np.arange(-reach, reach + 1), np.arange(-_SURROUNDINGS, _SURROUNDINGS + 1)
    near = np.take_along_axis(profiles, middles[..., np.newaxis] + surroundings, axis=-1)
    first, stop = _SURROUNDINGS - reach, _SURROUNDINGS + reach + 1
    before, after = near[..., :first].mean(axis=-1, keepdims=True), near[..., stop:].mean(axis=-1, keepdims=True)
    background = np.where(offsets < 0, before, np.where(offsets > 0, after, 0.5 * (before + after)))
    beyond = near[..., first:stop] - background
    strengths = beyond.sum(axis=-1)
    centroids = np.divide(beyond @ offsets, strengths, out=np.zeros_like(strengths), where=strengths > 0)
    places_px = middles - RADIUS_PX + np.clip(centroids, -reach, reach)
    return EdgePeaks(places_px, strengths / profiles.sum(axis=-1))
