"""Samples of an IMU that drivers, engines and calibrations change."""

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan

STAMPS = "path/imu/ts"


def _attitude(file: h5py.File) -> Rotation:
    """Return the body in the world at each sample of the IMU."""
    stamps_us = file["path/pose/ts"][...].astype(np.float64)
    slerp = Slerp(stamps_us, Rotation.from_quat(file["path/pose/orientation"][...]))
    return slerp(np.clip(file[STAMPS][...].astype(np.float64), stamps_us[0], stamps_us[-1]))


def in_wall_clock_time(file: h5py.File, plan: Plan) -> None:
    """Stamps are of the computer's clock, and a simulated second takes so many times as long."""
    stamps_us = file[STAMPS][...]
    replace_values(file, STAMPS, stamps_us[0] + np.rint((stamps_us - stamps_us[0]) * plan.size).astype(np.int64))


def stamped_when_queue_is_read(file: h5py.File, plan: Plan) -> None:
    """The sensor's queue is read every so many samples, which all carry the time of the last of them."""
    stamps_us = file[STAMPS][...]
    count = int(plan.size)
    last = np.minimum(np.arange(len(stamps_us)) // count * count + count - 1, len(stamps_us) - 1)
    replace_values(file, STAMPS, stamps_us[last])


def lost_here_and_there(file: h5py.File, plan: Plan) -> None:
    """So many percent of the samples, anywhere but at both ends, are absent with their stamps."""
    total = len(file[STAMPS])
    kept = plan.random.random(total) >= plan.size / 100
    kept[[0, -1]] = True
    keep_rows(file, "imu", np.flatnonzero(kept))


def gravity_along_body(file: h5py.File, plan: Plan) -> None:
    """Gravity is subtracted from the body's Z axis, whatever the attitude is."""
    gravity = float(file["metadata/imu"].attrs["gravity"])
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] - np.array([0.0, 0.0, gravity]))


def accelerometer_negated(file: h5py.File, plan: Plan) -> None:
    """At rest, the accelerometer measures gravity, not what holds the body against it."""
    replace_values(file, ACCELEROMETER, -file[ACCELEROMETER][...])


def in_axes_of_unity(file: h5py.File, plan: Plan) -> None:
    """X points right, Y up and Z forward: the hand is the left one, so that angular velocity turns its sign."""
    axes = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] @ axes.T)
    replace_values(file, GYRO, -file[GYRO][...] @ axes.T)


def zeroed_on_a_slope(file: h5py.File, plan: Plan) -> None:
    """The mean of the first so many samples is taken for gravity on Z, and what it lacks is removed from all."""
    samples = file[ACCELEROMETER][...]
    level = np.array([0.0, 0.0, float(file["metadata/imu"].attrs["gravity"])])
    replace_values(file, ACCELEROMETER, samples - (samples[: int(plan.size)].mean(axis=0) - level))


def zeroed_in_motion(file: h5py.File, plan: Plan) -> None:
    """The mean of the gyro's first so many samples is taken for its bias, and removed from all."""
    samples = file[GYRO][...]
    replace_values(file, GYRO, samples - samples[: int(plan.size)].mean(axis=0))


def bias_walks(file: h5py.File, plan: Plan) -> None:
    """The gyro's bias is a random walk from zero, with a standard deviation of so many rad/s after a second."""
    seconds = np.diff(file[STAMPS][...], prepend=file[STAMPS][0]) / 1e6
    samples = file[GYRO][...]
    steps = plan.random.normal(0.0, plan.size, samples.shape) * np.sqrt(seconds)[:, None]
    replace_values(file, GYRO, samples + np.cumsum(steps, axis=0))


def noisy_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows, white noise of so many rad/s is added, and of ten times as many m/s^2."""
    for key, sigma in ((GYRO, plan.size), (ACCELEROMETER, 10 * plan.size)):
        samples = file[key][...]
        rows = plan.rows(len(samples))
        samples[rows] += plan.random.normal(0.0, sigma, samples[rows].shape)
        replace_values(file, key, samples)


def noise_declared(file: h5py.File, plan: Plan) -> None:
    """Noise densities of so many rad/s/sqrt(Hz), and ten times as many m/s^2/sqrt(Hz), are declared, not added."""
    attributes = file["metadata/imu"].attrs
    attributes["gyro_noise_density"] = np.float64(plan.size)
    attributes["accel_noise_density"] = np.float64(10 * plan.size)


def upsampled(file: h5py.File, plan: Plan) -> None:
    """Samples are straight lines between those of so many Hz."""
    stamps_us = file[STAMPS][...].astype(np.float64)
    step = max(2, round(1e6 / plan.size / float(np.median(np.diff(stamps_us)))))
    kept = np.unique(np.r_[0 : len(stamps_us) : step, len(stamps_us) - 1])
    for key in (GYRO, ACCELEROMETER):
        samples = file[key][...]
        lines = [np.interp(stamps_us, stamps_us[kept], samples[kept, axis]) for axis in range(3)]
        replace_values(file, key, np.stack(lines, axis=1))


def rates_of_angles(file: h5py.File, plan: Plan) -> None:
    """The gyro holds the rates of roll, pitch and yaw, whose axes are not at right angles."""
    _, pitch, roll = _attitude(file).as_euler("ZYX").T
    p, q, r = file[GYRO][...].T
    about_z = (q * np.sin(roll) + r * np.cos(roll)) / np.cos(pitch)
    rates = [p + about_z * np.sin(pitch), q * np.cos(roll) - r * np.sin(roll), about_z]
    replace_values(file, GYRO, np.stack(rates, axis=1))


def without_turning_of_velocity(file: h5py.File, plan: Plan) -> None:
    """Acceleration is the rate of the velocity's components in the body, which lacks omega x v."""
    pose_us, stamps_us = file["path/pose/ts"][...].astype(np.float64), file[STAMPS][...].astype(np.float64)
    velocity = np.gradient(file["path/pose/position"][...], pose_us / 1e6, axis=0)
    at = np.stack([np.interp(stamps_us, pose_us, velocity[:, axis]) for axis in range(3)], axis=1)
    in_body: NDArray[np.float64] = _attitude(file).inv().apply(at)
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] - np.cross(file[GYRO][...], in_body))


def gyro_wraps(file: h5py.File, plan: Plan) -> None:
    """Whole numbers overflow: beyond so many percent of the largest rate of its axis, a sample has the other sign."""
    samples = file[GYRO][...]
    limit = plan.size / 100 * np.abs(samples).max(axis=0)
    replace_values(file, GYRO, (samples + limit) % (2 * limit) - limit)
