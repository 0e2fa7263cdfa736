"""Compiled loops of the event sensor.

An event travels as one int64 key, ``(microseconds since the start * pixels + pixel) * 2 + polarity``, pixel = row *
width + column: sorting keys is sorting by (t, y, x, p).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US

Floats = NDArray[np.float64]
Keys = NDArray[np.int64]


@njit(cache=True)
def find_active_pixels(
    signal: Floats, reference: Floats, threshold_on: Floats, threshold_off: Floats, active: NDArray[np.int32]
) -> int:
    """Collect in ``active`` the pixels at or beyond a threshold; return how many, or -1 - pixel where not finite."""
    count = 0
    for pixel in range(signal.size):
        value = signal[pixel]
        if reference[pixel] - threshold_off[pixel] < value < reference[pixel] + threshold_on[pixel]:
            continue
        if not math.isfinite(value):
            return -1 - pixel
        active[count] = pixel
        count += 1
    return count


@njit(cache=True)
def count_crossings(
    active: NDArray[np.int32], signal: Floats, reference: Floats, threshold_on: Floats, threshold_off: Floats
) -> int:
    """Levels that the active pixels reach on their way to ``signal``; walks exactly as ``emit_crossings`` does."""
    count = 0
    for pixel in active:
        value, level = signal[pixel], reference[pixel] + threshold_on[pixel]
        while value >= level:
            count += 1
            level += threshold_on[pixel]
        level = reference[pixel] - threshold_off[pixel]
        while value <= level:
            count += 1
            level -= threshold_off[pixel]
    return count


@njit(cache=True, error_model="numpy")  # no test for a division by zero: a crossed level lies between the samples
def emit_crossings(
    active: NDArray[np.int32],
    previous: Floats,
    signal: Floats,
    reference: Floats,
    threshold_on: Floats,
    threshold_off: Floats,
    start_ns: int,
    stop_ns: int,
    keys: Keys,
) -> None:
    """Write a key for each level crossed between two samples, and leave ``reference`` at the last level.

    The signal is a straight line between the samples; times are nanoseconds since the start.
    """
    count = 0
    for pixel in active:
        before, value = previous[pixel], signal[pixel]
        level = reference[pixel] + threshold_on[pixel]
        while value >= level:
            keys[count] = _key_of_crossing(level, before, value, start_ns, stop_ns, pixel, signal.size, 1)
            count += 1
            reference[pixel] = level
            level += threshold_on[pixel]
        level = reference[pixel] - threshold_off[pixel]
        while value <= level:
            keys[count] = _key_of_crossing(level, before, value, start_ns, stop_ns, pixel, signal.size, 0)
            count += 1
            reference[pixel] = level
            level -= threshold_off[pixel]


@njit(cache=True, error_model="numpy")
def _key_of_crossing(
    level: float, before: float, value: float, start_ns: int, stop_ns: int, pixel: int, pixels: int, polarity: int
) -> int:
    """Key of a crossing, stamped with the first whole microsecond not before it."""
    span_ns = stop_ns - start_ns
    offset_ns = math.floor((level - before) / (value - before) * span_ns + 0.5)
    offset_ns = min(max(offset_ns, 1), span_ns)  # the level was not yet reached at the previous sample
    stamp_us = (start_ns + offset_ns + NS_PER_US - 1) // NS_PER_US
    return (stamp_us * pixels + pixel) * 2 + polarity


@njit(cache=True)
def emit_steps(
    active: NDArray[np.int32],
    signal: Floats,
    reference: Floats,
    threshold_on: Floats,
    threshold_off: Floats,
    stop_ns: int,
    keys: Keys,
) -> int:
    """One event a pixel whose value differs from the reference by strictly more than the threshold; return how many.

    The stamp is the step's own time and the reference becomes the current value, however large the step.
    """
    stamp_us = (stop_ns + NS_PER_US - 1) // NS_PER_US
    count = 0
    for pixel in active:
        difference = signal[pixel] - reference[pixel]
        if difference > threshold_on[pixel] or -difference > threshold_off[pixel]:
            keys[count] = (stamp_us * signal.size + pixel) * 2 + (1 if difference > 0 else 0)
            count += 1
            reference[pixel] = signal[pixel]
    return count


@njit(cache=True)
def drop_refractory(keys: Keys, pixels: int, refractory_us: int, last_us: NDArray[np.int64]) -> int:
    """Keep in place the keys (sorted) that come ``refractory_us`` or more after their pixel's last; return how many."""
    kept = 0
    for key in keys:
        pixel = (key >> 1) % pixels
        stamp_us = (key >> 1) // pixels
        if stamp_us - last_us[pixel] >= refractory_us:
            last_us[pixel] = stamp_us
            keys[kept] = key
            kept += 1
    return kept


@njit(cache=True)
def align_to_packets(keys: Keys, pixels: int, packet_us: int) -> None:
    """Move every stamp up, in place, to the first multiple of ``packet_us`` not before it."""
    for index in range(keys.size):
        within = keys[index] % (2 * pixels)
        stamp_us = keys[index] // (2 * pixels)
        packet = (stamp_us + packet_us - 1) // packet_us
        keys[index] = packet * packet_us * 2 * pixels + within


@njit(cache=True)
def decode_keys(
    keys: Keys,
    width: int,
    height: int,
    start_us: int,
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    t_us: NDArray[np.int64],
    p: NDArray[np.uint8],
) -> None:
    """Take the keys apart into columns; ``start_us`` is added to the stamps."""
    for index in range(keys.size):
        key = keys[index]
        p[index] = key & 1
        line, column = divmod(key >> 1, width)
        stamp_us, row = divmod(line, height)
        x[index], y[index], t_us[index] = column, row, start_us + stamp_us
