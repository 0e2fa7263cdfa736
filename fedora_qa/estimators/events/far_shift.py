"""Shifts of events against frames beyond the range that is searched pixel by pixel, at half the resolution.

Blocks of 2 x 2 pixels are summed, so that the same number of shifts reaches twice as far in a quarter of the time. The
peak of this smoother correlation is estimated to a fraction of a block.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.shift import Shift, cross_correlation, peak, peak_spread

Float64 = NDArray[np.float64]

BLOCK_PX: Final = 2

_BLOCK_ERROR_PX: Final = BLOCK_PX / 12**0.5
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
    """Return the sums of one interval (k = 1) over the usable pixels.

    Parameters
    ----------
    change, events
        (h, w) changes by frames and by events; their units may differ.
    usable
        (h, w) pixels where both can be compared.

    Returns
    -------
    FarSums
        Of k = 1 interval; shifts are counted in blocks.
    """
    height, width = (size // BLOCK_PX for size in usable.shape)
    changed, fired = np.empty((2, height, width))
    rest = sum_blocks(change, events, usable, changed, fired)
    squares = np.array([np.sum(image * image) for image in (changed, fired)])
    # Sums are beyond the mean of their usable pixels: a block without any holds 0, so that no block is left out.
    patch = cross_correlation(changed, fired, np.ones(changed.shape, np.bool_), rest)
    return FarSums(patch[np.newaxis], squares[np.newaxis])


def joined(parts: Sequence[FarSums]) -> FarSums:
    """Return the sums of all intervals, in order."""
    return FarSums(np.concatenate([part.patches for part in parts]), np.concatenate([part.squares for part in parts]))


def far_shift(sums: FarSums, beyond_px: float, least: float) -> FarShift | None:
    """Return the shift where events and frames correlate most; None where that is not farther than ``beyond_px``.

    Also None where they correlate by less than ``least``, or the peak hangs on single intervals (delete-one jackknife).

    Parameters
    ----------
    sums
        Of all intervals.
    beyond_px
        Largest component of the shift, px of the sensor, that the search pixel by pixel covers.
    least
        Correlation, 0 to 1, below which the peak is one of chance.

    Returns
    -------
    FarShift | None
        In px of the sensor, right and down.
    """
    total = sums.patches.sum(axis=0)
    block_shift = peak(total)
    # Normalised correlation, at most 1 (Cauchy and Schwarz) also of the sums over all intervals.
    strength = float(total.max() / max(float(np.sqrt(sums.squares.sum(axis=0).prod())), 1e-300))
    if block_shift is None or strength < least:
        return None
    shift = Shift(BLOCK_PX * block_shift.right_px, BLOCK_PX * block_shift.down_px)
    if max(abs(shift.right_px), abs(shift.down_px)) <= beyond_px:
        return None
    # A peak that moves where an interval is left out is a chance correlation of that interval.
    spread = peak_spread(sums.patches, total)
    if spread is None:
        return None
    # Scatter between intervals and the width of a block are independent errors.
    return FarShift(shift, np.hypot(BLOCK_PX * spread, _BLOCK_ERROR_PX), strength)


@njit(cache=True)
def sum_blocks(
    change: Float64, events: Float64, usable: NDArray[np.bool_], change_blocks: Float64, event_blocks: Float64
) -> float:
    """Write the sums over blocks of both images less their means; pixels that are not usable add nothing.

    Parameters
    ----------
    change, events
        (h, w) images.
    usable
        (h, w) pixels that count.
    change_blocks, event_blocks
        (h // 2, w // 2) where the sums are written.

    Returns
    -------
    float
        The sum of events, less the mean, of a block of usable pixels in which nothing fires.
    """
    count, change_sum, event_sum = 0, 0.0, 0.0
    for row in range(usable.shape[0]):
        row_sums = _sums_of_row(change[row], events[row], usable[row])
        count, change_sum, event_sum = count + int(row_sums[0]), change_sum + row_sums[1], event_sum + row_sums[2]
    # Both images are taken less their means over usable pixels.
    change_mean, event_mean = change_sum / max(count, 1), event_sum / max(count, 1)
    for row in range(change_blocks.shape[0]):
        for column in range(change_blocks.shape[1]):
            pixels, changed, fired = 0, 0.0, 0.0
            for y in range(2 * row, 2 * row + 2):
                for x in range(2 * column, 2 * column + 2):
                    is_usable = usable[y, x]
                    pixels += is_usable
                    changed += change[y, x] if is_usable else 0.0
                    fired += events[y, x] if is_usable else 0.0
            change_blocks[row, column] = changed - pixels * change_mean
            event_blocks[row, column] = fired - pixels * event_mean
    # Four usable pixels without events, less the mean of each.
    return -4 * event_mean


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _sums_of_row(change: Float64, events: Float64, usable: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Return the number of usable pixels, and their sums; many pixels at a time."""
    count, change_sum, event_sum = 0.0, 0.0, 0.0
    for i in range(len(usable)):
        count += 1.0 if usable[i] else 0.0
        change_sum += change[i] if usable[i] else 0.0
        event_sum += events[i] if usable[i] else 0.0
    return count, change_sum, event_sum
