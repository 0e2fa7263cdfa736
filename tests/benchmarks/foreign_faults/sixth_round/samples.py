"""Samples of the IMU, and poses, that simulators, trackers, tuning and converters change."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults import inertial
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

IMU_TIME: Final = "path/imu/ts"
POSE_TIME: Final = "path/pose/ts"

MISREPORTED: Final = (3, 8)
"""Least and greatest number of poses in sequence that a tracker misreports."""


def attitudes(file: h5py.File) -> Rotation:
    """Return the attitude at each sample of the IMU."""
    timestamps_us = file[POSE_TIME][...].astype(np.float64)
    instants_us = np.clip(file[IMU_TIME][...].astype(np.float64), timestamps_us[0], timestamps_us[-1])
    return Slerp(timestamps_us, Rotation.from_quat(file[ORIENTATION][...]))(instants_us)


def gravity_of_the_sensor(file: h5py.File, plan: Plan) -> None:
    """Specific force is of a gravity larger than the declared one by so many m/s^2."""
    inertial.with_gravity(plan.size / float(file["metadata/imu"].attrs["gravity"]))(file, plan)


def gravity_alone(file: h5py.File, plan: Plan) -> None:
    """The accelerometer measures gravity, and no acceleration."""
    upwards = [0.0, 0.0, float(file["metadata/imu"].attrs["gravity"])]
    replace_values(file, ACCELEROMETER, attitudes(file).inv().apply(upwards))


def velocity_differenced_in_the_body(file: h5py.File, plan: Plan) -> None:
    """Acceleration is the change of the velocity's components along the body: rate x velocity is absent."""
    timestamps_us = file[POSE_TIME][...].astype(np.float64)
    velocity = np.gradient(file[POSITION][...], timestamps_us / 1e6, axis=0)
    instants_us = file[IMU_TIME][...].astype(np.float64)
    at = np.stack([np.interp(instants_us, timestamps_us, velocity[:, axis]) for axis in range(3)], axis=1)
    transport = np.cross(file[GYRO][...], attitudes(file).inv().apply(at))
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] - transport)


def densities_of_samples(file: h5py.File, plan: Plan) -> None:
    """Declared densities are deviations of single samples; declared walks are those from sample to sample."""
    attributes = file["metadata/imu"].attrs
    root = np.sqrt(1e6 / float(np.median(np.diff(file[IMU_TIME][...]))))
    for sensor in ("gyro", "accel"):
        attributes[f"{sensor}_noise_density"] = attributes[f"{sensor}_noise_density"] * root
        attributes[f"{sensor}_bias_walk"] = attributes[f"{sensor}_bias_walk"] / root


def quaternions_moved_round(file: h5py.File, plan: Plan) -> None:
    """Components are y, z, w, x."""
    replace_values(file, ORIENTATION, np.ascontiguousarray(np.roll(file[ORIENTATION][...], -1, axis=1)))


def _inner_rows(plan: Plan, count: int) -> slice:
    """Return the plan's rows, at least one, without the first and the last of all."""
    rows = plan.rows(count)
    begin = min(max(1, rows.start), count - 2)
    return slice(begin, max(begin + 1, min(rows.stop, count - 1)))


def poses_lost_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Poses of the plan's rows are absent."""
    count = len(file[POSE_TIME])
    kept = np.ones(count, dtype=bool)
    kept[_inner_rows(plan, count)] = False
    keep_rows(file, "pose", np.flatnonzero(kept))


def straight_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Poses of the plan's rows are on a straight line between those before and behind them."""
    timestamps_us = file[POSE_TIME][...].astype(np.float64)
    rows = _inner_rows(plan, len(timestamps_us))
    ends = [rows.start - 1, rows.stop]
    position, quaternions = file[POSITION][...], file[ORIENTATION][...]
    for axis in range(3):
        position[rows, axis] = np.interp(timestamps_us[rows], timestamps_us[ends], position[ends, axis])
    turned = Slerp(timestamps_us[ends], Rotation.from_quat(quaternions[ends]))(timestamps_us[rows]).as_quat()
    # q and -q are the same attitude: the sign of the row before is kept.
    signs = np.where(np.sum(turned * quaternions[rows.start - 1], axis=1) < 0, -1.0, 1.0)
    quaternions[rows] = turned * signs[:, None]
    replace_values(file, POSITION, position)
    replace_values(file, ORIENTATION, quaternions)


def poses_not_a_number(file: h5py.File, plan: Plan) -> None:
    """So many poses, anywhere, are not a number."""
    count = len(file[POSE_TIME])
    rows = plan.random.choice(count, int(plan.size), replace=False)
    for key in (POSITION, ORIENTATION):
        values = file[key][...]
        values[rows] = np.nan
        replace_values(file, key, values)


def noisy_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Poses of the plan's rows have white noise of so many mm, and of as many tenths of a mrad."""
    position, quaternions = file[POSITION][...], file[ORIENTATION][...]
    rows = plan.rows(len(position))
    shape = (rows.stop - rows.start, 3)
    position[rows] += plan.random.normal(0.0, plan.size / 1000, shape)
    noise: NDArray[np.float64] = plan.random.normal(0.0, plan.size / 10_000, shape)
    quaternions[rows] = (Rotation.from_quat(quaternions[rows]) * Rotation.from_rotvec(noise)).as_quat()
    replace_values(file, POSITION, position)
    replace_values(file, ORIENTATION, quaternions)


def misreported_now_and_then(file: h5py.File, plan: Plan) -> None:
    """Within the plan's rows, once or twice, three to eight poses in sequence are so many metres off."""
    position = file[POSITION][...]
    rows = _inner_rows(plan, len(position))
    for _ in range(int(plan.random.integers(1, 3))):
        length = min(int(plan.random.integers(MISREPORTED[0], MISREPORTED[1] + 1)), rows.stop - rows.start)
        begin = int(plan.random.integers(rows.start, rows.stop - length + 1))
        position[begin : begin + length] += plan.size * plan.direction()
    replace_values(file, POSITION, position)
