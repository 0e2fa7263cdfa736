"""Events that lie elsewhere than in the rest of the sequence, in a stretch of time or in a part of the image."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.registration_errors import open_level_errors
from fedora_qa.estimators.events.shift import Interval, ShiftSums, peak
from fedora_qa.estimators.events.shift_kernels import USABLE
from fedora_qa.views.event_camera import GRID

Float64 = NDArray[np.float64]

CLEAR: Final = 0.5
"""Correlation from which on the peak of a tile is that of its own scene: tiles hold few edges, which agree by chance
where they are parallel."""

FEWEST_PARTS: Final = 4
"""Parts with a shift of their own below which none stands out."""

_FREEDOM: Final = 8
"""Parts beyond two from which on their scatter says more than their errors do."""


PartSums = ShiftSums
"""Sums of parts, as of the whole image."""


@dataclass(frozen=True, slots=True)
class Shifted:
    """The part whose shift along an axis differs most from the usual one.

    Attributes
    ----------
    part, axis
        Its number, and 0 (right) or 1 (down).
    alike
        (k,) parts that are shifted by more than half as much.
    shift_px, standard_error_px
        Its shift less the median of all parts; the other way round where that lies farther from zero.
    compared
        Parts that were compared.
    """

    part: int
    axis: int
    alike: NDArray[np.bool_]
    shift_px: float
    standard_error_px: float
    compared: int


def stacked(parts: Sequence[PartSums]) -> PartSums:
    """Return sums of parts as one, of as many parts."""
    return PartSums(*(np.array([getattr(part, name) for part in parts]) for name in PartSums.__slots__))


def added(parts: Sequence[PartSums]) -> PartSums:
    """Return the sums of the same parts over all of some intervals."""
    return PartSums(*(np.sum([getattr(part, name) for part in parts], axis=0) for name in PartSums.__slots__))


def tile_sums(level: Float64, change: Float64, events: Float64, usable: NDArray[np.bool_]) -> PartSums:
    """Return the sums of each of the tiles of an image."""
    return tiles_of(Interval(level, change, events, np.ascontiguousarray(usable).view(np.uint8)), USABLE)


def tiles_of(interval: Interval, flag: int) -> PartSums:
    """Return the sums of each of the tiles of an interval, over the pixels with a flag."""
    rows, columns = ([-(-edge * size // GRID) for edge in range(GRID + 1)] for size in interval.flags.shape)
    return interval.sums(flag, [(*down, *right) for down in pairwise(rows) for right in pairwise(columns)])


def most_shifted(
    sums: PartSums, intervals: int, threshold: float, least: float, dragged: Float64 | None = None
) -> Shifted | None:
    """Return the part that is shifted most against the others; None where too few have a shift of their own.

    ``intervals`` were summed in each part; what events leave open hardly changes from one to the next. Parts that
    correlate by less than ``least`` have no peak of their own. ``dragged`` (k, s, s) are the correlations with pixels
    that have turned: by how much these drag a peak is an error of its part.
    """
    count = len(sums.patches)
    shifts, errors = np.full((count, 2), np.nan), np.full((count, 2), np.inf)
    strengths = sums.patches.max(axis=(1, 2)) / np.maximum(np.sqrt(sums.squares.prod(axis=1)), 1e-300)
    for i in np.flatnonzero(strengths >= least):
        found = peak(sums.patches[i])
        if found is not None:
            shifts[i] = found.right_px, found.down_px
            errors[i] = open_level_errors(sums.slopes[i] / intervals, threshold)[0]
            with_turned = peak(dragged[i]) if dragged is not None else None
            if with_turned is not None:
                moved = with_turned.right_px - found.right_px, with_turned.down_px - found.down_px
                errors[i] = np.hypot(errors[i], moved)
    known = np.isfinite(shifts).all(axis=1)
    if np.count_nonzero(known) < FEWEST_PARTS:
        return None
    usual = np.median(shifts[known], axis=0)
    deviations = shifts - usual
    errors = errors * _scatter(deviations[known] / errors[known])
    scores = np.where(known[:, np.newaxis], np.abs(deviations) / errors, -1.0)
    part, axis = (int(i) for i in np.unravel_index(int(np.argmax(scores)), scores.shape))
    shift = float(deviations[part, axis])
    alike = known & (deviations[:, axis] / shift > 1 / 2) if shift else known
    if abs(usual[axis] + shift) < abs(usual[axis]):
        # Most parts are shifted, and this one is not.
        alike, shift = known & ~alike, -shift
    return Shifted(part, axis, alike, shift, float(errors[part, axis]), int(np.count_nonzero(known)))


def _scatter(scores: Float64) -> float:
    """Return by how much parts usually scatter beyond their errors, 1 at least (median absolute deviation)."""
    if len(scores) < _FREEDOM + 2:
        return 1.0
    return max(1.0, 1.4826 * float(np.median(np.abs(scores))))
