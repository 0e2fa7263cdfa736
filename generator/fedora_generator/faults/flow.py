"""Faults of the flow fields."""

from typing import Final

import h5py
import numpy as np

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import edit_values, streams_in, timestamps_in, window_of
from fedora_qa.conventions import US_PER_S
from fedora_qa.layout.canonical import FLOW_STREAMS

_FASTEST_FIRST: Final = tuple(reversed(FLOW_STREAMS))


def flow_sign(file: h5py.File, fault: Fault) -> None:
    """Point backwards."""
    edit_values(file, fault, lambda flow_px: -flow_px)


def axes_swapped(file: h5py.File, fault: Fault) -> None:
    """Write (v, u)."""
    edit_values(file, fault, lambda flow_px: flow_px[..., ::-1])


def frame_convention(file: h5py.File, fault: Fault) -> None:
    """Let v point up."""
    edit_values(file, fault, lambda flow_px: flow_px * np.array([1, -1], dtype=flow_px.dtype))


def flow_gain(file: h5py.File, fault: Fault) -> None:
    """Make flow too large by the magnitude."""
    gain = np.float32(1 + fault.magnitude_in("percent") / 100)
    edit_values(file, fault, lambda flow_px: flow_px * gain)


def flow_unit(file: h5py.File, fault: Fault) -> None:
    """Write px/s, or px s (the paper's equation) where the magnitude is negative: values too large, or too small."""
    power = 1 if fault.magnitude_in("1") > 0 else -1
    for stream in streams_in(file, fault.stream):
        timestamps_us = timestamps_in(file, stream)
        for row in _rows(file, stream, fault):
            interval_s = float(timestamps_us[row, 1] - timestamps_us[row, 0]) / US_PER_S
            file[f"path/{stream}"][row] = file[f"path/{stream}"][row] * np.float32(interval_s**-power)


def flow_rate_mixed(file: h5py.File, fault: Fault) -> None:
    """Store under one rate the field of the fastest other rate that begins at the same time, or last before.

    With the stream ``flow`` the fastest rate keeps its own.
    """
    present = [each for each in _FASTEST_FIRST if f"path/{each}" in file]
    receivers = [each for each in streams_in(file, fault.stream) if fault.stream != "flow" or each != present[0]]
    if len(present) < 2:
        raise FaultError(f"Expected flow at two rates or more, got {', '.join(present) or 'none'}")
    for stream in receivers:
        donor = next(each for each in present if each != stream)
        starts_us, donor_starts_us = (timestamps_in(file, each)[:, 0] for each in (stream, donor))
        nearest = np.searchsorted(donor_starts_us, starts_us, side="right") - 1
        for row in _rows(file, stream, fault):
            file[f"path/{stream}"][row] = file[f"path/{donor}"][max(int(nearest[row]), 0)]


def flow_interval_shifted(file: h5py.File, fault: Fault) -> None:
    """Stamp fields too late by the given number of intervals; the fields at the end that have none repeat the last."""
    shift = fault.count()
    for stream in streams_in(file, fault.stream):
        fields = file[f"path/{stream}"]
        rows = _rows(file, stream, fault)
        # From the end towards which fields move, so that none is overwritten before it has been read.
        for row in reversed(rows) if shift > 0 else rows:
            fields[row] = fields[min(max(row - shift, 0), len(fields) - 1)]


def _rows(file: h5py.File, stream: str, fault: Fault) -> range:
    window = window_of(file, stream, fault)
    return range(window.start, window.stop)
