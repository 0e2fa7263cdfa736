"""By how much image edges are shifted against steps of depth, along one axis.

The surfaces on both sides of an outline have texture of their own, which moves the peak of its profile along the line
from the farther to the nearer side, one way or the other: by l1 on the one side of things and l2 on the other, both
counted towards the nearer. The shift is the mean of both sides, which errs by (l1 - l2) / 2. Half their difference is
(l1 + l2) / 2, the lean, which bounds that where both lean alike, towards the nearer or away from it. Where one leans
to the nearer and the other away, as under light from one side, both peaks are skewed the same way: taking in one more
pixel on either side then moves the mean.

Each side is looked for by itself: a line beside an outline (a kerb, a shadow, a row of windows) may outshine it on one
side of things, and is not to be found again, as far off the same way, on the other. Where the two sides are found
apart, one of them may be in place and the other not, and the lean says by how much the mean then errs.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.edge_profiles import REACH, find_places, peaks_near

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
        To the right (down), px of the picture; the error from leaving out tiles, and stretches of time, in turn.
    lean_px
        How far textures draw the peak towards the nearer side.
    skew_px
        By how much the shift is another when one more pixel on either side belongs to the peaks.
    share, share_error
        Share of all edge strength within the radius that lies in the peak, beyond the background.
    """

    shift_px: float
    standard_error_px: float
    lean_px: float
    skew_px: float
    share: float
    share_error: float

    @property
    def model_error_bound_px(self) -> float:
        """How far texture may move the shift: lean and skew show different parts of that.

        Of sides further apart than one edge reaches, only one is in place, and may lean by itself.
        """
        own_px = REACH if abs(self.lean_px) > REACH else 0
        return math.hypot(self.lean_px, self.skew_px) + own_px


def edge_shift(sums: Float64) -> EdgeShift | None:
    """Estimate the shift from sums of profiles (windows, 2, tiles, 2 R + 1), far side first.

    None where there are too few steps of depth.
    """
    total = sums.sum(axis=0)
    occupied = np.flatnonzero(total.sum(axis=(0, 2)))
    if len(occupied) < FEWEST_TILES or not np.all(total.sum(axis=(1, 2)) > 0):
        return None
    whole = total.sum(axis=1)
    shift_px, lean_px = (float(one) for one in _places(whole, REACH))
    wider_px = float(_places(whole, REACH + 1)[0])
    by_tile = _spread(whole - np.moveaxis(total[:, occupied], 1, 0))
    by_time = _spread(whole - _groups(sums.sum(axis=2)))
    # Texture differs from tile to tile, and what noise and motion make of it from time to time.
    shift_error, share_error = np.hypot(by_tile, by_time)
    share = float(_shares(whole))
    return EdgeShift(shift_px, float(shift_error), lean_px, wider_px - shift_px, share, float(share_error))


def _places(sides: Float64, reach: int) -> tuple[Float64, Float64]:
    """Return shifts and leans (...) from one profile a side, (..., 2, 2 R + 1)."""
    peaks = peaks_near(sides, find_places(sides), reach)
    far_px, near_px = peaks.places_px[..., 0], peaks.places_px[..., 1]
    return 0.5 * (far_px + near_px), 0.5 * (far_px - near_px)


def _shares(sides: Float64) -> Float64:
    """Return the shares (...) of edge strength where both sides together peak."""
    middles = find_places(sides.sum(axis=-2))
    shares: Float64 = peaks_near(sides, np.stack([middles, middles], axis=-1)).shares.mean(axis=-1)
    return shares


def _spread(left_out: Float64) -> Float64:
    """Return the jackknife's standard errors of shift and share, of sums (k, 2, 2 R + 1) with one part left out each.

    They are 0 where nothing could be left out.
    """
    rest = left_out[np.all(left_out.sum(axis=2) > 0, axis=1)]
    n = len(rest)
    return np.sqrt((n - 1) * np.var([_places(rest, REACH)[0], _shares(rest)], axis=1)) if n > 1 else np.zeros(2)


def _groups(by_window: Float64) -> Float64:
    """Return the sums of successive groups of windows, as many as there are windows but not too many."""
    return np.array([group.sum(axis=0) for group in np.array_split(by_window, min(len(by_window), _MOST_GROUPS))])
