"""The yardstick: the plainest correct compiled scan of the log model, one loop over all pixels and their crossings.

It is given what costs it nothing to have: room for all its events, and one threshold for all pixels. Events are packed
into sortable numbers, as NumPy sorts integers several times faster than it finds the order of columns.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.events.keys import EventBatch

Floats = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def _scan(
    previous: Floats,
    signal: Floats,
    reference: Floats,
    threshold: float,
    start_ns: int,
    stop_ns: int,
    packed: NDArray[np.int64],
) -> int:
    count = 0
    for pixel in range(signal.size):
        before, value = previous[pixel], signal[pixel]
        while value >= reference[pixel] + threshold or value <= reference[pixel] - threshold:
            brighter = value >= reference[pixel] + threshold
            reference[pixel] += threshold if brighter else -threshold
            offset_ns = math.floor((reference[pixel] - before) / (value - before) * (stop_ns - start_ns) + 0.5)
            offset_ns = min(max(offset_ns, 1), stop_ns - start_ns)
            timestamp_us = (start_ns + offset_ns + 999) // 1000
            packed[count] = (timestamp_us * signal.size + pixel) * 2 + brighter
            count += 1
    return count


@njit(cache=True)
def _unpack(
    packed: NDArray[np.int64],
    height: int,
    width: int,
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    t_us: NDArray[np.int64],
    p: NDArray[np.uint8],
) -> None:
    for index in range(packed.size):
        p[index] = packed[index] % 2
        row_of_all, x[index] = divmod(packed[index] // 2, width)
        t_us[index], y[index] = divmod(row_of_all, height)


class PlainScan:
    """Log model with one threshold; ``reference`` (H, W) is taken over and changed."""

    def __init__(self, threshold: float, reference: Floats) -> None:
        self._threshold = threshold
        self._reference = reference
        self._packed = np.empty(4 * reference.size, np.int64)

    def advance(self, previous: Floats, signal: Floats, start_ns: int, stop_ns: int) -> EventBatch:
        """Events in (start, stop], in the order (t, y, x, p); at most four a pixel."""
        flat = (previous.reshape(-1), signal.reshape(-1), self._reference.reshape(-1))
        count = _scan(*flat, self._threshold, start_ns, stop_ns, self._packed)
        packed = np.sort(self._packed[:count])
        x, y, p = np.empty(count, np.uint16), np.empty(count, np.uint16), np.empty(count, np.uint8)
        batch = EventBatch(x, y, np.empty(count, np.int64), p)
        _unpack(packed, *signal.shape, batch.x, batch.y, batch.t_us, batch.p)
        return batch
