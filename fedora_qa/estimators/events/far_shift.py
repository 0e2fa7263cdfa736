"""Shifts of events against frames that lie beyond what is searched pixel by pixel: the same at half the resolution.

Blocks of 2 x 2 pixels are summed, so that the same number of shifts reaches twice as far for a fourth of the time. The
peak is that of a smoother correlation and is read to a fraction of a block.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.far_shift_kernels import sum_blocks
from fedora_qa.estimators.events.shift import Shift, cross_correlation, peak

Float64 = NDArray[np.float64]

BLOCK_PX: Final = 2

_READ_TO_PX: Final = BLOCK_PX / 12**0.5
"""Standard deviation of a shift that is somewhere within a block: what the parabola through three blocks may leave."""


@dataclass(frozen=True, slots=True)
class FarSums:
    """Sums of k intervals: (k, s, s) correlations of blocks, no shift in the middle, and (k, 2) squares of both."""

    patches: Float64
    squares: Float64


@dataclass(frozen=True, slots=True)
class FarShift:
    """A far shift, its standard errors (right, down) in px, and the correlation at its peak, 0 to 1."""

    shift: Shift
    errors_px: Float64
    strength: float


def far_sums(change: Float64, events: Float64, usable: NDArray[np.bool_]) -> FarSums:
    """Return the sums of one interval (k = 1) of ``change`` and ``events`` (h, w), over the usable pixels."""
    height, width = (size // BLOCK_PX for size in usable.shape)
    one, other = np.empty((2, height, width))
    rest = sum_blocks(change, events, usable, one, other)
    squares = np.array([np.sum(image * image) for image in (one, other)])
    patch = cross_correlation(one, other, np.ones(one.shape, np.bool_), rest)
    return FarSums(patch[np.newaxis], squares[np.newaxis])


def joined(parts: Sequence[FarSums]) -> FarSums:
    """Return the sums of all intervals, in order."""
    return FarSums(np.concatenate([one.patches for one in parts]), np.concatenate([one.squares for one in parts]))


def far_shift(sums: FarSums, beyond_px: float, least: float) -> FarShift | None:
    """Return the shift where events and frames correlate most; None where that is not farther than ``beyond_px``.

    Also None where they correlate by less than ``least``, or the peak hangs on single intervals (delete-one jackknife).
    """
    total = sums.patches.sum(axis=0)
    found, strength = peak(total), float(total.max() / max(float(np.sqrt(sums.squares.sum(axis=0).prod())), 1e-300))
    if found is None or strength < least:
        return None
    shift = Shift(BLOCK_PX * found.right_px, BLOCK_PX * found.down_px)
    if max(abs(shift.right_px), abs(shift.down_px)) <= beyond_px:
        return None
    others = [peak(total - patch) for patch in sums.patches]
    known = [(other.right_px, other.down_px) for other in others if other is not None]
    if len(known) < len(others):
        return None
    spread_px = BLOCK_PX * np.sqrt((len(known) - 1) * np.var(known, axis=0))
    return FarShift(shift, np.hypot(spread_px, _READ_TO_PX), strength)
