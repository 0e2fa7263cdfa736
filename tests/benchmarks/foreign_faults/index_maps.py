"""Maps from frames to events."""

import h5py
import numpy as np

from tests.benchmarks.foreign.events import packets
from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan, Plant


def moved(*streams: str) -> Plant:
    """All entries are too large by so many events."""

    def plant(file: h5py.File, plan: Plan) -> None:
        for stream in streams:
            key = f"metadata/{stream}_to_event"
            replace_values(file, key, file[key][...] + (int(plan.size) or 1))

    return plant


def behind_equal_stamps(file: h5py.File, plan: Plan) -> None:
    """Events come in declared packets, and entries count the events that are not after their frame."""
    packets(file)
    stamps_us = file["path/events/t"][...]
    for stream in ("rgb", "depth"):
        indices = np.searchsorted(stamps_us, file[f"path/{stream}_ts"][...], "right")
        replace_values(file, f"metadata/{stream}_to_event", indices.astype(np.int64))


def into_imu(file: h5py.File, plan: Plan) -> None:
    """Entries count the samples of the IMU."""
    indices = np.searchsorted(file["path/imu/ts"][...], file["path/rgb_ts"][...], "left")
    replace_values(file, "metadata/rgb_to_event", indices.astype(np.int64))


def by_frame_numbers(file: h5py.File, plan: Plan) -> None:
    """Entries share the events out evenly among the frames."""
    frames = len(file["path/rgb_ts"])
    indices = np.arange(frames) * (len(file["path/events/t"]) / frames)
    replace_values(file, "metadata/rgb_to_event", indices.astype(np.int64))
