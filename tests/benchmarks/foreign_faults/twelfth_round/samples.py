"""Samples of the IMU that drivers, conversions and sensors spoil."""

import h5py
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan, Plant
from tests.benchmarks.foreign_faults.poses import ORIENTATION


def in_few_codes(file: h5py.File, plan: Plan) -> None:
    """Samples of each sensor are rounded to a step of so many percent of the range from its least to its greatest."""
    for key in (GYRO, ACCELEROMETER):
        values = file[key][...]
        least = values.min()
        step = plan.size / 100 * (values.max() - least)
        replace_values(file, key, least + step * np.rint((values - least) / step))


def rates_in_degrees(file: h5py.File, plan: Plan) -> None:
    """Angular velocities are in deg/s."""
    replace_values(file, GYRO, np.rad2deg(file[GYRO][...]))


def _add_gravity(file: h5py.File, gravity_m_s2: float) -> None:
    """Add what a gravity of that size gives as specific force: it points upwards, in the axes of the body."""
    times_us = file["path/pose/ts"][...].astype(np.float64)
    attitudes = Slerp(times_us, Rotation.from_quat(file[ORIENTATION][...]))
    at_us = np.clip(file["path/imu/ts"][...].astype(np.float64), times_us[0], times_us[-1])
    # f = R_body_world (a - g), and g is (0, 0, -gravity) in the world.
    upwards = attitudes(at_us).inv().apply([0.0, 0.0, gravity_m_s2])
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] + upwards)


def _declared_gravity(file: h5py.File) -> float:
    return float(file["metadata/imu"].attrs["gravity"])


def without_gravity(file: h5py.File, plan: Plan) -> None:
    """The accelerometer measures acceleration alone."""
    _add_gravity(file, -_declared_gravity(file))


def with_gravity_downwards(file: h5py.File, plan: Plan) -> None:
    """Gravity is added to acceleration where it should be subtracted."""
    _add_gravity(file, -2 * _declared_gravity(file))


def with_another_gravity(file: h5py.File, plan: Plan) -> None:
    """Gravity is too large by so many m/s^2."""
    _add_gravity(file, plan.size)


def with_bias(key: str) -> Plant:
    """All samples have the same error of that size, in any direction."""

    def plant(file: h5py.File, plan: Plan) -> None:
        replace_values(file, key, file[key][...] + plan.size * plan.direction())

    return plant


def not_finite_for_a_while(file: h5py.File, plan: Plan) -> None:
    """So many samples within the plan's rows are not a number, of both sensors."""
    rows = np.arange(len(file[GYRO]))[plan.rows(len(file[GYRO]))]
    rows = plan.random.choice(rows, min(int(plan.size), len(rows)), replace=False)
    for key in (GYRO, ACCELEROMETER):
        values = file[key][...]
        values[rows] = np.nan
        replace_values(file, key, values)


def in_single_precision(file: h5py.File, plan: Plan) -> None:
    """Samples of both sensors are stored as float32."""
    for key in (GYRO, ACCELEROMETER):
        replace_values(file, key, file[key][...].astype(np.float32))
