"""The comparator of the event camera: a signal per pixel in, keys of events out, references in between."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator import event_comparator_kernels as kernels
from fedora_generator.event_kernels import sort_by_stamp
from fedora_generator.event_keys import KeyLayout
from fedora_qa.conventions import NS_PER_US

Floats = NDArray[np.float64]
Keys = NDArray[np.int64]

_FIRST_ROOM: Final = 1 << 12


class SignalNotFiniteError(ArithmeticError):
    """A pixel's signal is infinite or not a number."""


class Comparator:
    """Compares signals (H, W) with references that follow them.

    Thresholds are (H, W), or (1, W) where all rows share them; ``reference`` (H, W) is taken over and changed. Times
    are nanoseconds since the start of the recording.
    """

    def __init__(self, layout: KeyLayout, threshold_on: Floats, threshold_off: Floats, reference: Floats) -> None:
        self.reference = reference
        self._thresholds = (threshold_on, threshold_off)
        self._layout = layout
        self._room = np.empty(_FIRST_ROOM, np.int64)

    def crossings(self, previous: Floats, signal: Floats, start_ns: int, stop_ns: int) -> Keys:
        """Sorted keys of all levels that the straight line between two signals reaches; each becomes the reference.

        Raises
        ------
        SignalNotFiniteError
            There is no telling which levels were reached.
        """
        bits = (self._layout.column_bits, self._layout.stamp_shift)
        interval = (previous, signal, self.reference, *self._thresholds, start_ns, stop_ns, *bits)
        row, count = kernels.emit_crossings(*interval, self._room, 0, 0)
        while 0 <= row < self._layout.height:
            self._room = np.concatenate([self._room, np.empty_like(self._room)])
            row, count = kernels.emit_crossings(*interval, self._room, row, count)
        _require_finite(row)
        keys = self._room[:count]
        return sort_by_stamp(keys, self._layout.stamp_shift, start_ns // NS_PER_US, _stamp_us(stop_ns))

    def steps(self, signal: Floats, stop_ns: int) -> Keys:
        """Sorted keys, one for each pixel farther than its threshold; its signal becomes the reference.

        Raises
        ------
        SignalNotFiniteError
            There is no telling how far a pixel is.
        """
        keys = np.empty(signal.size, np.int64)
        bits = (self._layout.column_bits, self._layout.stamp_shift)
        stamp_us = _stamp_us(stop_ns)
        count = kernels.emit_steps(signal, self.reference, *self._thresholds, stamp_us, *bits, keys)
        _require_finite(count)
        return keys[:count]


def _stamp_us(time_ns: int) -> int:
    """First whole microsecond not before a time."""
    return -(-time_ns // NS_PER_US)


def _require_finite(answer: int) -> None:
    if answer == kernels.NOT_FINITE:
        raise SignalNotFiniteError("Expected finite signals, got one that is infinite or not a number")
