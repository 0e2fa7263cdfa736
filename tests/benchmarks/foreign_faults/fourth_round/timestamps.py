"""Timestamps that networks, queues, circuits, recorders and drivers change."""

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.events import TIME, keep_events, pixels_of, sensor_size, sort_events

COLOUR_TIME = "path/rgb_ts"
IMU_TIME = "path/imu/ts"


def at_random_times_between_frames(file: h5py.File, plan: Plan) -> None:
    """Events of a pixel between two colour frames come, in their order, at times that are drawn at random."""
    timestamps_us, frames_us = file[TIME][...], file[COLOUR_TIME][...]
    interval = np.clip(np.searchsorted(frames_us, timestamps_us, "left") - 1, 0, len(frames_us) - 2)
    group = interval * int(np.prod(sensor_size(file))) + pixels_of(file)
    share = 1 - plan.random.random(len(group))
    drawn_us = frames_us[interval] + np.ceil(share * (frames_us[interval + 1] - frames_us[interval])).astype(np.int64)
    times_us = np.empty_like(timestamps_us)
    times_us[np.argsort(group, kind="stable")] = drawn_us[np.lexsort([drawn_us, group])]
    replace_values(file, TIME, times_us)
    sort_events(file)


def pause_cut_out(file: h5py.File, plan: Plan) -> None:
    """Events of so many ms are absent, and all that follow are early by as much."""
    timestamps_us = file[TIME][...]
    begin_us = timestamps_us[0] + plan.begin * float(timestamps_us[-1] - timestamps_us[0])
    length_us = round(1000 * plan.size)
    after = timestamps_us >= begin_us + length_us
    replace_values(file, TIME, np.where(after, timestamps_us - length_us, timestamps_us))
    keep_events(file, after | (timestamps_us < begin_us))


def when_they_leave_a_queue(file: h5py.File, plan: Plan) -> None:
    """A queue passes so many percent of the mean rate, and an event carries the time at which it leaves.

    Events that have not left when the recording ends are lost.
    """
    timestamps_us = file[TIME][...]
    span_us = float(timestamps_us[-1] - timestamps_us[0])
    number = np.arange(len(timestamps_us))
    each_us = 100 * span_us / (plan.size * len(timestamps_us))
    left_us = each_us * (number + 1) + np.maximum.accumulate(timestamps_us - each_us * number)
    times_us = np.ceil(left_us).astype(np.int64)
    replace_values(file, TIME, times_us)
    keep_events(file, times_us <= timestamps_us[-1])


def _late_where(file: h5py.File, late: NDArray[np.bool_], late_us: int) -> None:
    """Delay some events, none beyond the last one, and sort all."""
    timestamps_us = file[TIME][...]
    replace_values(file, TIME, np.where(late, np.minimum(timestamps_us + late_us, timestamps_us[-1]), timestamps_us))
    sort_events(file)


def half_of_sensor_late_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time, events of the left half, or of the right one, are late by so many ms."""
    left = file["path/events/x"][...] < sensor_size(file)[0] / 2
    half = left if plan.random.random() < 0.5 else ~left
    _late_where(file, half & plan.times_us(file[TIME][...]), round(1000 * plan.size))


def darker_late(file: h5py.File, plan: Plan) -> None:
    """Darker events are late by so many ms."""
    _late_where(file, file["path/events/p"][...] == 0, round(1000 * plan.size))


def by_batch(file: h5py.File, plan: Plan) -> None:
    """Of so many colour frames in sequence, all carry the time of the last."""
    timestamps_us = file[COLOUR_TIME][...]
    count = int(plan.size)
    last = np.minimum(np.arange(len(timestamps_us)) // count * count + count - 1, len(timestamps_us) - 1)
    replace_values(file, COLOUR_TIME, timestamps_us[last])
    update_index_maps(file)


def centred_on_start(file: h5py.File, plan: Plan) -> None:
    """The middle of an interval of flow is the time at which it starts."""
    for key in KEYS:
        intervals_us = file[f"{key}_ts"][...]
        replace_values(file, f"{key}_ts", intervals_us - np.diff(intervals_us, axis=1) // 2)


def lost_and_renumbered(file: h5py.File, plan: Plan) -> None:
    """So many percent of the IMU's samples, anywhere, are absent, and timestamps are counted from those that are left.

    The first and the last sample are there.
    """
    timestamps_us = file[IMU_TIME][...]
    kept = plan.random.random(len(timestamps_us)) >= plan.size / 100
    kept[[0, -1]] = True
    keep_rows(file, "imu", np.flatnonzero(kept))
    replace_values(file, IMU_TIME, timestamps_us[: np.count_nonzero(kept)])
