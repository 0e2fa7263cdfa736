"""Samples of an IMU that are in another unit, frame or place, or of a worse sensor, than the file says."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan, Plant

GYRO: Final = "path/imu/angular_velocity"
ACCELEROMETER: Final = "path/imu/linear_acceleration"


def multiplied(key: str, factor: float) -> Plant:
    """Samples are in another unit."""

    def plant(file: h5py.File, plan: Plan) -> None:
        replace_values(file, key, file[key][...] * factor)

    return plant


def gained(key: str) -> Plant:
    """Samples are too large by so many percent."""

    def plant(file: h5py.File, plan: Plan) -> None:
        replace_values(file, key, file[key][...] * (1 + plan.size / 100))

    return plant


def biased(key: str) -> Plant:
    """A constant vector of that length, in a random direction, is added to the plan's rows."""

    def plant(file: h5py.File, plan: Plan) -> None:
        samples = file[key][...]
        samples[plan.rows(len(samples))] += plan.size * plan.direction()
        replace_values(file, key, samples)

    return plant


def noisy(key: str) -> Plant:
    """White noise of that standard deviation is added, and not declared."""

    def plant(file: h5py.File, plan: Plan) -> None:
        samples = file[key][...]
        replace_values(file, key, samples + plan.random.normal(0.0, plan.size, samples.shape))

    return plant


def saturated(file: h5py.File, plan: Plan) -> None:
    """The gyro measures no more than so many percent of what occurs on each axis."""
    samples = file[GYRO][...]
    limit = plan.size / 100 * np.abs(samples).max(axis=0)
    replace_values(file, GYRO, np.clip(samples, -limit, limit))


def in_axes(*rows: tuple[int, int, int]) -> Plant:
    """Both sensors are stored in other axes."""

    def plant(file: h5py.File, plan: Plan) -> None:
        for key in (GYRO, ACCELEROMETER):
            replace_values(file, key, file[key][...] @ np.array(rows, dtype=np.float64).T)

    return plant


def with_gravity(factor: float) -> Plant:
    """As many times the gravity's specific force is added: -1 removes it, -2 turns its sign."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = file["path/pose/ts"][...].astype(np.float64)
        attitude = Slerp(stamps_us, Rotation.from_quat(file["path/pose/orientation"][...]))
        at = attitude(np.clip(file["path/imu/ts"][...].astype(np.float64), stamps_us[0], stamps_us[-1]))
        upwards = np.array([0.0, 0.0, file["metadata/imu"].attrs["gravity"]])
        replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] + factor * at.inv().apply(upwards))

    return plant


def elsewhere(file: h5py.File, plan: Plan) -> None:
    """The IMU sits so many metres from the body's origin, in a random direction."""
    arm = plan.size * plan.direction()
    seconds = file["path/imu/ts"][...] / 1e6
    rate: NDArray[np.float64] = file[GYRO][...]
    force = np.cross(np.gradient(rate, seconds, axis=0), arm) + np.cross(rate, np.cross(rate, arm))
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] + force)


def gravity_declared(file: h5py.File, plan: Plan) -> None:
    """The declared gravity is too large by so many m/s^2."""
    attributes = file["metadata/imu"].attrs
    attributes["gravity"] = attributes["gravity"] + plan.size


def noise_declared(file: h5py.File, plan: Plan) -> None:
    """Declared noise densities of both sensors are so many times those of the samples, or the samples' those."""
    attributes = file["metadata/imu"].attrs
    factor = plan.size if plan.size > 0 else -1 / plan.size
    for name in ("gyro_noise_density", "accel_noise_density"):
        attributes[name] = attributes[name] * factor
