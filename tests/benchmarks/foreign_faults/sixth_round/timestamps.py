"""Timestamps of events, frames, the IMU and poses that simulators, decoders, drivers and converters change."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.events import TIME, sort_events

COLOUR_TIME: Final = "path/rgb_ts"
DEPTH_TIME: Final = "path/depth_ts"
IMU_TIME: Final = "path/imu/ts"

LOW_WORD_US: Final = 4096
"""Range of the low word of a time in EVT 3.0: 12 bits."""

COUNTER_US: Final = 1 << 23
"""After which the observed counter begins again."""

NANOSECONDS_PER_US: Final = 1000


def squeezed_towards_the_end(file: h5py.File, plan: Plan) -> None:
    """Events are early by so many ms at the first colour frame, by less later, and right at the last frame."""
    timestamps_us = file[TIME][...].astype(np.float64)
    first_us, last_us = (float(timestamp_us) for timestamp_us in file[COLOUR_TIME][[0, -1]])
    early_us = 1000 * plan.size * (last_us - timestamps_us) / (last_us - first_us)
    replace_values(file, TIME, np.rint(timestamps_us - early_us).astype(np.int64))
    sort_events(file)


def of_the_next_render(file: h5py.File, plan: Plan) -> None:
    """All events between two renders, which are so many ms apart, have the time of the second one."""
    first_us, step_us = float(file[COLOUR_TIME][0]), 1000 * plan.size
    renders = np.ceil((file[TIME][...] - first_us) / step_us)
    replace_values(file, TIME, np.rint(first_us + renders * step_us).astype(np.int64))
    sort_events(file)


def counter_begins_again(file: h5py.File, plan: Plan) -> None:
    """From an instant on, times are 2^23 us too early; nothing is sorted, and the maps were made before."""
    timestamps_us = file[TIME][...]
    share = plan.random.uniform(0.1, 0.9)
    instant_us = timestamps_us[0] + share * (timestamps_us[-1] - timestamps_us[0])
    replace_values(file, TIME, timestamps_us - np.where(timestamps_us >= instant_us, COUNTER_US, 0))


def first_high_word_subtracted(file: h5py.File, plan: Plan) -> None:
    """Events are early by so many ranges of the low word."""
    replace_values(file, TIME, file[TIME][...] - int(plan.size) * LOW_WORD_US)
    update_index_maps(file)


def low_word_constant(file: h5py.File, plan: Plan) -> None:
    """The low word of all events is the same."""
    constant_us = int(plan.random.integers(LOW_WORD_US))
    replace_values(file, TIME, file[TIME][...] // LOW_WORD_US * LOW_WORD_US + constant_us)
    sort_events(file)


def in_single_precision(file: h5py.File, plan: Plan) -> None:
    """Times were float32 microseconds of a clock that began so many seconds before the file."""
    before_us = round(1e6 * plan.size)
    rounded = (file[TIME][...] + before_us).astype(np.float32).astype(np.int64)
    replace_values(file, TIME, rounded - before_us)
    sort_events(file)


def events_in_nanoseconds(file: h5py.File, plan: Plan) -> None:
    """Times of events are in nanoseconds."""
    replace_values(file, TIME, file[TIME][...] * NANOSECONDS_PER_US)
    update_index_maps(file)


def origin_added_again(file: h5py.File, plan: Plan) -> None:
    """Events are late by the time of the clock at the beginning, so many seconds."""
    replace_values(file, TIME, file[TIME][...] + round(1e6 * plan.size))
    update_index_maps(file)


def colour_scatters(file: h5py.File, plan: Plan) -> None:
    """Times of colour frames have white noise of so many ms, and frames stay in order."""
    timestamps_us = file[COLOUR_TIME][...]
    noise_us = np.rint(plan.random.normal(0.0, 1000 * plan.size, len(timestamps_us))).astype(np.int64)
    replace_values(file, COLOUR_TIME, np.sort(timestamps_us + noise_us))
    update_index_maps(file)


def depth_early(file: h5py.File, plan: Plan) -> None:
    """Depth is of so many ms after its time, which is that of the request before it."""
    replace_values(file, DEPTH_TIME, file[DEPTH_TIME][...] - round(1000 * plan.size))
    update_index_maps(file)


def imu_back_dated(file: h5py.File, plan: Plan) -> None:
    """Times of the IMU are so many ms too early."""
    replace_values(file, IMU_TIME, file[IMU_TIME][...] - round(1000 * plan.size))


def imu_time_twice(file: h5py.File, plan: Plan) -> None:
    """The time since the beginning is added to a time that goes on as well: it passes twice as fast."""
    timestamps_us = file[IMU_TIME][...]
    replace_values(file, IMU_TIME, 2 * timestamps_us - timestamps_us[0])


def imu_time_of_the_sample_before(file: h5py.File, plan: Plan) -> None:
    """So many percent of the plan's samples, at least one and never the first, have the time of the one before."""
    timestamps_us = file[IMU_TIME][...]
    again = _some_rows(plan, len(timestamps_us))
    replace_values(file, IMU_TIME, np.where(again, np.r_[timestamps_us[0], timestamps_us[:-1]], timestamps_us))


def imu_scatters_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Times of the plan's samples have white noise of so many ms, and samples stay in order."""
    timestamps_us = file[IMU_TIME][...]
    rows = plan.rows(len(timestamps_us))
    noise_us = np.rint(plan.random.normal(0.0, 1000 * plan.size, rows.stop - rows.start)).astype(np.int64)
    limits = timestamps_us[rows][[0, -1]]
    timestamps_us[rows] = np.sort(np.clip(timestamps_us[rows] + noise_us, *limits))
    replace_values(file, IMU_TIME, timestamps_us)


def last_depth_frame_again(file: h5py.File, plan: Plan) -> None:
    """In place of so many percent of the plan's frames, the frame before occurs again, with its time."""
    again = _some_rows(plan, len(file[DEPTH_TIME]))
    # Where several in sequence are lost, the last one before them occurs several times.
    source = np.maximum.accumulate(np.where(again, 0, np.arange(len(again))))
    keep_rows(file, "depth", source)
    update_index_maps(file)


def _some_rows(plan: Plan, count: int) -> NDArray[np.bool_]:
    """Return so many percent of the plan's rows, at least one and never the first of all, as a mask."""
    rows = plan.rows(count)
    begin = max(1, rows.start)
    stop = max(rows.stop, begin + 1)
    chosen = np.zeros(count, dtype=bool)
    chosen[begin:stop] = plan.random.random(stop - begin) < plan.size / 100
    chosen[int(plan.random.integers(begin, stop))] = True
    return chosen
