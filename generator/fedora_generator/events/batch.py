"""Events as columns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_generator.events import key_kernels
from fedora_generator.events.keys import KeyLayout

Keys = NDArray[np.int64]


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
    """Events of sorted keys.

    Parameters
    ----------
    keys
        (n,) sorted.
    layout
        Bits of a key.
    start_us
        Added to the timestamps.

    Returns
    -------
    EventBatch
        In the order (t, y, x, p).
    """
    batch = _empty_batch(keys.size)
    bits = (layout.column_bits, layout.timestamp_shift)
    key_kernels.decode_keys(keys, *bits, start_us, batch.x, batch.y, batch.t_us, batch.p)
    return batch


def sort_and_decode(
    keys: Keys, layout: KeyLayout, first_us: int, last_us: int, start_us: int, spare: Keys
) -> EventBatch:
    """Events of keys in raster order.

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

    Returns
    -------
    EventBatch
        In the order (t, y, x, p).
    """
    batch = _empty_batch(keys.size)
    timestamps = (layout.column_bits, layout.timestamp_shift, first_us, last_us, start_us)
    key_kernels.sort_and_decode_keys(keys, *timestamps, spare, batch.x, batch.y, batch.t_us, batch.p)
    return batch


def _empty_batch(count: int) -> EventBatch:
    return EventBatch(
        np.empty(count, np.uint16), np.empty(count, np.uint16), np.empty(count, np.int64), np.empty(count, np.uint8)
    )
