"""By how much image edges are shifted against steps of depth, along one axis.

The surfaces on both sides of an outline have texture of their own, which moves the peak of its profile along the line
from the farther to the nearer side, one way or the other: by l1 on the one side of things and l2 on the other, both
counted towards the nearer. The shift is the mean of both sides, which errs by (l1 - l2) / 2. Half their difference is
(l1 + l2) / 2, the lean, which bounds that where both lean alike, towards the nearer or away from it. Where one leans
to the nearer and the other away, as under light from one side, both peaks are skewed the same way: taking in one more
pixel on either side then moves the mean.

Each side is looked for by itself: a line beside an outline (a kerb, a shadow, a row of windows) may outshine it on one
side of things, and does not stand as far off the same way on the other. Where the two sides lie
apart, one of them may be in place and the other not, and the lean states by how much the mean then errs.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.edge_profiles import REACH, find_peaks, peaks_near

Float64 = NDArray[np.float64]

FEWEST_TILES: Final = 5
"""Tiles with steps of depth below which their spread is no estimate."""

_MOST_GROUPS: Final = 12
"""Groups of successive windows that are left out in turn."""


@dataclass(frozen=True, slots=True)
class EdgeShift:
    """Place of the edges relative to the steps of depth.

    Attributes
    ----------
    shift_px, standard_error_px
        To the right (down), px of the picture; the error from leaving out tiles, and segments of time, in turn.
    lean_px
        How far textures draw the peak towards the nearer side.
    skew_px
        By how much the shift changes when one more pixel on either side belongs to the peaks.
    peak_fraction, peak_fraction_error
        Fraction of all edge strength within the radius that lies in the peak, beyond the background.
    """

    shift_px: float
    standard_error_px: float
    lean_px: float
    skew_px: float
    peak_fraction: float
    peak_fraction_error: float

    @property
    def model_error_bound_px(self) -> float:
        """How far texture may move the shift: lean and skew each measure a part of that.

        Of sides further apart than one edge reaches, only one is in place, and may lean by itself.
        """
        single_lean_px = REACH if abs(self.lean_px) > REACH else 0
        return math.hypot(self.lean_px, self.skew_px) + single_lean_px


def edge_shift(sums: Float64) -> EdgeShift | None:
    """Estimate the shift of image edges against steps of depth along one axis.

    Parameters
    ----------
    sums
        (windows, 2, tiles, 2 R + 1) sums of profiles, far side first.

    Returns
    -------
    EdgeShift | None
        None where there are too few steps of depth.
    """
    total = sums.sum(axis=0)
    occupied = np.flatnonzero(total.sum(axis=(0, 2)))
    if len(occupied) < FEWEST_TILES or not np.all(total.sum(axis=(1, 2)) > 0):
        return None
    sides = total.sum(axis=1)
    shift_px, lean_px = (float(value) for value in _shifts_and_leans(sides, REACH))
    wider_px = float(_shifts_and_leans(sides, REACH + 1)[0])

    # Texture differs from tile to tile, and what noise and motion make of it from time to time.
    by_window = sums.sum(axis=2)
    groups = np.array_split(by_window, min(len(by_window), _MOST_GROUPS))
    by_tile = _jackknife(sides - np.moveaxis(total[:, occupied], 1, 0))
    by_time = _jackknife(sides - np.array([group.sum(axis=0) for group in groups]))
    shift_error, fraction_error = np.hypot(by_tile, by_time)
    return EdgeShift(
        shift_px,
        float(shift_error),
        lean_px,
        wider_px - shift_px,
        float(_peak_fractions(sides)),
        float(fraction_error),
    )


def _shifts_and_leans(sides: Float64, reach: int) -> tuple[Float64, Float64]:
    """Return shifts and leans (...) from one profile a side, (..., 2, 2 R + 1)."""
    peaks = peaks_near(sides, find_peaks(sides), reach)
    far_px, near_px = peaks.positions_px[..., 0], peaks.positions_px[..., 1]
    return 0.5 * (far_px + near_px), 0.5 * (far_px - near_px)


def _peak_fractions(sides: Float64) -> Float64:
    """Return the fractions (...) of edge strength where both sides together peak."""
    samples = find_peaks(sides.sum(axis=-2))
    fractions: Float64 = peaks_near(sides, np.stack([samples, samples], axis=-1)).fractions.mean(axis=-1)
    return fractions


def _jackknife(left_out: Float64) -> Float64:
    """Return the standard errors of shift and fraction, of sums (k, 2, 2 R + 1) with one part left out each.

    They are 0 where nothing could be left out.
    """
    usable = left_out[np.all(left_out.sum(axis=2) > 0, axis=1)]
    n = len(usable)
    if n <= 1:
        return np.zeros(2)
    # (n - 1) / n times the sum of squares (B. Efron, C. Stein, Annals of Statistics 9 (1981)).
    estimates = [_shifts_and_leans(usable, REACH)[0], _peak_fractions(usable)]
    return np.asarray(np.sqrt((n - 1) * np.var(estimates, axis=1)))
