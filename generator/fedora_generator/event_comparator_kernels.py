"""Compiled loops of the comparator: which pixels have left their thresholds, and the events that follow.

Most pixels are quiet most of the time, so a row is first compared as a whole, without branches, eight answers to a
64-bit word; only words that are not quiet throughout are looked into. Thresholds are (1, width), where all rows share
them, or (height, width).
"""

import math
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US

Floats = NDArray[np.float64]
Keys = NDArray[np.int64]
Flags = NDArray[np.uint8]

NOT_FINITE: Final = -1
"""Returned instead of a number of events where a signal is not finite."""

_LANES: Final = 8
_ALL_QUIET: Final = np.uint64(0x0101_0101_0101_0101)
_GATHER_BITS: Final = np.uint64(0x0102_0408_1020_4080)
"""Times a word of flags, its highest byte holds one bit a lane, the first lane's lowest."""

_IS_ACTIVE: Final = np.arange(256)[:, None] >> np.arange(_LANES) & 1
_ACTIVE_COUNT: Final = _IS_ACTIVE.sum(axis=1)
_ACTIVE_LANES: Final = np.argsort(1 - _IS_ACTIVE, axis=1, kind="stable")
"""(256, 8): for each byte of such bits, the lanes whose bit is set, and then the others."""


@njit(cache=True, error_model="numpy")  # no test for a division by zero: a crossed level lies between the samples
def emit_crossings(
    previous: Floats,
    signal: Floats,
    reference: Floats,
    threshold_on: Floats,
    threshold_off: Floats,
    start_ns: int,
    stop_ns: int,
    column_bits: int,
    stamp_shift: int,
    keys: Keys,
    first_row: int,
    count: int,
) -> tuple[int, int]:
    """Write a key for each level crossed between two samples, and leave ``reference`` (H, W) at the last level.

    The signal is a straight line between the samples; times are nanoseconds since the start. Keys come in raster
    order and each pixel's in order of time, after the ``count`` that there are. Returns the row to go on from, and how
    many keys there are now. Where there was no room left, calling again with more finds what was not written yet, as
    every reference stands at the last level written. NOT_FINITE instead of a row: a signal is not.
    """
    quiet, active, candidates = _room_for_a_row(signal.shape[1])
    befores = np.empty(active.size)
    for row in range(first_row, signal.shape[0]):
        line = row if len(threshold_on) > 1 else 0
        on, off, signals, references = threshold_on[line], threshold_off[line], signal[row], reference[row]
        _mark_quiet(signals, references, on, off, quiet)
        found = _list_active(quiet, candidates, active)
        _gather(previous[row], active[:found], befores)
        for index in range(found):
            column = active[index]
            before, value, level = befores[index], signals[column], references[column]
            if not math.isfinite(value):
                return NOT_FINITE, count
            rising = value > level
            direction, step = (1.0, on[column]) if rising else (-1.0, -off[column])
            level += step
            while (value - level) * direction >= 0:
                if count == keys.size:
                    return row, count
                stamp_us = _crossing_us((level - before) / (value - before), start_ns, stop_ns)
                keys[count] = stamp_us << stamp_shift | (row << column_bits | column) << 1 | rising
                count += 1
                references[column] = level
                level += step
    return signal.shape[0], count


@njit(cache=True)
def emit_steps(
    signal: Floats,
    reference: Floats,
    threshold_on: Floats,
    threshold_off: Floats,
    stamp_us: int,
    column_bits: int,
    stamp_shift: int,
    keys: Keys,
) -> int:
    """One event a pixel whose value differs from the reference by strictly more than the threshold.

    The reference becomes the current value, however large the step. ``keys`` has room for every pixel. Returns how
    many there are, sorted; or NOT_FINITE.
    """
    quiet, active, candidates = _room_for_a_row(signal.shape[1])
    count = 0
    for row in range(signal.shape[0]):
        line = row if len(threshold_on) > 1 else 0
        on, off, references = threshold_on[line], threshold_off[line], reference[row]
        _mark_quiet(signal[row], references, on, off, quiet)
        for column in active[: _list_active(quiet, candidates, active)]:
            value = signal[row, column]
            if not math.isfinite(value):
                return NOT_FINITE
            rising = value > references[column] + on[column]
            if rising or value < references[column] - off[column]:
                keys[count] = stamp_us << stamp_shift | (row << column_bits | column) << 1 | rising
                count += 1
                references[column] = value
    return count


@njit(cache=True)
def _room_for_a_row(width: int) -> tuple[Flags, NDArray[np.int64], NDArray[np.int64]]:
    """Return flags of a row filled up to whole words, and lists of columns and words, with room to spare."""
    words = (width + _LANES - 1) // _LANES
    return np.ones(words * _LANES, np.uint8), np.empty((words + 1) * _LANES, np.int64), np.empty(words + 1, np.int64)


@njit(cache=True)
def _mark_quiet(signal: Floats, reference: Floats, on: Floats, off: Floats, quiet: Flags) -> None:
    """Mark with 1 the columns strictly between their thresholds, with 0 the others and what is not a number."""
    for column in range(signal.size):
        value, middle = signal[column], reference[column]
        quiet[column] = (value < middle + on[column]) & (value > middle - off[column])


@njit(cache=True)
def _list_active(quiet: Flags, candidates: NDArray[np.int64], active: NDArray[np.int64]) -> int:
    """List the columns that are not quiet; return how many. No branch depends on the flags, which nobody can predict.

    Of each word that is not all quiet, the lanes are found in a table; eight columns are written and only those
    that are active are kept.
    """
    words = quiet.view(np.uint64)
    found = 0
    for word in range(words.size):
        candidates[found] = word
        found += words[word] != _ALL_QUIET
    count = 0
    for word in candidates[:found]:
        mask = ((words[word] ^ _ALL_QUIET) * _GATHER_BITS) >> np.uint64(56)
        for lane in range(_LANES):
            active[count + lane] = _LANES * word + _ACTIVE_LANES[mask, lane]
        count += _ACTIVE_COUNT[mask]
    return count


@njit(cache=True)
def _gather(values: Floats, columns: NDArray[np.int64], gathered: Floats) -> None:
    """Fetch the values of some columns: loads that do not wait for each other, as those among the crossings would."""
    for index, column in enumerate(columns):
        gathered[index] = values[column]


@njit(cache=True)
def _crossing_us(share: float, start_ns: int, stop_ns: int) -> int:
    """First whole microsecond not before the crossing, which lies at ``share`` of the interval."""
    span_ns = stop_ns - start_ns
    offset_ns = math.floor(share * span_ns + 0.5)
    offset_ns = min(max(offset_ns, 1), span_ns)  # the level was not yet reached at the previous sample
    return (start_ns + offset_ns + NS_PER_US - 1) // NS_PER_US
