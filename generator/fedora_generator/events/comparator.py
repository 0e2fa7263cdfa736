"""The comparator of the event camera, with the compiled search for pixels that may have fired.

A pixel is *quiet* while its signal lies between its two thresholds. Compiled loops list the few pixels that may not be,
and others compare those exactly. Thresholds and ``near`` are (height, width), or (1, width) where all rows share them.

Most pixels are quiet most of the time, and their comparison costs memory reads. So the middle of each pixel's quiet
interval, ``(reference - off, reference + on)``, is stored in float32 beside the reference, and a signal near enough
to it is quiet. *Near enough* allows for all rounding, so that a pixel marked quiet always is; only pixels that
are not near enough are compared exactly.
"""

import math
from typing import Any, Final

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]  # Numba's own dependency, published without types
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from fedora_generator.events.keys import KeyLayout
from fedora_qa.conventions import NS_PER_US

Floats = NDArray[np.float64]
Middles = NDArray[np.float32]
Flags = NDArray[np.uint8]
Words = NDArray[np.uint64]
Pixels = NDArray[np.uint32]

COLUMN_BITS: Final = np.uint64(16)
COLUMN_MASK: Final = np.uint64(0xFFFF)
"""A pixel in a list is ``row << COLUMN_BITS | column``."""

# All indices are unsigned: Numba would wrap a negative one around, and test for it.
_LANES: Final = np.uint64(8)
_BLOCK: Final = np.uint64(8)
"""Words that are looked at together."""

_AT_ONCE: Final = np.uint64(2)
"""Few words have more active lanes."""

_ALL_QUIET: Final = np.uint64(0x0101_0101_0101_0101)
_GATHER_BITS: Final = np.uint64(0x0102_0408_1020_4080)
_HIGHEST_BYTE: Final = np.uint64(56)
"""Times _GATHER_BITS, the highest byte of a word of flags holds one bit a lane, the first lane's lowest."""

_IS_ACTIVE: Final = np.arange(256)[:, None] >> np.arange(8) & 1
_ACTIVE_COUNT: Final = _IS_ACTIVE.sum(axis=1).astype(np.uint64)
_ACTIVE_LANES: Final = np.argsort(1 - _IS_ACTIVE, axis=1, kind="stable").astype(np.uint32)
"""(256, 8): for each byte of such bits, the lanes whose bit is set, and then the others."""


@njit(cache=True)
def middle_of(reference: float, on: float, off: float, largest: float) -> float:
    """Middle of a quiet interval; where it is beyond ``largest``, NaN, which no signal is near."""
    middle = reference + 0.5 * (on - off)
    return middle if abs(middle) <= largest else np.nan


@njit(cache=True)
def find_middles(reference: Floats, on: Floats, off: Floats, largest: float, middle: Middles) -> None:
    """Put the middles of all quiet intervals into ``middle`` (H, W)."""
    for row in range(reference.shape[0]):
        line = row if len(on) > 1 else 0
        for column in range(reference.shape[1]):
            middle[row, column] = middle_of(reference[row, column], on[line, column], off[line, column], largest)


