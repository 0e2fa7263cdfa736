"""Rows that are late, lost, held, doubled or out of order because of how they travel from a sensor into a file."""

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.canonical import TIMESTAMPS_OF
from tests.benchmarks.foreign.rows import keep_rows, present_keys, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan, Plant


def _stamps_us(file: h5py.File, stream: str) -> NDArray[np.int64]:
    stamps_us: NDArray[np.int64] = file[TIMESTAMPS_OF[stream]][...]
    return stamps_us


def queue_fills(stream: str) -> Plant:
    """Within a while, stamps are late by up to so many ms: the delay grows steadily, and falls again."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = _stamps_us(file, stream)
        share = (stamps_us - stamps_us[0]) / (stamps_us[-1] - stamps_us[0])
        middle, half = (plan.begin + plan.end) / 2, (plan.end - plan.begin) / 2
        late_us = 1000 * plan.size * np.clip(1 - np.abs(share - middle) / half, 0, None)
        replace_values(file, TIMESTAMPS_OF[stream], np.maximum.accumulate(stamps_us + np.rint(late_us).astype(int)))
        update_index_maps(file)

    return plant


def leap_seconds(stream: str, seconds: int) -> Plant:
    """Stamps are of a time scale that differs by whole seconds."""

    def plant(file: h5py.File, plan: Plan) -> None:
        replace_values(file, TIMESTAMPS_OF[stream], _stamps_us(file, stream) + 1_000_000 * seconds)
        update_index_maps(file)

    return plant


def stamped_by_next_frame(file: h5py.File, plan: Plan) -> None:
    """Events carry the stamp of the colour frame that follows them."""
    stamps_us, frames_us = _stamps_us(file, "events"), _stamps_us(file, "rgb")
    following = np.minimum(np.searchsorted(frames_us, stamps_us), len(frames_us) - 1)
    replace_values(file, "path/events/t", frames_us[following])
    update_index_maps(file)


def _by_name(count: int) -> NDArray[np.int64]:
    return np.array(sorted(range(count), key=str))


def rows_by_name(stream: str) -> Plant:
    """Rows and stamps are in the order of numbers as text: 1, 10, 11, 2."""

    def plant(file: h5py.File, plan: Plan) -> None:
        keep_rows(file, stream, _by_name(len(_stamps_us(file, stream))))
        update_index_maps(file)

    return plant


def values_by_name(key: str) -> Plant:
    """Frames are in the order of numbers as text, and stamps in that of time."""

    def plant(file: h5py.File, plan: Plan) -> None:
        replace_values(file, key, file[key][...][_by_name(len(file[key]))])

    return plant


def begins_late(stream: str) -> Plant:
    """The first percent of a stream are absent."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = _stamps_us(file, stream)
        first_us = stamps_us[0] + plan.size / 100 * (stamps_us[-1] - stamps_us[0])
        keep_rows(file, stream, np.flatnonzero(stamps_us >= first_us))
        update_index_maps(file)

    return plant


def ends_early(*streams: str) -> Plant:
    """The last percent of some streams with intervals are absent."""

    def plant(file: h5py.File, plan: Plan) -> None:
        for stream in streams:
            starts_us = _stamps_us(file, stream)[:, 0]
            last_us = starts_us[-1] - plan.size / 100 * (starts_us[-1] - starts_us[0])
            keep_rows(file, stream, np.flatnonzero(starts_us <= last_us))

    return plant


def packets_lost(file: h5py.File, plan: Plan) -> None:
    """So many percent of all packets of 700 us, anywhere, never arrive."""
    stamps_us = _stamps_us(file, "events")
    packets = (stamps_us - stamps_us[0]) // 700
    arrives = plan.random.random(int(packets[-1]) + 1) >= plan.size / 100
    keep_rows(file, "events", np.flatnonzero(arrives[packets]))
    update_index_maps(file)


def thinned(file: h5py.File, plan: Plan) -> None:
    """So many percent of the events of the plan's time, anywhere, are absent."""
    stamps_us = _stamps_us(file, "events")
    lost = plan.times_us(stamps_us) & (plan.random.random(len(stamps_us)) < plan.size / 100)
    keep_rows(file, "events", np.flatnonzero(~lost))
    update_index_maps(file)


def some_doubled(file: h5py.File, plan: Plan) -> None:
    """So many percent of all events, anywhere, occur twice."""
    total = len(_stamps_us(file, "events"))
    repeats = 1 + (plan.random.random(total) < plan.size / 100).astype(int)
    keep_rows(file, "events", np.repeat(np.arange(total), repeats))
    update_index_maps(file)


def raster_within_packets(file: h5py.File, plan: Plan) -> None:
    """Events of a packet, of so many us, are in the order of rows and columns, with stamps of their own."""
    stamps_us = _stamps_us(file, "events")
    columns, rows = file["path/events/x"][...], file["path/events/y"][...]
    keep_rows(file, "events", np.lexsort([columns, rows, stamps_us // int(plan.size)]))


def held(stream: str, *keys: str) -> Plant:
    """Values repeat the last of a lower rate, Hz, under stamps of their own."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = _stamps_us(file, stream)
        step = max(2, round(1e6 / plan.size / float(np.median(np.diff(stamps_us)))))
        rows = np.arange(len(stamps_us)) // step * step
        for key in keys:
            replace_values(file, key, file[key][...][rows])

    return plant


def of_two_sensors(file: h5py.File, plan: Plan) -> None:
    """Events of another sequence lie among the events of this one."""
    with h5py.File(plan.donor) as donor:
        for key in (key for key in present_keys(file) if key.startswith("path/events/")):
            replace_values(file, key, np.concatenate([file[key][...], donor[key][...]]))
    keep_rows(file, "events", np.lexsort([file[f"path/events/{name}"][...] for name in "pxyt"]))
    update_index_maps(file)
