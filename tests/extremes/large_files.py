"""Files of an hour, and of more than 2^31 events that are written, small on a disk; and what planning them takes.

    python -m tests.extremes.large_files FOLDER

prints processor time, windows and counts; minutes, most of them for the events.
"""

import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Final

import h5py
import hdf5plugin
import numpy as np

from fedora_qa.engine.survey import Prepared, prepare
from fedora_qa.sequence.sequence import open_sequence
from tests.support.handmade import write_handmade

HOUR_US: Final = 3_600_000_000
EVENTS: Final = 2**31 + 2**20
ROWS: Final = 1 << 20
MEMORY_BYTES: Final = 1 << 30


def hour_of_all_streams(path: Path) -> Path:
    """Write an hour of a handmade file's streams at their rates, in images of 2 x 2 px, an event a millisecond."""
    write_handmade(path)
    with h5py.File(path, "r+") as file:
        frames_us = np.arange(0, HOUR_US + 1, 20_000)
        imu_us, pose_us, events_us = (np.arange(0, HOUR_US + 1, step) for step in (1000, 5000, 1000))
        _replace(file, "path/rgb", np.full((len(frames_us), 2, 2, 3), 128, np.uint8))
        _replace(file, "path/depth", np.full((len(frames_us), 2, 2), 5000, np.float32))
        for timestamps in ("rgb", "depth"):
            _replace(file, f"path/{timestamps}_ts", frames_us)
            _replace(file, f"metadata/{timestamps}_to_event", frames_us // 1000)
        _replace(file, "path/imu/ts", imu_us)
        _replace(file, "path/imu/angular_velocity", np.zeros((len(imu_us), 3)))
        _replace(file, "path/imu/linear_acceleration", np.tile([0.0, 0.0, 9.81], (len(imu_us), 1)))
        _replace(file, "path/pose/ts", pose_us)
        _replace(file, "path/pose/position", np.zeros((len(pose_us), 3)))
        _replace(file, "path/pose/orientation", np.tile([0.0, 0.0, 0.0, 1.0], (len(pose_us), 1)))
        for rate, stride in (("10hz", 5), ("25hz", 2), ("50hz", 1)):
            starts = frames_us[:-stride:stride]
            _replace(file, f"path/flow/{rate}", np.zeros((len(starts), 2, 2, 2), np.float32))
            _replace(file, f"path/flow/{rate}_ts", np.column_stack([starts, starts + stride * 20_000]))
        for name, dtype in (("x", np.uint16), ("y", np.uint16), ("p", np.uint8)):
            _replace(file, f"path/events/{name}", np.zeros(len(events_us), dtype))
        _replace(file, "path/events/t", events_us)
    return path


def more_events_than_int32_counts(path: Path) -> Path:
    """Write 2^31 + 2^20 events over an hour, a million at a time with one stamp; other streams stay as they are."""
    write_handmade(path)
    with h5py.File(path, "r+") as file:
        for name, dtype in (("t", np.int64), ("x", np.uint16), ("y", np.uint16), ("p", np.uint8)):
            attributes = dict(file[f"path/events/{name}"].attrs)
            del file[f"path/events/{name}"]
            stored = file.create_dataset(
                f"path/events/{name}", (EVENTS,), dtype, chunks=(ROWS,), **hdf5plugin.Blosc("zstd", 1)
            )
            stored.attrs.update(attributes)
            for start in range(0, EVENTS, ROWS):
                stored[start : start + ROWS] = np.full(ROWS, timestamp_us(start) if name == "t" else 0, dtype)
    return path


def timestamp_us(row: int) -> int:
    """Return the stamp of an event of ``more_events_than_int32_counts``."""
    return row // ROWS * (HOUR_US * ROWS // EVENTS)


def planned(path: Path) -> Prepared:
    """Scan the stamps of a file and cut its windows."""
    with open_sequence(path) as sequence:
        return prepare(sequence, MEMORY_BYTES)


def main(folder: Path) -> None:
    """Write both files, plan them, and print what that takes."""
    files: tuple[Callable[[Path], Path], ...] = (hour_of_all_streams, more_events_than_int32_counts)
    for write in files:
        path = write(folder / f"{write.__name__}.h5")
        started = time.process_time()
        ready = planned(path)
        spent_s = time.process_time() - started
        events = ready.facts.events
        print(f"{write.__name__}: {path.stat().st_size / 1e6:.0f} MB, {len(ready.spans)} windows, {spent_s:.1f} s")
        print(events)
        owned = [span.owned["events"] for span in ready.spans if "events" in span.owned]
        gaps = sum(before[1] != after[0] for before, after in pairwise(owned))
        print(f"events owned: {owned[0][0]} to {owned[-1][1]}, {gaps} gaps")


def _replace(file: h5py.File, name: str, values: np.ndarray) -> None:
    attributes = dict(file[name].attrs)
    del file[name]
    file.create_dataset(
        name, data=values, chunks=(min(len(values), 65536), *values.shape[1:]), compression="lzf"
    ).attrs.update(attributes)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
