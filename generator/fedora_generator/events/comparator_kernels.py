"""Compiled loops of the comparator: the events of those pixels that have left their thresholds.

Thresholds, and how near is quiet, are (1, width), where all rows share them, or (height, width). ``middle`` and
``near`` are as in ``events/quiet_kernels``.
"""

import math
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.events.prefetch_kernels import prefetch
from fedora_generator.events.quiet_kernels import (
    COLUMN_BITS,
    COLUMN_MASK,
    Floats,
    Middles,
    list_active,
    mark_quiet,
    middle_of,
    room_for_a_row,
    room_for_pixels,
)
from fedora_qa.conventions import NS_PER_US

Keys = NDArray[np.int64]

NOT_FINITE: Final = -1
"""Returned instead of a number of events where a signal is not finite."""

_BAND: Final = 8
"""Rows that are compared before the crossings of the rows above: about the time that memory takes to answer."""


@njit(cache=True, error_model="numpy")  # no test for a division by zero: a crossed level lies between the samples
def emit_crossings(
    previous: Floats,
    signal: Floats,
    reference: Floats,
    middle: Middles,
    near: Floats,
    largest: float,
    threshold_on: Floats,
    threshold_off: Floats,
    start_ns: int,
    stop_ns: int,
    column_bits: int,
    timestamp_shift: int,
    keys: Keys,
    shares: Floats,
    first_row: int,
    count: int,
) -> tuple[int, int]:
    """Write a key for each level crossed between two samples, and leave ``reference`` (H, W) at the last level.

    The signal is a straight line between the samples; times are nanoseconds since the start. Keys come in raster
    order and each pixel's in order of time, after the ``count`` that there are; ``shares`` is room for as many numbers.
    Returns the row to go on from, and how many keys there are now. Where there was no room left, calling again with
    more finds what was not written yet, as every reference stands at the last level written. NOT_FINITE instead of a
    row: a signal is not.
    """
    height, width = signal.shape
    quiet, words, candidates = room_for_a_row(width)
    active, coming = room_for_pixels(width, _BAND), room_for_pixels(width, _BAND)
    active_count = 0
    for band in range(first_row, height + _BAND, _BAND):
        active, coming, found_here, active_count = coming, active, active_count, 0
        for row in range(band, min(band + _BAND, height)):
            mark_quiet(signal, middle, near, row, quiet)
            active_count = list_active(words, row, candidates, coming, active_count)
        for pixel in coming[:active_count]:
            prefetch(previous, pixel >> COLUMN_BITS, pixel & COLUMN_MASK)
            prefetch(reference, pixel >> COLUMN_BITS, pixel & COLUMN_MASK)
        first_key, is_full = count, False
        for pixel in active[:found_here]:
            row, column = pixel >> COLUMN_BITS, pixel & COLUMN_MASK
            line = row if len(threshold_on) > 1 else np.uint64(0)
            on, off = threshold_on[line, column], threshold_off[line, column]
            before, value, level = previous[row, column], signal[row, column], reference[row, column]
            if not math.isfinite(value):
                return NOT_FINITE, count
            rising = value > level
            step = on if rising else -off
            direction = 1.0 if rising else -1.0
            while (value - (level + step)) * direction >= 0:
                is_full = count == keys.size
                if is_full:
                    break
                level += step
                shares[count] = (level - before) / (value - before)
                keys[count] = np.int64(row << column_bits | column) << 1 | rising
                count += 1
            reference[row, column], middle[row, column] = level, middle_of(level, on, off, largest)
            if is_full:
                break
        _timestamp(keys[first_key:count], shares[first_key:count], start_ns, stop_ns, timestamp_shift)
        if is_full:
            return band - _BAND, count
    return height, count


@njit(cache=True)
def emit_steps(
    signal: Floats,
    reference: Floats,
    middle: Middles,
    near: Floats,
    largest: float,
    threshold_on: Floats,
    threshold_off: Floats,
    timestamp_us: int,
    column_bits: int,
    timestamp_shift: int,
    keys: Keys,
) -> int:
    """One event a pixel whose value differs from the reference by strictly more than the threshold.

    The reference becomes the current value, however large the step. ``keys`` has room for every pixel. Returns how
    many there are, sorted; or NOT_FINITE.
    """
    height, width = signal.shape
    quiet, words, candidates = room_for_a_row(width)
    active = room_for_pixels(width, 1)
    count = 0
    for row in range(height):
        line = row if len(threshold_on) > 1 else 0
        mark_quiet(signal, middle, near, row, quiet)
        for pixel in active[: list_active(words, row, candidates, active, 0)]:
            column = pixel & COLUMN_MASK
            on, off = threshold_on[line, column], threshold_off[line, column]
            value, level = signal[row, column], reference[row, column]
            if not math.isfinite(value):
                return NOT_FINITE
            rising = value > level + on
            if rising or value < level - off:
                keys[count] = timestamp_us << timestamp_shift | (row << column_bits | np.int64(column)) << 1 | rising
                count += 1
                reference[row, column], middle[row, column] = value, middle_of(value, on, off, largest)
    return count


@njit(cache=True)
def _timestamp(keys: Keys, shares: Floats, start_ns: int, stop_ns: int, timestamp_shift: int) -> None:
    """Put into keys the first whole microsecond not before the crossing, which lies at a share of the interval.

    In float64, of which a processor rounds several at once, and without error for intervals up to 52 days.
    """
    span_ns, start_us, after_us_ns = float(stop_ns - start_ns), start_ns // NS_PER_US, float(start_ns % NS_PER_US)
    for index in range(keys.size):
        offset_ns = np.floor(shares[index] * span_ns + 0.5)
        offset_ns = min(max(offset_ns, 1.0), span_ns)  # the level was not yet reached at the previous sample
        keys[index] |= (start_us + np.int64(np.ceil((after_us_ns + offset_ns) / NS_PER_US))) << timestamp_shift
