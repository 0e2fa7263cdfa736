"""Samples of the IMU and poses that phones, buses, receivers, trackers and converters change."""

from typing import Final

import h5py
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

POSE_TIME: Final = "path/pose/ts"

METRES_PER_FOOT: Final = 0.3048

EARTH_RADIUS_M: Final = 6_371_000.0


def gravity_removed_for_a_while(file: h5py.File, plan: Plan) -> None:
    """The accelerometer's samples of the plan's rows lack the specific force of gravity."""
    timestamps_us = file[POSE_TIME][...].astype(np.float64)
    attitude = Slerp(timestamps_us, Rotation.from_quat(file[ORIENTATION][...]))
    samples = file[ACCELEROMETER][...]
    rows = plan.rows(len(samples))
    at = attitude(np.clip(file["path/imu/ts"][...][rows].astype(np.float64), timestamps_us[0], timestamps_us[-1]))
    samples[rows] -= at.inv().apply([0.0, 0.0, float(file["metadata/imu"].attrs["gravity"])])
    replace_values(file, ACCELEROMETER, samples)


def reads_fail(file: h5py.File, plan: Plan) -> None:
    """So many percent of the samples of both sensors, at least one, anywhere, are not a number."""
    count = len(file[GYRO])
    failed = plan.random.random(count) < plan.size / 100
    failed[int(plan.random.integers(count))] = True
    for key in (GYRO, ACCELEROMETER):
        replace_values(file, key, np.where(failed[:, None], np.nan, file[key][...]))


def densities_and_walks_exchanged(file: h5py.File, plan: Plan) -> None:
    """What is declared as density of noise is the walk of the bias, and the reverse."""
    attributes = file["metadata/imu"].attrs
    for sensor in ("gyro", "accel"):
        density, walk = f"{sensor}_noise_density", f"{sensor}_bias_walk"
        attributes[density], attributes[walk] = attributes[walk], attributes[density]


def yaw_through_its_jump(file: h5py.File, plan: Plan) -> None:
    """Yaw, pitch and roll are straight lines between those of so many Hz.

    Yaw is an angle from 0 to 360 degrees, which jumps where the vehicle looks in its mean direction; a line across
    the jump leads the other way round.
    """
    timestamps_us = file[POSE_TIME][...].astype(np.float64)
    step = max(2, round(1e6 / plan.size / float(np.median(np.diff(timestamps_us)))))
    kept = np.unique(np.r_[0 : len(timestamps_us) : step, len(timestamps_us) - 1])
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    forward = attitude[kept].apply([1.0, 0.0, 0.0])
    headings = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))
    north = Rotation.from_euler("z", (headings.min() + headings.max()) / 2)
    angles = (north.inv() * attitude[kept]).as_euler("ZYX")
    angles[:, 0] %= 2 * np.pi
    lines = [np.interp(timestamps_us, timestamps_us[kept], angles[:, axis]) for axis in range(3)]
    replace_values(file, ORIENTATION, (north * Rotation.from_euler("ZYX", np.stack(lines, axis=1))).as_quat())


def attitude_noisy_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Attitudes of the plan's rows have white noise of so many mrad about each axis."""
    quaternions = file[ORIENTATION][...]
    rows = plan.rows(len(quaternions))
    noise = Rotation.from_rotvec(plan.random.normal(0.0, plan.size / 1000, (rows.stop - rows.start, 3)))
    quaternions[rows] = (Rotation.from_quat(quaternions[rows]) * noise).as_quat()
    replace_values(file, ORIENTATION, quaternions)


def from_the_centre_of_the_earth(file: h5py.File, plan: Plan) -> None:
    """The world's axes are those of the earth: Z to the north pole, X to the meridian of Greenwich on the equator."""
    longitude, latitude = plan.random.uniform(-np.pi, np.pi), np.deg2rad(plan.random.uniform(25, 60))
    up = [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    east = [-np.sin(longitude), np.cos(longitude), 0.0]
    world = Rotation.from_matrix(np.stack([east, np.cross(up, east), up], axis=1))
    replace_values(file, POSITION, world.apply(file[POSITION][...]) + EARTH_RADIUS_M * np.array(up))
    replace_values(file, ORIENTATION, (world * Rotation.from_quat(file[ORIENTATION][...])).as_quat())


def quaternions_reversed(file: h5py.File, plan: Plan) -> None:
    """Components are w, z, y, x."""
    replace_values(file, ORIENTATION, np.ascontiguousarray(file[ORIENTATION][...][:, ::-1]))


def height_in_feet(file: h5py.File, plan: Plan) -> None:
    """The height is in feet, and the place on the ground in metres."""
    replace_values(file, POSITION, file[POSITION][...] / np.array([1.0, 1.0, METRES_PER_FOOT]))


def roll_and_pitch_exchanged(file: h5py.File, plan: Plan) -> None:
    """Roll is taken for pitch, and the reverse."""
    angles = Rotation.from_quat(file[ORIENTATION][...]).as_euler("ZYX")
    replace_values(file, ORIENTATION, Rotation.from_euler("ZYX", angles[:, [0, 2, 1]]).as_quat())


def variances_of_noise(file: h5py.File, plan: Plan) -> None:
    """Variances are declared as standard deviations of the pose's noise."""
    attributes = file["metadata/pose"].attrs
    for name in ("position_sigma", "rotation_sigma"):
        attributes[name] = attributes[name] ** 2


def attitude_left_out(file: h5py.File, plan: Plan) -> None:
    """Attitudes are absent; positions and timestamps are there."""
    del file[ORIENTATION]
