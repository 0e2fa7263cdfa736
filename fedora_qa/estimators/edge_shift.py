"""By how much image edges are shifted against steps of depth, along one axis.

The surfaces on both sides of an outline have texture of their own, which moves the peak of its profile along the line
from the farther to the nearer side, one way or the other. That moves left and right outlines of things in opposite
directions, so the shift is the mean of both sides, and half their difference says how far textures lean. Where they
lean alike, by l1 on one side and l2 on the other, both towards the nearer or both away from it, the mean errs by
|l1 - l2| / 2, at most |l1 + l2| / 2: the measured lean bounds what is left.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.edge_profiles import find_place, peak_near

Float64 = NDArray[np.float64]

FEWEST_TILES: Final = 5
"""Tiles with steps of depth below which their spread says nothing."""

_MOST_GROUPS: Final = 12
"""Groups of successive windows that are left out in turn."""


@dataclass(frozen=True, slots=True)
class EdgeShift:
    """Place of the edges relative to the steps of depth.

    Attributes
    ----------
    shift_px, standard_error_px
        To the right (down), px of the picture; the error from leaving out tiles, or stretches of time, in turn.
    lean_px
        How far textures draw the peak towards the nearer side.
    share, share_error
        Share of all edge strength within the radius that lies in the peak, beyond the background.
    """

    shift_px: float
    standard_error_px: float
    lean_px: float
    share: float
    share_error: float


def edge_shift(sums: Float64) -> EdgeShift | None:
    """Estimate the shift from sums of profiles (windows, 2, tiles, 2 R + 1), far side first.

    None where there are too few steps of depth.
    """
    total = sums.sum(axis=0)
    occupied = np.flatnonzero(total.sum(axis=(0, 2)))
    if len(occupied) < FEWEST_TILES or not np.all(total.sum(axis=(1, 2)) > 0):
        return None
    whole = total.sum(axis=1)
    shift_px, lean_px, share = _estimate(whole)
    by_tile = _spread(whole - total[:, tile] for tile in occupied)
    by_time = _spread(whole - part for part in _groups(sums.sum(axis=2)))
    errors = np.maximum(by_tile, by_time)
    return EdgeShift(shift_px, float(errors[0]), lean_px, share, float(errors[2]))


def _estimate(sides: Float64) -> tuple[float, float, float]:
    """Return shift, lean and share from one profile a side, (2, 2 R + 1)."""
    middle = find_place(sides.sum(axis=0))
    far, near = (peak_near(side, middle) for side in sides)
    shift_px, lean_px = 0.5 * (far.place_px + near.place_px), 0.5 * (far.place_px - near.place_px)
    return shift_px, lean_px, 0.5 * (far.share + near.share)


def _spread(left_out: Iterable[Float64]) -> Float64:
    """Return the jackknife's standard errors of shift, lean and share; 0 where nothing could be left out."""
    estimates = np.array([_estimate(sides) for sides in left_out if np.all(sides.sum(axis=1) > 0)])
    n = len(estimates)
    return np.sqrt((n - 1) * estimates.var(axis=0)) if n > 1 else np.zeros(3)


def _groups(by_window: Float64) -> Iterator[Float64]:
    """Yield the sums of successive groups of windows, as many as there are windows but not too many."""
    for group in np.array_split(by_window, min(len(by_window), _MOST_GROUPS)):
        yield group.sum(axis=0)
