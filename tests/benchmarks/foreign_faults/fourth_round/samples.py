"""Samples of the IMU and poses that chips, receivers, controllers, trackers and planners change."""

import h5py
import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

POSE_TIME = "path/pose/ts"

COUNTS_PER_DEGREE = 16.4
"""Of an MPU-6050 with a range of 2000 deg/s."""

COUNTS_PER_G = 2048.0
"""Of an MPU-6050 with a range of 16 g."""

STANDARD_GRAVITY = 9.80665


def averaged_backwards(file: h5py.File, plan: Plan) -> None:
    """A sample is the mean of those of the last so many ms, with its own."""
    period_ms = float(np.median(np.diff(file["path/imu/ts"][...]))) / 1000
    count = max(2, round(plan.size / period_ms))
    for key in (GYRO, ACCELEROMETER):
        samples = file[key][...]
        # Before the first sample lies what it holds.
        padded = np.concatenate([np.repeat(samples[:1], count, axis=0), samples])
        replace_values(file, key, lfilter(np.full(count, 1 / count), 1.0, padded, axis=0)[count:])


def yaw_rate_clockwise(file: h5py.File, plan: Plan) -> None:
    """The gyro's Z counts clockwise as seen from above; X and Y are right."""
    replace_values(file, GYRO, file[GYRO][...] * np.array([1.0, 1.0, -1.0]))


def in_counts(file: h5py.File, plan: Plan) -> None:
    """Samples are whole numbers as a chip's registers hold them."""
    replace_values(file, GYRO, np.rint(np.rad2deg(file[GYRO][...]) * COUNTS_PER_DEGREE))
    replace_values(file, ACCELEROMETER, np.rint(file[ACCELEROMETER][...] / STANDARD_GRAVITY * COUNTS_PER_G))


def within_dead_band(file: h5py.File, plan: Plan) -> None:
    """A component of the gyro that is smaller than so many rad/s is zero."""
    samples = file[GYRO][...]
    replace_values(file, GYRO, np.where(np.abs(samples) < plan.size, 0.0, samples))


def densities_of_data_sheet(file: h5py.File, plan: Plan) -> None:
    """Declared densities are in deg/s and in millionths of g, per root of a hertz."""
    attributes = file["metadata/imu"].attrs
    attributes["gyro_noise_density"] = np.rad2deg(attributes["gyro_noise_density"])
    attributes["accel_noise_density"] = attributes["accel_noise_density"] / STANDARD_GRAVITY * 1e6


def of_setpoints(file: h5py.File, plan: Plan) -> None:
    """Poses are where the body would be in so many ms with its velocity."""
    seconds = file[POSE_TIME][...] / 1e6
    position_m, attitude = file[POSITION][...], Rotation.from_quat(file[ORIENTATION][...])
    velocity = np.gradient(position_m, seconds, axis=0)
    turns = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / np.diff(seconds)[:, None]
    rates = np.vstack([turns, turns[-1:]])
    ahead_s = plan.size / 1000
    replace_values(file, POSITION, position_m + ahead_s * velocity)
    replace_values(file, ORIENTATION, (attitude * Rotation.from_rotvec(ahead_s * rates)).as_quat())


def body_with_y_forward(file: h5py.File, plan: Plan) -> None:
    """The body's X points right, Y forward and Z up."""
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    replace_values(file, ORIENTATION, (attitude * Rotation.from_euler("z", -90, degrees=True)).as_quat())


def attitude_frozen_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Attitudes of the plan's rows are the one before them; positions go on."""
    quaternions = file[ORIENTATION][...]
    rows = plan.rows(len(quaternions))
    quaternions[rows] = quaternions[max(0, rows.start - 1)]
    replace_values(file, ORIENTATION, quaternions)


def base_stations_take_turns(file: h5py.File, plan: Plan) -> None:
    """Positions lie so many metres off, in a random direction, in every other part, each of 60 to 200 ms."""
    timestamps_us, position_m = file[POSE_TIME][...], file[POSITION][...]
    lengths_us = plan.random.integers(60_000, 200_000, 1 + int(timestamps_us[-1] - timestamps_us[0]) // 60_000)
    part = np.searchsorted(timestamps_us[0] + np.cumsum(lengths_us), timestamps_us, "right")
    position_m[part % 2 == 1] += plan.size * plan.direction()
    replace_values(file, POSITION, position_m)


def fast_turns_left_out(file: h5py.File, plan: Plan) -> None:
    """So many percent of the poses, those about which the body turns fastest, are absent; both ends are there."""
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    speed = (attitude[:-2].inv() * attitude[2:]).magnitude()
    kept = np.ones(len(attitude), dtype=bool)
    kept[1:-1] = speed < np.quantile(speed, 1 - plan.size / 100)
    keep_rows(file, "pose", np.flatnonzero(kept))


def at_the_origin_until_tracked(file: h5py.File, plan: Plan) -> None:
    """As many of the first poses as the plan has rows are zero, without a rotation."""
    position_m, quaternions = file[POSITION][...], file[ORIENTATION][...]
    rows = plan.rows(len(position_m))
    count = rows.stop - rows.start
    position_m[:count], quaternions[:count] = 0.0, [0.0, 0.0, 0.0, 1.0]
    replace_values(file, POSITION, position_m)
    replace_values(file, ORIENTATION, quaternions)


def rotation_noise_in_degrees(file: h5py.File, plan: Plan) -> None:
    """The declared noise of the rotation is in degrees."""
    attributes = file["metadata/pose"].attrs
    attributes["rotation_sigma"] = np.rad2deg(attributes["rotation_sigma"])


def attitude_of_yaw_alone(file: h5py.File, plan: Plan) -> None:
    """Roll and pitch are zero."""
    angles = Rotation.from_quat(file[ORIENTATION][...]).as_euler("ZYX")
    angles[:, 1:] = 0.0
    replace_values(file, ORIENTATION, Rotation.from_euler("ZYX", angles).as_quat())