@njit(cache=True)
def row_buffers(width: int) -> tuple[Flags, Words, Words]:
    """Return flags of a row in whole blocks, the same memory as words, and a list of as many words and one."""
    words = -(-width // 64) * 8
    quiet = np.ones(words * 8, np.uint8)
    return quiet, quiet.view(np.uint64), np.empty(words + 1, np.uint64)


@njit(cache=True)
def pixel_buffer(width: int, rows: int) -> Pixels:
    """Return a list that holds all pixels of some rows, and a word more, which ``list_active`` may write."""
    return np.empty(width * rows + 8, np.uint32)


@njit(cache=True)
def mark_quiet(signal: Floats, middle: Middles, near: Floats, row: int, quiet: Flags) -> None:
    """Mark with 1 the columns of a row that are surely quiet, with 0 the others and what is not a number."""
    line = row if len(near) > 1 else 0
    for column in range(signal.shape[1]):
        quiet[column] = abs(signal[row, column] - middle[row, column]) < near[line, column]


@njit(cache=True)
def list_active(words: Words, row: int, candidates: Words, pixels: Pixels, count: int) -> int:
    """Append the pixels of a row that are not marked quiet to a list.

    No branch depends on a single flag, which no processor can predict. Of each word that is not all quiet, the lanes
    are found in a table; two pixels or eight are written and only the active ones stay.

    Parameters
    ----------
    words
        Flags of the row, eight to a word.
    row
        Number of the row.
    candidates
        Scratch space for as many words and one.
    pixels
        List with room for the row and a word more.
    count
        Pixels in the list so far.
    """
    active_count = np.uint64(0)
    for first in range(np.uint64(0), np.uint64(words.size), _BLOCK):
        if not _all_quiet(words, first):
            for word in range(first, first + _BLOCK):
                candidates[active_count] = word
                active_count += np.uint64(words[word] != _ALL_QUIET)
    kept, start = np.uint64(count), np.uint64(row) << COLUMN_BITS
    for index in range(active_count):
        word = candidates[index]
        mask = ((words[word] ^ _ALL_QUIET) * _GATHER_BITS) >> _HIGHEST_BYTE
        first_pixel = np.uint32(start + word * _LANES)
        for lane in range(_AT_ONCE):
            pixels[kept + lane] = first_pixel + _ACTIVE_LANES[mask, lane]
        if _ACTIVE_COUNT[mask] > _AT_ONCE:
            for lane in range(_AT_ONCE, _LANES):
                pixels[kept + lane] = first_pixel + _ACTIVE_LANES[mask, lane]
        kept += _ACTIVE_COUNT[mask]
    return int(kept)


@njit(cache=True)
def _all_quiet(words: Words, first: int) -> bool:
    """Whether all words of a block are quiet."""
    together = _ALL_QUIET
    for word in range(first, first + _BLOCK):
        together &= words[word]
    return bool(together == _ALL_QUIET)


Keys = NDArray[np.int64]

_FIRST_CAPACITY: Final = 1 << 12

_LARGEST_MIDDLE: Final = 2.0**12
"""In half-widths of the narrowest quiet interval: how far from zero float32 serves, 819 nat for thresholds of 0.2."""

_ROUNDING: Final = 2.0**-23
_ROUNDING_OF_WIDTHS: Final = 2.0**-40
"""What near is less than the half-width: this share of the largest middle, and that of the half-width itself.

Let a signal be outside, at ``v >= fl(reference + on)``. In real numbers ``reference + on = m + w`` with middle and
half-width; the float32 middle is off by at most 2^-24 |m| and what float64 adds, 2^-53 times a few |m| and w. So
``fl(v - middle) >= fl(w - 2^-23.9 |m| - 2^-50 w)``, as rounding keeps the order, and that is not near.
"""

NOT_FINITE: Final = -1
"""Returned instead of a number of events where a signal is not finite."""

_BAND: Final = 8
"""Rows that are compared before the crossings of the rows above: about the time that memory takes to answer."""

_INT32: Final = ir.IntType(32)
_BYTES: Final = ir.IntType(8).as_pointer()
_PREFETCH: Final = ir.FunctionType(ir.VoidType(), [_BYTES, _INT32, _INT32, _INT32])
_HINTS: Final = tuple(ir.Constant(_INT32, hint) for hint in (0, 3, 1))
"""To read, to keep in all caches, data (LLVM language reference, llvm.prefetch)."""


class SignalNotFiniteError(ArithmeticError):
    """A pixel's signal is infinite or not a number."""


class Comparator:
    """Compares signals (H, W) with references that follow them.

    Thresholds are (H, W), or (1, W) where all rows share them. Times are nanoseconds since the start of the recording.

    Attributes
    ----------
    reference
        (H, W), in the unit of the signal; changed by the comparator alone.
    """

    def __init__(self, layout: KeyLayout, threshold_on: Floats, threshold_off: Floats, reference: Floats) -> None:
        self._thresholds = (threshold_on, threshold_off)
        half_width = 0.5 * threshold_on + 0.5 * threshold_off
        self._largest = _LARGEST_MIDDLE * float(half_width.min())
        self._near = (1 - _ROUNDING_OF_WIDTHS) * half_width - _ROUNDING * self._largest
        self._middle = np.empty(reference.shape, np.float32)
        self.reset(reference)
        self._layout = layout
        self._keys, self._shares = np.empty(_FIRST_CAPACITY, np.int64), np.empty(_FIRST_CAPACITY)
        self._spare = np.empty(0, np.int64)

    def reset(self, reference: Floats) -> None:
        """Start from other references (H, W), which are taken over and changed."""
        self.reference = reference
        find_middles(reference, *self._thresholds, self._largest, self._middle)

    def crossings(self, previous: Floats, signal: Floats, start_ns: int, stop_ns: int) -> Keys:
        """Keys of all levels that the straight line between two signals reaches; each becomes the reference.

        Parameters
        ----------
        previous, signal
            (H, W) samples at both ends of the interval.
        start_ns, stop_ns
            Ends of the interval, since the start of the recording.

        Returns
        -------
        keys
            (n,) in raster order, those of a pixel in order of time; timestamps lie in (start, stop].
            The next call overwrites them.

        Raises
        ------
        SignalNotFiniteError
            The crossed levels of a pixel are undefined.
        """
        bits = (self._layout.column_bits, self._layout.timestamp_shift)
        interval = (previous, signal, *self._levels(), start_ns, stop_ns, *bits)
        row, count = emit_crossings(*interval, self._keys, self._shares, 0, 0)
        while 0 <= row < self._layout.height:
            self._keys = np.concatenate([self._keys, np.empty_like(self._keys)])
            self._shares = np.empty(self._keys.size)
            row, count = emit_crossings(*interval, self._keys, self._shares, row, count)
        _require_finite(row)
        return self._keys[:count]

    def steps(self, signal: Floats, stop_ns: int) -> Keys:
        """Keys in raster order, one for each pixel farther than its threshold; its signal becomes the reference.

        Raises
        ------
        SignalNotFiniteError
            The distance of a pixel from its reference is undefined.
        """
        keys = np.empty(signal.size, np.int64)
        bits = (self._layout.column_bits, self._layout.timestamp_shift)
        timestamp_us = -(-stop_ns // NS_PER_US)  # the first whole microsecond not before
        count = emit_steps(signal, *self._levels(), timestamp_us, *bits, keys)
        _require_finite(count)
        return keys[:count]

    def spare(self, count: int) -> Keys:
        """Scratch space for at least ``count`` keys, to sort them in; the next call may return the same array."""
        if self._spare.size < count:
            self._spare = np.empty(2 * count, np.int64)
        return self._spare

    def _levels(self) -> tuple[Floats, NDArray[np.float32], Floats, float, Floats, Floats]:
        return self.reference, self._middle, self._near, self._largest, *self._thresholds


def _require_finite(row_or_count: int) -> None:
    if row_or_count == NOT_FINITE:
        raise SignalNotFiniteError("Expected finite signals, got one that is infinite or not a number")


def _prefetch(_typing: Any, array: Any, row: Any, column: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind, (array, *indices) = signature.args[0], arguments
        view = context.make_array(kind)(context, builder, array)
        pointer_to: Any = cgutils.get_item_pointer
        place = builder.bitcast(pointer_to(context, builder, kind, view, indices, wraparound=False), _BYTES)
        builder.call(builder.module.declare_intrinsic("llvm.prefetch", [_BYTES], _PREFETCH), [place, *_HINTS])
        return context.get_dummy_value()

    return types.void(array, row, column), generate


prefetch: Final[Any] = intrinsic(_prefetch)
"""``prefetch(array, row, column)``, in compiled code: fetch the cache line of an item, and do not wait for it.

Nothing is read or checked; the indices are unsigned.
"""


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

    The signal is a straight line between the samples; times are nanoseconds since the start. Keys are in raster
    order, those of a pixel in order of time, and follow the first ``count`` of ``keys``. ``shares`` is scratch space of
    the same length. Where ``keys`` is full, a second call with a longer array writes the others, as every reference is
    at the last level written.

    Parameters
    ----------
    previous, signal
        (H, W) samples at both ends of the interval.
    reference, middle
        (H, W) updated where a level is crossed.
    near, largest
        Half-width of what is surely quiet, and the largest middle.
    threshold_on, threshold_off
        (H, W) or (1, W), in the unit of the signal.
    start_ns, stop_ns
        Ends of the interval, since the start of the recording.
    column_bits, timestamp_shift
        Bits of a column, and below the timestamp.
    keys, shares
        (m,) keys to write, and scratch space.
    first_row, count
        Row to begin with, and the keys that are already written.

    Returns
    -------
    row, count
        Row to continue from, the height when all is done, and the number of keys so far. The row is NOT_FINITE where a
        signal is not finite.
    """
    height, width = signal.shape
    quiet, words, candidates = row_buffers(width)
    active, coming = pixel_buffer(width, _BAND), pixel_buffer(width, _BAND)
    active_count = 0
    for band in range(first_row, height + _BAND, _BAND):
        active, coming, active_here, active_count = coming, active, active_count, 0
        for row in range(band, min(band + _BAND, height)):
            mark_quiet(signal, middle, near, row, quiet)
            active_count = list_active(words, row, candidates, coming, active_count)
        for pixel in coming[:active_count]:
            prefetch(previous, pixel >> COLUMN_BITS, pixel & COLUMN_MASK)
            prefetch(reference, pixel >> COLUMN_BITS, pixel & COLUMN_MASK)
        first_key, keys_are_full = count, False
        for pixel in active[:active_here]:
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
                keys_are_full = count == keys.size
                if keys_are_full:
                    break
                level += step
                shares[count] = (level - before) / (value - before)
                keys[count] = np.int64(row << column_bits | column) << 1 | rising
                count += 1
            reference[row, column], middle[row, column] = level, middle_of(level, on, off, largest)
            if keys_are_full:
                break
        _timestamp(keys[first_key:count], shares[first_key:count], start_ns, stop_ns, timestamp_shift)
        if keys_are_full:
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

    The reference becomes the current value, however large the step. ``keys`` holds one key for every pixel.

    Returns
    -------
    count
        Number of keys, which are sorted; or NOT_FINITE.
    """
    height, width = signal.shape
    quiet, words, candidates = row_buffers(width)
    active = pixel_buffer(width, 1)
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
