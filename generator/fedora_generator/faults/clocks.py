"""Faults of a clock, for every stream that has timestamps; jitter of single events is in ``events.py``."""

import h5py
import numpy as np

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import Array, edit, streams_in, timestamps_in, window_of

US_PER_MS = 1_000


def time_offset(file: h5py.File, fault: Fault) -> None:
    """Make timestamps late by a constant, rounded to a microsecond."""
    offset_us = round(fault.magnitude_in("ms") * US_PER_MS)
    for stream in streams_in(file, fault.stream):
        edit(
            timestamps_in(file, stream), window_of(file, stream, fault), lambda timestamps_us: timestamps_us + offset_us
        )


def clock_rate(file: h5py.File, fault: Fault) -> None:
    """Make the clock fast from the first timestamp of the window on: ``t' = t + (t - t_first) * rate``."""
    rate = fault.magnitude_in("1")
    for stream in streams_in(file, fault.stream):
        timestamps, window = timestamps_in(file, stream), window_of(file, stream, fault)
        first_us = int(np.min(timestamps[window.start]))

        def stretch(timestamps_us: Array, first_us: int = first_us) -> Array:
            return timestamps_us + np.rint((timestamps_us - first_us) * rate).astype(np.int64)

        edit(timestamps, window, stretch)


def quantised_time(file: h5py.File, fault: Fault) -> None:
    """Round timestamps to the nearest multiple of the magnitude.

    Truncation, as in an integer division, would add an offset of half a grid.
    """
    grid_us = round(fault.magnitude_in("ms") * US_PER_MS)
    if grid_us < 2:
        raise FaultError(f"Expected a grid of at least 0.002 ms, got {fault.magnitude:g} {fault.unit}")
    for stream in streams_in(file, fault.stream):
        edit(
            timestamps_in(file, stream),
            window_of(file, stream, fault),
            lambda timestamps_us: (timestamps_us + grid_us // 2) // grid_us * grid_us,
        )


def time_unit(file: h5py.File, fault: Fault) -> None:
    """Multiply timestamps by the magnitude: 1000 writes nanoseconds, 0.001 milliseconds, rounded to whole ones."""
    factor = fault.magnitude_in("1")
    if factor <= 0 or factor == 1:
        raise FaultError(f"Expected a positive factor other than 1, such as 1000 or 0.001, got {factor:g}")

    def convert(timestamps_us: Array) -> Array:
        if factor.is_integer():
            return timestamps_us * int(factor)
        return np.rint(timestamps_us * factor).astype(np.int64)

    for stream in streams_in(file, fault.stream):
        edit(timestamps_in(file, stream), window_of(file, stream, fault), convert)
