"""Timestamps that triggers, schedulers, text and networks change."""

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.events import TIME, sort_events

COLOUR_TIME = "path/rgb_ts"
POSE_TIME = "path/pose/ts"

WINDOWS_TICK_US = 15_625
"""Between two interrupts of the timer of Windows, by default: 64 a second."""

PACKET_US = 1_000
"""Length of a packet of events."""

LONGEST_EXPOSURE_MS = 19.0


def free_of_its_trigger(file: h5py.File, plan: Plan) -> None:
    """Timestamps of the plan's rows are late by so many ms: those of triggers by which no frame was taken."""
    timestamps_us = file[COLOUR_TIME][...]
    timestamps_us[plan.rows(len(timestamps_us))] += round(1000 * plan.size)
    replace_values(file, COLOUR_TIME, timestamps_us)
    update_index_maps(file)


def at_start_of_exposure(file: h5py.File, plan: Plan) -> None:
    """Timestamps are those at which an exposure began, of so many ms at the median brightness and less in light."""
    brightness = np.maximum(file["path/rgb"][...].mean(axis=(1, 2, 3)), 1.0)
    exposures_ms = np.minimum(plan.size * np.median(brightness) / brightness, LONGEST_EXPOSURE_MS)
    early_us = np.rint(500 * exposures_ms).astype(np.int64)
    replace_values(file, COLOUR_TIME, file[COLOUR_TIME][...] - early_us)
    update_index_maps(file)


def in_ticks_of_windows(file: h5py.File, plan: Plan) -> None:
    """A pose carries the time of the timer's latest interrupt."""
    timestamps_us = file[POSE_TIME][...]
    replace_values(file, POSE_TIME, timestamps_us - timestamps_us % WINDOWS_TICK_US)


def in_numbers_of_frames(file: h5py.File, plan: Plan) -> None:
    """Both ends of an interval are numbers of depth frames, counted from 0."""
    frames_us = file["path/depth_ts"][...]
    for key in KEYS:
        replace_values(file, f"{key}_ts", np.searchsorted(frames_us, file[f"{key}_ts"][...]).astype(np.int64))


def set_back(file: h5py.File, plan: Plan) -> None:
    """From an instant on the clock is behind by so many ms, and rows are sorted by what it says."""
    timestamps_us = file[POSE_TIME][...]
    late = np.arange(len(timestamps_us)) >= plan.rows(len(timestamps_us)).start
    replace_values(file, POSE_TIME, timestamps_us - np.where(late, round(1000 * plan.size), 0))
    keep_rows(file, "pose", np.argsort(file[POSE_TIME][...], kind="stable"))


def without_leading_zeros(file: h5py.File, plan: Plan) -> None:
    """Seconds and microseconds were written with a point between them, and no zeros before the latter."""
    whole, rest_us = np.divmod(file[POSE_TIME][...], 1_000_000)
    seconds = np.array([float(f"{second}.{us}") for second, us in zip(whole.tolist(), rest_us.tolist(), strict=True)])
    replace_values(file, POSE_TIME, np.rint(1e6 * seconds).astype(np.int64))


def packets_jitter(file: h5py.File, plan: Plan) -> None:
    """Events of a packet are all late, or early, by one time: at random, with a standard deviation of so many ms."""
    timestamps_us = file[TIME][...]
    packets = (timestamps_us - timestamps_us[0]) // PACKET_US
    moves_us = np.rint(plan.random.normal(0.0, 1000 * plan.size, int(packets[-1]) + 1)).astype(np.int64)
    moved_us = np.clip(timestamps_us + moves_us[packets], timestamps_us[0], timestamps_us[-1])
    replace_values(file, TIME, moved_us)
    sort_events(file)
