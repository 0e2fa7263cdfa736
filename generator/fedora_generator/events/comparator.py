"""The comparator of the event camera: a signal per pixel in, keys of events out, references in between."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.events import comparator_kernels as kernels
from fedora_generator.events.keys import KeyLayout
from fedora_generator.events.quiet_kernels import find_middles
from fedora_qa.conventions import NS_PER_US

Floats = NDArray[np.float64]
Keys = NDArray[np.int64]

_FIRST_ROOM: Final = 1 << 12

_LARGEST_MIDDLE: Final = 2.0**12
"""In half-widths of the narrowest quiet interval: how far from zero float32 serves, 819 nat for thresholds of 0.2."""

_ROUNDING: Final = 2.0**-23
_ROUNDING_OF_WIDTHS: Final = 2.0**-40
"""What near is less than the half-width: this share of the largest middle, and that of the half-width itself.

Let a signal be outside, at ``v >= fl(reference + on)``. In real numbers ``reference + on = m + w`` with middle and
half-width; the float32 middle is off by at most 2^-24 |m| and what float64 adds, 2^-53 times a few |m| and w. So
``fl(v - middle) >= fl(w - 2^-23.9 |m| - 2^-50 w)``, as rounding keeps the order, and that is not near.
"""


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
        self._room, self._shares = np.empty(_FIRST_ROOM, np.int64), np.empty(_FIRST_ROOM)
        self._spare = np.empty(0, np.int64)

    def reset(self, reference: Floats) -> None:
        """Start from other references (H, W), which are taken over and changed."""
        self.reference = reference
        find_middles(reference, *self._thresholds, self._largest, self._middle)

    def crossings(self, previous: Floats, signal: Floats, start_ns: int, stop_ns: int) -> Keys:
        """Keys of all levels that the straight line between two signals reaches; each becomes the reference.

        Keys come in raster order, and those of a pixel in order of time; stamps lie in (start, stop]. The
        next call overwrites them.

        Raises
        ------
        SignalNotFiniteError
            There is no telling which levels were reached.
        """
        bits = (self._layout.column_bits, self._layout.timestamp_shift)
        interval = (previous, signal, *self._levels(), start_ns, stop_ns, *bits)
        row, count = kernels.emit_crossings(*interval, self._room, self._shares, 0, 0)
        while 0 <= row < self._layout.height:
            self._room = np.concatenate([self._room, np.empty_like(self._room)])
            self._shares = np.empty(self._room.size)
            row, count = kernels.emit_crossings(*interval, self._room, self._shares, row, count)
        _require_finite(row)
        return self._room[:count]

    def steps(self, signal: Floats, stop_ns: int) -> Keys:
        """Keys in raster order, one for each pixel farther than its threshold; its signal becomes the reference.

        Raises
        ------
        SignalNotFiniteError
            There is no telling how far a pixel is.
        """
        keys = np.empty(signal.size, np.int64)
        bits = (self._layout.column_bits, self._layout.timestamp_shift)
        timestamp_us = _timestamp_us(stop_ns)
        count = kernels.emit_steps(signal, *self._levels(), timestamp_us, *bits, keys)
        _require_finite(count)
        return keys[:count]

    def spare(self, count: int) -> Keys:
        """Room for at least ``count`` keys, to sort them in; the next call may return the same."""
        if self._spare.size < count:
            self._spare = np.empty(2 * count, np.int64)
        return self._spare

    def _levels(self) -> tuple[Floats, NDArray[np.float32], Floats, float, Floats, Floats]:
        return self.reference, self._middle, self._near, self._largest, *self._thresholds


def _timestamp_us(time_ns: int) -> int:
    """First whole microsecond not before a time."""
    return -(-time_ns // NS_PER_US)


def _require_finite(answer: int) -> None:
    if answer == kernels.NOT_FINITE:
        raise SignalNotFiniteError("Expected finite signals, got one that is infinite or not a number")
