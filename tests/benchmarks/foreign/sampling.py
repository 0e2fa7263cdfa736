"""Which frames and samples are there: rates, ends, cut-outs."""

import h5py
import numpy as np

from fedora_qa.layout.canonical import TIMESTAMPS_OF
from tests.benchmarks.foreign.gauge import shift_time
from tests.benchmarks.foreign.rows import FLOW_RATES, keep_rows, update_index_maps
from tests.benchmarks.foreign.transformation import Change


def every_nth(period: int, *streams: str) -> Change:
    """Return the change that keeps every n-th row of some streams."""

    def change(file: h5py.File) -> None:
        for stream in streams:
            keep_rows(file, stream, slice(None, None, period))
        update_index_maps(file)

    return change


def imu_every(period: int) -> Change:
    """Return the change that keeps every n-th IMU sample.

    ``sigma = density sqrt(rate)`` stays, so that the densities grow by ``sqrt(n)``.
    """

    def change(file: h5py.File) -> None:
        keep_rows(file, "imu", slice(None, None, period))
        attributes = file["metadata/imu"].attrs
        for name in ("gyro_noise_density", "accel_noise_density"):
            attributes[name] = attributes[name] * np.sqrt(float(period))

    return change


def sparse_flow(file: h5py.File) -> None:
    """Keep every third flow field of each rate."""
    for rate in FLOW_RATES:
        keep_rows(file, f"flow/{rate}", slice(None, None, 3))


def only_flow(rate: str) -> Change:
    """Return the change that leaves out the flow of all other rates."""

    def change(file: h5py.File) -> None:
        for name in [name for name in file["path/flow"] if not name.startswith(rate)]:
            del file[f"path/flow/{name}"]

    return change


def frames_at_25_hz(file: h5py.File) -> None:
    """Keep every second frame, and of flow what begins and ends on those: that of 25 Hz."""
    every_nth(2, "rgb", "depth")(file)
    only_flow("25hz")(file)


def colour_begins_late(file: h5py.File) -> None:
    """Leave out the first colour frame."""
    keep_rows(file, "rgb", slice(1, None))
    update_index_maps(file)


def depth_ends_early(file: h5py.File) -> None:
    """Leave out the last depth frame."""
    keep_rows(file, "depth", slice(None, -1))
    update_index_maps(file)


def half_open_span(file: h5py.File) -> None:
    """Leave out the last frame and sample of each stream, and the events and flow after the last frame."""
    for stream in ("rgb", "depth", "imu", "pose"):
        keep_rows(file, stream, slice(None, -1))
    last_us = file["path/rgb_ts"][-1]
    keep_rows(file, "events", file["path/events/t"][...] <= last_us)
    for rate in FLOW_RATES:
        keep_rows(file, f"flow/{rate}", file[f"path/flow/{rate}_ts"][:, 1] <= last_us)
    update_index_maps(file)


def middle_third(file: h5py.File) -> None:
    """Cut out the middle third, between two colour frames."""
    timestamps_us = file["path/rgb_ts"][...]
    third = len(timestamps_us) // 3
    _cut(file, int(timestamps_us[third]), int(timestamps_us[-1 - third]))


def middle_third_from_zero(file: h5py.File) -> None:
    """Cut out the middle third, and count time from its start."""
    middle_third(file)
    shift_time(-int(file["path/rgb_ts"][0]))(file)


def cut_between_frames(file: h5py.File) -> None:
    """Cut 37 ms off the start and 53 ms off the end, which are no periods of a stream."""
    timestamps_us = file["path/rgb_ts"][...]
    _cut(file, int(timestamps_us[0]) + 37_137, int(timestamps_us[-1]) - 53_411)


def _cut(file: h5py.File, start_us: int, stop_us: int) -> None:
    """Keep what lies from start to stop; events after the start; flow whose interval lies between."""
    for stream, key in TIMESTAMPS_OF.items():
        if key not in file:
            continue
        timestamps_us = file[key][...]
        if timestamps_us.ndim == 2:
            inside = (timestamps_us[:, 0] >= start_us) & (timestamps_us[:, 1] <= stop_us)
        else:
            after = timestamps_us > start_us if stream == "events" else timestamps_us >= start_us
            inside = after & (timestamps_us <= stop_us)
        keep_rows(file, stream, inside)
    # The reference level of a pixel at the start is no longer the light of the first frame.
    file["metadata/events"].attrs["initial_phase"] = "uniform"
    update_index_maps(file)
