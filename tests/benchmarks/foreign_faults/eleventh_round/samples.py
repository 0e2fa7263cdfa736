"""Samples of the IMU, and poses, that simulators, loggers, drivers and trackers change."""

from typing import Final

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.sixth_round.samples import IMU_TIME, attitudes

DIGITS: Final = 6
"""That C++ writes of a number by default."""

SAMPLES: Final = 4
"""Of which one is of the accelerometer, whose rate is a third of that of the gyro."""


def gravity_behind_the_rotation(file: h5py.File, plan: Plan) -> None:
    """Gravity is added to Z of the body, whatever its attitude; the rest of specific force is right."""
    upwards = np.array([0.0, 0.0, float(file["metadata/imu"].attrs["gravity"])])
    force = file[ACCELEROMETER][...]
    replace_values(file, ACCELEROMETER, force - attitudes(file).inv().apply(upwards) + upwards)


def gyro_in_the_world(file: h5py.File, plan: Plan) -> None:
    """Rates are along the axes of the world; specific force is along those of the body."""
    replace_values(file, GYRO, attitudes(file).apply(file[GYRO][...]))


def times_in_six_digits(file: h5py.File, plan: Plan) -> None:
    """Times were written with six digits, in seconds of a clock that began so many seconds before."""
    timestamps_us = file[IMU_TIME][...]
    before_s = float(np.rint(plan.size))
    seconds = timestamps_us / 1e6 + before_s
    step_s = 10.0 ** (np.floor(np.log10(seconds)) + 1 - DIGITS)
    written_us = np.rint(1e6 * (np.rint(seconds / step_s) * step_s - before_s))
    replace_values(file, IMU_TIME, written_us.astype(timestamps_us.dtype))


def vertical_force_noisy(file: h5py.File, plan: Plan) -> None:
    """Z of the accelerometer has white noise of that standard deviation, m/s^2."""
    force = file[ACCELEROMETER][...]
    force[:, 2] += plan.random.normal(0.0, plan.size, len(force))
    replace_values(file, ACCELEROMETER, force)


def accelerometers_messages_late(file: h5py.File, plan: Plan) -> None:
    """One of four samples is stored so many rows later, with its own time."""
    count = len(file[IMU_TIME])
    places = np.arange(count, dtype=np.float64)
    places[::SAMPLES] += plan.size + 0.5
    keep_rows(file, "imu", np.argsort(places, kind="stable"))


def held_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Samples of the plan's rows hold for so many ms each time."""
    timestamps_us = file[IMU_TIME][...]
    rows = plan.rows(len(timestamps_us))
    since_us = timestamps_us[rows] - timestamps_us[rows.start]
    holds = np.floor(since_us / (1000 * plan.size))
    sources = rows.start + np.searchsorted(holds, holds, "left")
    for key in (GYRO, ACCELEROMETER):
        values = file[key][...]
        values[rows] = values[sources]
        replace_values(file, key, values)


def exponents_lost(file: h5py.File, plan: Plan) -> None:
    """In so many poses, anywhere, the smallest component of the quaternion has lost its power of ten."""
    quaternions = file[ORIENTATION][...]
    rows = plan.random.choice(len(quaternions), int(plan.size), replace=False)
    smallest = np.argmin(np.abs(quaternions[rows]), axis=1)
    components = quaternions[rows, smallest]
    quaternions[rows, smallest] = components / 10.0 ** np.floor(np.log10(np.abs(components)))
    replace_values(file, ORIENTATION, quaternions)


def components_in_pairs(file: h5py.File, plan: Plan) -> None:
    """Components are x, -w, z, -y."""
    x, y, z, w = file[ORIENTATION][...].T
    replace_values(file, ORIENTATION, np.ascontiguousarray(np.stack([x, -w, z, -y], axis=1)))


def attitude_from_the_first(file: h5py.File, plan: Plan) -> None:
    """Attitudes are those since the first one; positions are as they were."""
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    replace_values(file, ORIENTATION, (attitude[0].inv() * attitude).as_quat())


def minus_infinity_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Poses of the plan's rows are minus infinity."""
    for key in (POSITION, ORIENTATION):
        values = file[key][...]
        values[plan.rows(len(values))] = -np.inf
        replace_values(file, key, values)


def without_the_heading(file: h5py.File, plan: Plan) -> None:
    """Attitudes are those of a body whose heading is 0."""
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    angles = attitude.as_euler("ZYX")
    angles[:, 0] = 0
    replace_values(file, ORIENTATION, Rotation.from_euler("ZYX", angles).as_quat())


def quaternions_of_zeros(file: h5py.File, plan: Plan) -> None:
    """All components are 0."""
    replace_values(file, ORIENTATION, np.zeros_like(file[ORIENTATION][...]))
