"""Samples of the IMU, and poses, that converters, tables, texts and simulators change."""

from typing import Final

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.sixth_round.samples import IMU_TIME, POSE_TIME

CENTIMETRES_PER_METRE: Final = 100


def rates_of_yaw_first(file: h5py.File, plan: Plan) -> None:
    """The gyro's components are those about Z, Y and X."""
    replace_values(file, GYRO, np.ascontiguousarray(file[GYRO][...][:, ::-1]))


def in_half_precision(file: h5py.File, plan: Plan) -> None:
    """Samples of both sensors were float16."""
    for key in (GYRO, ACCELEROMETER):
        replace_values(file, key, file[key][...].astype(np.float16).astype(np.float64))


def without_partners(file: h5py.File, plan: Plan) -> None:
    """Of each so many samples in sequence, the first alone has values of the accelerometer."""
    samples = file[ACCELEROMETER][...]
    samples[np.arange(len(samples)) % int(plan.size) != 0] = np.nan
    replace_values(file, ACCELEROMETER, samples)


def in_frd_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows both sensors have X forward, Y right and Z down."""
    for key in (GYRO, ACCELEROMETER):
        samples = file[key][...]
        samples[plan.rows(len(samples))] *= np.array([1.0, -1.0, -1.0])
        replace_values(file, key, samples)


def buffer_read_backwards(file: h5py.File, plan: Plan) -> None:
    """The plan's rows are stored with the last of them first."""
    order = np.arange(len(file[IMU_TIME]))
    rows = plan.rows(len(order))
    order[rows] = order[rows][::-1].copy()
    keep_rows(file, "imu", order)


def position_in_ned(file: h5py.File, plan: Plan) -> None:
    """Positions are north, east and down; attitudes are right."""
    replace_values(file, POSITION, file[POSITION][...][:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0]))


def quaternions_of_two_decimals(file: h5py.File, plan: Plan) -> None:
    """Components were text with two decimals."""
    replace_values(file, ORIENTATION, np.round(file[ORIENTATION][...], 2))


def of_ticks_before(file: h5py.File, plan: Plan) -> None:
    """Poses are those of so many samples before; the first one repeats."""
    for key in (POSITION, ORIENTATION):
        values = file[key][...]
        replace_values(file, key, values[np.maximum(np.arange(len(values)) - int(plan.size), 0)])


def flight_begins_again(file: h5py.File, plan: Plan) -> None:
    """From an instant on, in the inner part of the file, poses are those from the beginning on."""
    for key in (POSITION, ORIENTATION):
        values = file[key][...]
        begin = round((0.3 + 0.6 * plan.begin) * len(values))
        values[begin:] = values[: len(values) - begin].copy()
        replace_values(file, key, values)


def overlap_of_two_files(file: h5py.File, plan: Plan) -> None:
    """The plan's rows are at the end of a first and at the beginning of a second file, which are joined."""
    count = len(file[POSE_TIME])
    rows = plan.rows(count)
    keep_rows(file, "pose", np.r_[0 : rows.stop, rows.start : count])


def inverted_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Quaternions of the plan's rows lead from the world to the body."""
    quaternions = file[ORIENTATION][...]
    quaternions[plan.rows(len(quaternions)), :3] *= -1
    replace_values(file, ORIENTATION, quaternions)


def in_centimetres_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Positions of the plan's rows are in centimetres."""
    position = file[POSITION][...]
    position[plan.rows(len(position))] *= CENTIMETRES_PER_METRE
    replace_values(file, POSITION, position)


def way_in_body_axes(file: h5py.File, plan: Plan) -> None:
    """Positions are sums of steps along the axes of the body, which nothing turns into the world."""
    position = file[POSITION][...]
    attitude = Rotation.from_quat(file[ORIENTATION][...][:-1])
    position[1:] = position[0] + np.cumsum(attitude.inv().apply(np.diff(position, axis=0)), axis=0)
    replace_values(file, POSITION, position)
