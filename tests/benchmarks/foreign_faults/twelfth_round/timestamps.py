"""Times that clocks, loggers and writers give wrongly, and samples that are lost, doubled or out of order."""

from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan, Plant
from tests.benchmarks.foreign_faults.paths import FLOW

COLOUR_TIME: Final = "path/rgb_ts"
IMU_TIME: Final = "path/imu/ts"
POSE_TIME: Final = "path/pose/ts"

MILLISECOND: Final = 1e-3
"""Units of time: of a millisecond, so many a microsecond."""

NANOSECOND: Final = 1e3


def _write_times(file: h5py.File, key: str, times_us: NDArray[Any]) -> None:
    replace_values(file, key, np.rint(times_us).astype(np.int64))


def poses_late(file: h5py.File, plan: Plan) -> None:
    """Times of all poses are so many ms too late."""
    _write_times(file, POSE_TIME, file[POSE_TIME][...] + 1000 * plan.size)


def imu_clock_fast_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's time the clock of the IMU gains so many ppm; it keeps what it has gained."""
    times_us = file[IMU_TIME][...].astype(np.float64)
    begin_us, end_us = times_us[0] + np.array([plan.begin, plan.end]) * (times_us[-1] - times_us[0])
    within_us = np.clip(times_us, begin_us, end_us) - begin_us
    _write_times(file, IMU_TIME, times_us + plan.size / 1e6 * within_us)


def colour_in_ticks(file: h5py.File, plan: Plan) -> None:
    """Times of colour are those of the last tick of a timer, which ticks every so many ms from any time on."""
    times_us = file[COLOUR_TIME][...].astype(np.float64)
    tick_us = 1000 * plan.size
    origin_us = times_us[0] - plan.random.uniform(0, tick_us)
    _write_times(file, COLOUR_TIME, origin_us + tick_us * np.floor((times_us - origin_us) / tick_us))
    update_index_maps(file)


def flow_times_in_another_unit(file: h5py.File, plan: Plan) -> None:
    """Starts and ends of all intervals of flow are in milliseconds or in nanoseconds."""
    per_us = plan.random.choice([MILLISECOND, NANOSECOND])
    for key in FLOW:
        _write_times(file, f"{key}_ts", file[f"{key}_ts"][...] * per_us)


def colour_dropped(file: h5py.File, plan: Plan) -> None:
    """So many colour frames in sequence are lost, with their times."""
    total, lost = len(file[COLOUR_TIME]), int(plan.size)
    first = 1 + round(plan.begin * (total - lost - 2))
    keep_rows(file, "rgb", np.delete(np.arange(total), np.s_[first : first + lost]))
    update_index_maps(file)


def depth_dropped(file: h5py.File, plan: Plan) -> None:
    """So many depth frames in sequence are lost, with their times."""
    total, lost = len(file["path/depth_ts"]), int(plan.size)
    first = 1 + round(plan.begin * (total - lost - 2))
    keep_rows(file, "depth", np.delete(np.arange(total), np.s_[first : first + lost]))
    update_index_maps(file)


def written_twice(stream: str, times: str) -> Plant:
    """Samples of the plan's rows are written twice, one behind the other, with the same time."""

    def plant(file: h5py.File, plan: Plan) -> None:
        rows = np.arange(len(file[times]))
        keep_rows(file, stream, np.sort(np.concatenate([rows, rows[plan.rows(len(rows))]])))

    return plant


def imu_batches_exchanged(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows the IMU is written in batches of so many samples, of each two the second one first."""
    places = np.arange(len(file[IMU_TIME]))
    rows = plan.rows(len(places))
    batches = (places[rows] - rows.start) // int(plan.size)
    places[rows] = places[rows][np.argsort(batches ^ 1, kind="stable")]
    keep_rows(file, "imu", places)


def poses_end_early(file: h5py.File, plan: Plan) -> None:
    """The last so many percent of the poses are absent."""
    total = len(file[POSE_TIME])
    keep_rows(file, "pose", np.arange(total - max(1, round(plan.size / 100 * total))))
