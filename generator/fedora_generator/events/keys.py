"""Events as keys, the compiled loops over keys, and events as columns.

Sorting keys is sorting events by (t, y, x, p). Timestamps are microseconds since the start; at 640x480 the bits
beside row and column hold 278 years of them.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

POLARITY_BITS: Final = 1


@dataclass(frozen=True, slots=True)
class KeyLayout:
    """Bits of a key on a sensor of ``height`` x ``width`` pixels.

    A pixel's place is ``row << column_bits | column``. A key is
    ``timestamp << timestamp_shift | place << 1 | polarity``.
    """

    height: int
    width: int
    column_bits: int = field(init=False)
    """Bits of a column, the lowest of a place"""
    timestamp_shift: int = field(init=False)
    """Bits below the timestamp"""

    def __post_init__(self) -> None:
        column_bits = (self.width - 1).bit_length()
        object.__setattr__(self, "column_bits", column_bits)
        object.__setattr__(self, "timestamp_shift", (self.height - 1).bit_length() + column_bits + POLARITY_BITS)

    @property
    def places(self) -> int:
        """One more than the largest place."""
        return self.height << self.column_bits

    def places_of(self, pixels: NDArray[np.int64]) -> NDArray[np.int64]:
        """Places (n,) of pixels numbered in raster order."""
        rows, columns = np.divmod(pixels, self.width)
        return (rows << self.column_bits) | columns

    def first_key_after(self, timestamp_us: int) -> int:
        """Least key whose timestamp is later than ``timestamp_us``."""
        return (timestamp_us + 1) << self.timestamp_shift

    def with_timestamp(self, keys: NDArray[np.int64], timestamp_us: int) -> NDArray[np.int64]:
        """Return the keys with all timestamps equal to ``timestamp_us``."""
        return (keys & ((1 << self.timestamp_shift) - 1)) | (timestamp_us << self.timestamp_shift)


Keys = NDArray[np.int64]

_DIGIT_BITS: Final = 11
"""2048 counters fit the first cache, and an interval of 2 ms is sorted in one pass."""


@njit(cache=True)
def sort_by_timestamp(keys: Keys, timestamp_shift: int, first_us: int, last_us: int, spare: Keys) -> Keys:
    """Sort keys by timestamp; equal timestamps keep their order.

    Radix sort on the digits of the timestamp: keys in raster order come out in the order (t, y, x, p).

    Parameters
    ----------
    keys
        (n,) in raster order; overwritten.
    timestamp_shift
        Bits below the timestamp.
    first_us, last_us
        Least and largest timestamp.
    spare
        Scratch space for at least n keys; overwritten.

    Returns
    -------
    keys
        (n,) sorted, in the memory of ``keys`` or of ``spare``.
    """
    starts = np.empty((1 << _DIGIT_BITS) + 1, np.int64)
    base, shift, span = first_us << timestamp_shift, timestamp_shift, last_us - first_us
    while True:
        starts[:] = 0
        for key in keys:
            starts[_digit(key - base, shift) + 1] += 1
        for digit in range(1, starts.size):
            starts[digit] += starts[digit - 1]
        ordered = spare[: keys.size]
        for key in keys:
            digit = _digit(key - base, shift)
            ordered[starts[digit]] = key
            starts[digit] += 1
        span >>= _DIGIT_BITS
        if span == 0:
            return ordered
        keys, spare = ordered, keys
        shift += _DIGIT_BITS


@njit(cache=True)
def _digit(key: int, shift: int) -> int:
    return (key >> shift) & ((1 << _DIGIT_BITS) - 1)


@njit(cache=True)
def drop_refractory(keys: Keys, timestamp_shift: int, refractory_us: int, last_us: NDArray[np.int64]) -> int:
    """Drop the keys that follow their pixel's last event too soon.

    Parameters
    ----------
    keys
        (n,) sorted; those that stay are moved to the front.
    timestamp_shift
        Bits below the timestamp.
    refractory_us
        Least time between two events of a pixel.
    last_us
        (places,) time of the last event of each pixel; updated.
    """
    kept = 0
    places = (1 << (timestamp_shift - 1)) - 1
    for key in keys:
        place = (key >> 1) & places
        timestamp_us = key >> timestamp_shift
        if timestamp_us - last_us[place] >= refractory_us:
            last_us[place] = timestamp_us
            keys[kept] = key
            kept += 1
    return kept


@njit(cache=True)
def align_to_packets(keys: Keys, timestamp_shift: int, packet_us: int) -> None:
    """Move every timestamp up, in place, to the first multiple of ``packet_us`` not before it."""
    below_timestamp = (1 << timestamp_shift) - 1
    for index in range(keys.size):
        packet = ((keys[index] >> timestamp_shift) + packet_us - 1) // packet_us
        keys[index] = (packet * packet_us) << timestamp_shift | (keys[index] & below_timestamp)


@njit(cache=True)
def decode_keys(
    keys: Keys,
    column_bits: int,
    timestamp_shift: int,
    start_us: int,
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    t_us: NDArray[np.int64],
    p: NDArray[np.uint8],
) -> None:
    """Decode keys into columns.

    Parameters
    ----------
    keys
        (n,)
    column_bits, timestamp_shift
        Bits of a column, and below the timestamp.
    start_us
        Added to the timestamps.
    x, y, t_us, p
        (n,) columns to fill.
    """
    columns, places = (1 << column_bits) - 1, (1 << (timestamp_shift - 1)) - 1
    for index in range(keys.size):
        key = keys[index]
        place = (key >> 1) & places
        p[index] = key & 1
        x[index], y[index] = place & columns, place >> column_bits
        t_us[index] = start_us + (key >> timestamp_shift)


@njit(cache=True)
def sort_and_decode_keys(
    keys: Keys,
    column_bits: int,
    timestamp_shift: int,
    first_us: int,
    last_us: int,
    start_us: int,
    spare: Keys,
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    t_us: NDArray[np.int64],
    p: NDArray[np.uint8],
) -> None:
    """Decode the keys, timestamps in [first, last], into columns sorted by timestamp.

    Both in one call, as a call that finds the caches cold costs 10 us, as much as 500 events.
    """
    decode_keys(
        sort_by_timestamp(keys, timestamp_shift, first_us, last_us, spare),
        column_bits,
        timestamp_shift,
        start_us,
        x,
        y,
        t_us,
        p,
    )


@dataclass(frozen=True, slots=True)
class EventBatch:
    """Events in the order (t, y, x, p)."""

    x: NDArray[np.uint16]
    """(n,) column"""
    y: NDArray[np.uint16]
    """(n,) row"""
    t_us: NDArray[np.int64]
    """(n,) microseconds"""
    p: NDArray[np.uint8]
    """(n,) 1 brighter, 0 darker"""

    def __len__(self) -> int:
        return self.t_us.size


def decode(keys: Keys, layout: KeyLayout, start_us: int) -> EventBatch:
    """Events of sorted keys, in the order (t, y, x, p).

    Parameters
    ----------
    keys
        (n,) sorted.
    layout
        Bits of a key.
    start_us
        Added to the timestamps.
    """
    batch = _empty_batch(keys.size)
    bits = (layout.column_bits, layout.timestamp_shift)
    decode_keys(keys, *bits, start_us, batch.x, batch.y, batch.t_us, batch.p)
    return batch


def sort_and_decode(
    keys: Keys, layout: KeyLayout, first_us: int, last_us: int, start_us: int, spare: Keys
) -> EventBatch:
    """Events of keys in raster order, sorted in the order (t, y, x, p).

    Parameters
    ----------
    keys
        (n,) in raster order; overwritten.
    layout
        Bits of a key.
    first_us, last_us
        Least and largest timestamp of the keys.
    start_us
        Added to the timestamps.
    spare
        Scratch space for at least n keys; overwritten.
    """
    batch = _empty_batch(keys.size)
    timestamps = (layout.column_bits, layout.timestamp_shift, first_us, last_us, start_us)
    sort_and_decode_keys(keys, *timestamps, spare, batch.x, batch.y, batch.t_us, batch.p)
    return batch


def _empty_batch(count: int) -> EventBatch:
    return EventBatch(
        np.empty(count, np.uint16), np.empty(count, np.uint16), np.empty(count, np.int64), np.empty(count, np.uint8)
    )
