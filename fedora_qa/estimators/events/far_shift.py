"""Shifts of events against frames beyond the range of the search by pixels, at half the resolution.

Blocks of 2 x 2 pixels are summed, so that the same number of shifts covers twice the distance in a quarter of the time.
The peak of this smoother correlation is estimated to a fraction of a block.
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
"""Standard deviation of a uniform distribution over one block, px: bound on the error of the parabola through three
blocks."""


@dataclass(frozen=True, slots=True)
class FarSums:
    """Sums of k intervals.

    Attributes
    ----------
    patches
        (k, s, s) cross-correlations of frame changes with events, by blocks; s = 2 R + 1, no shift in the middle.
    squares
        (k, 2) sums of squares of frame changes and of events, by blocks.
    """

    patches: Float64
    squares: Float64


@dataclass(frozen=True, slots=True)
class FarShift:
    """A shift beyond the range of the search by pixels.

    Attributes
    ----------
    shift
        To the right and down, px of the sensor.
    errors_px
        (2,) standard errors to the right and down, px of the sensor.
    strength
        Normalised correlation at the peak, 0 to 1.
    """

    shift: Shift
    errors_px: Float64
    strength: float


def far_sums(change: Float64, events: Float64, usable: NDArray[np.bool_]) -> FarSums:
    """Return the sums of one interval (k = 1) over the usable pixels.

    Parameters
    ----------
    change, events
        (h, w) changes by frames and by events; their units can differ.
    usable
        (h, w) True where both can be compared.

    Returns
    -------
    FarSums
        Of k = 1 interval; shifts are in blocks of 2 px.
    """
    height, width = (size // BLOCK_PX for size in usable.shape)
    changed, fired = np.empty((2, height, width))
    rest = sum_blocks(change, events, usable, changed, fired)
    squares = np.array([np.sum(image * image) for image in (changed, fired)])
    # The mean of the usable pixels is subtracted. A block without usable pixels is 0, so that all blocks are used.
    patch = cross_correlation(changed, fired, np.ones(changed.shape, np.bool_), rest)
    return FarSums(patch[np.newaxis], squares[np.newaxis])


def joined(parts: Sequence[FarSums]) -> FarSums:
    """Return the sums of all intervals of some parts, in order."""
    return FarSums(np.concatenate([part.patches for part in parts]), np.concatenate([part.squares for part in parts]))


def far_shift(sums: FarSums, beyond_px: float, least: float) -> FarShift | None:
    """Return the shift at which events and frames correlate most, where it lies beyond the search by pixels.

    Parameters
    ----------
    sums
        Sums of all intervals.
    beyond_px
        Largest component of the shift that the search by pixels covers, px of the sensor.
    least
        Correlation, 0 to 1, below which a peak can come from chance.

    Returns
    -------
    FarShift | None
        None where the shift is within ``beyond_px``, the correlation is below ``least``, or leaving out one interval
        removes the peak (delete-one jackknife).
    """
    total = sums.patches.sum(axis=0)
    block_shift = peak(total)
    # sum(d e) / sqrt(sum d^2 sum e^2): at most 1 also for sums over all intervals (Cauchy and Schwarz).
    strength = float(total.max() / max(float(np.sqrt(sums.squares.sum(axis=0).prod())), 1e-300))
    if block_shift is None or strength < least:
        return None
    shift = Shift(BLOCK_PX * block_shift.right_px, BLOCK_PX * block_shift.down_px)
    if max(abs(shift.right_px), abs(shift.down_px)) <= beyond_px:
        return None
    # If the sum has no peak when an interval is left out, the peak is a chance correlation of that interval.
    spread = peak_spread(sums.patches, total)
    if spread is None:
        return None
    # Scatter between intervals and the width of a block are independent errors.
    return FarShift(shift, np.hypot(BLOCK_PX * spread, _BLOCK_ERROR_PX), strength)


@njit(cache=True)
def sum_blocks(
    change: Float64, events: Float64, usable: NDArray[np.bool_], change_blocks: Float64, event_blocks: Float64
) -> float:
    """Write the sums over blocks of both images less their means over the usable pixels.

    Parameters
    ----------
    change, events
        (h, w) images.
    usable
        (h, w) pixels that count; the others add 0.
    change_blocks, event_blocks
        (h // 2, w // 2) receive the sums.

    Returns
    -------
    float
        Value of ``event_blocks`` for a block of four usable pixels that do not fire.
    """
    count, change_sum, event_sum = 0, 0.0, 0.0
    for row in range(usable.shape[0]):
        row_sums = _sums_of_row(change[row], events[row], usable[row])
        count, change_sum, event_sum = count + int(row_sums[0]), change_sum + row_sums[1], event_sum + row_sums[2]
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
    # sum over four usable pixels of (0 - mean)
    return -4 * event_mean


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _sums_of_row(change: Float64, events: Float64, usable: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Return the number of usable pixels of a row, and their sums of change and of events."""
    count, change_sum, event_sum = 0.0, 0.0, 0.0
    for i in range(len(usable)):
        count += 1.0 if usable[i] else 0.0
        change_sum += change[i] if usable[i] else 0.0
        event_sum += events[i] if usable[i] else 0.0
    return count, change_sum, event_sum
