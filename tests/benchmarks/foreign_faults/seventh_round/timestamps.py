"""Timestamps that recorders, texts and counters of frames stand for."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values, update_index_maps
from tests.benchmarks.foreign_faults import clocks
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.sixth_round.samples import POSE_TIME
from tests.benchmarks.foreign_faults.sixth_round.timestamps import COLOUR_TIME, DEPTH_TIME

HUNDREDTH_US: Final = 10_000


def depth_when_recorded(file: h5py.File, plan: Plan) -> None:
    """Times of depth are late by so many ms, and by a quarter of it more at random; frames stay in order."""
    timestamps_us = file[DEPTH_TIME][...]
    late_us = 1000 * plan.size * (1 + plan.random.exponential(0.25, len(timestamps_us)))
    replace_values(file, DEPTH_TIME, np.maximum.accumulate(timestamps_us + np.rint(late_us).astype(np.int64)))
    update_index_maps(file)


def depth_in_numbers_of_frames(file: h5py.File, plan: Plan) -> None:
    """Times of depth are 0, 1, 2 and so on."""
    replace_values(file, DEPTH_TIME, np.arange(len(file[DEPTH_TIME]), dtype=np.int64))
    update_index_maps(file)


def colour_numbered_from_1(file: h5py.File, plan: Plan) -> None:
    """Times of colour are the frame's number, counted from 1, times the period: late by a period."""
    timestamps_us = file[COLOUR_TIME][...]
    replace_values(file, COLOUR_TIME, timestamps_us + round(float(np.median(np.diff(timestamps_us)))))
    update_index_maps(file)


def pose_in_wall_time(file: h5py.File, plan: Plan) -> None:
    """Time passes so many times faster than in the simulation."""
    timestamps_us = file[POSE_TIME][...]
    elapsed_us = np.rint(plan.size * (timestamps_us - timestamps_us[0])).astype(np.int64)
    replace_values(file, POSE_TIME, timestamps_us[0] + elapsed_us)


def pose_in_hundredths(file: h5py.File, plan: Plan) -> None:
    """Times of poses were texts of seconds with two decimals."""
    hundredths = np.rint(file[POSE_TIME][...] / HUNDREDTH_US).astype(np.int64)
    replace_values(file, POSE_TIME, HUNDREDTH_US * hundredths)


def imu_and_pose_late(file: h5py.File, plan: Plan) -> None:
    """Both are late by the same so many ms."""
    for stream in ("imu", "pose"):
        clocks.delayed(stream)(file, plan)
