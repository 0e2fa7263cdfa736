"""Compiled loops that find the few pixels which may have left their thresholds.

Most pixels are quiet most of the time, and their comparison costs memory reads. So the middle of each pixel's quiet
interval, ``(reference - off, reference + on)``, is stored in float32 beside the reference, and a signal near enough
to it is quiet. *Near enough* allows for all rounding, so that a pixel marked quiet always is; only pixels that
are not near enough are compared exactly.
"""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

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

    Returns
    -------
    count
        Pixels in the list now.
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
