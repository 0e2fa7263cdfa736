"""Faults of the maps from frames to events, and the computation of the maps."""

from typing import Final, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import edit, rows_before, window_of
from fedora_qa.causes import INDEX_MAPS, stream_family
from fedora_qa.layout.canonical import TIMESTAMPS_OF, datasets_of, timestamps_of

_MAPPED_STREAMS: Final = frozenset({"events", "rgb", "depth"})
_CAUSES_BEFORE_MAPS: Final = frozenset(
    {
        "time_offset",
        "clock_rate",
        "quantised_time",
        "time_jitter",
        "dropped_samples",
        "duplicated_samples",
        "truncated",
        "dead_region",
        "hot_pixels",
        "interpolated_frames",
        "spatial_offset",
        "other_sequence",
    }
)
"""Faults that happen before the recorder makes the maps. It makes them from the wrong or missing timestamps, so that a
map of the true ones would reveal the fault. Maps of unsorted events or of another time unit stay as they are."""


def precedes_index_maps(fault: Fault) -> bool:
    """Whether a recorder computes the index maps after this fault, from the faulty timestamps and rows."""
    family = stream_family(fault.stream)
    moves_events = family == "events" and fault.region is not None  # it moves events into the region or out of it
    return moves_events or (fault.cause in _CAUSES_BEFORE_MAPS and family in _MAPPED_STREAMS)


def index_off_by_one(file: h5py.File, fault: Fault) -> None:
    """Shift every index by the magnitude."""
    shift = fault.count()
    indices = _map_in(file, fault.stream)
    edit(indices, _window_of_map(file, fault), lambda indices: indices + shift)


def index_side(file: h5py.File, fault: Fault) -> None:
    """Point behind the events that have a frame's own timestamp (``side="right"``)."""
    indices, window = _map_in(file, fault.stream), _window_of_map(file, fault)
    indices_right = _indices(file, fault.stream, "right")[window]
    if np.array_equal(indices_right, indices[window]):
        raise FaultError("Expected an event with the stamp of a frame, got none: the fault would change nothing")
    indices[window] = indices_right


def update_index_maps(file: h5py.File) -> None:
    """Compute the maps of the file again from its present timestamps, one index a frame."""
    for stream in INDEX_MAPS:
        key = _map_key(stream)
        if key not in file or not {timestamps_of(_frames_of(stream)), timestamps_of("events")} <= _keys(file):
            continue
        indices = _indices(file, stream, "left")
        if len(indices) != len(file[key]):
            file[key].resize(len(indices), axis=0)
        file[key][...] = indices


def _window_of_map(file: h5py.File, fault: Fault) -> slice:
    """Return the rows of the map whose frames lie in the fault's interval."""
    return window_of(file, _frames_of(fault.stream), fault)


def _indices(file: h5py.File, stream: str, side: Literal["left", "right"]) -> NDArray[np.int64]:
    frame_timestamps_us = file[timestamps_of(_frames_of(stream))][...]
    # The events not after t are those before t + 1: timestamps are whole.
    return rows_before(file[timestamps_of("events")], frame_timestamps_us + (side == "right"))


def _keys(file: h5py.File) -> set[str]:
    return {key for key in TIMESTAMPS_OF.values() if key in file}


def _map_key(stream: str) -> str:
    return datasets_of(stream)[0].key


def _map_in(file: h5py.File, stream: str) -> h5py.Dataset:
    key = _map_key(stream)
    if key not in file or not {timestamps_of(_frames_of(stream)), timestamps_of("events")} <= _keys(file):
        raise FaultError(f"Expected a file with {key}, its frames and events, got none; name another stream")
    return file[key]


def _frames_of(stream: str) -> str:
    return stream.removesuffix("_to_event")
