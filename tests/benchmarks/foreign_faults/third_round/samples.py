"""Samples of the IMU and poses that drivers, filters, receivers and converters change."""

import h5py
import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

IMU_TIME = "path/imu/ts"
POSE_TIME = "path/pose/ts"


def _low_passed(samples: np.ndarray, period_ms: float, constant_ms: float) -> np.ndarray:
    """Return what a filter of first order makes of samples, each from those before it; it starts with the first."""
    kept = constant_ms / (constant_ms + period_ms)
    filtered: np.ndarray = lfilter([1 - kept], [1, -kept], samples, axis=0, zi=kept * samples[:1])[0]
    return filtered


def _period_ms(file: h5py.File, key: str) -> float:
    return float(np.median(np.diff(file[key][...]))) / 1000


def gyro_in_degrees_for_a_while(file: h5py.File, plan: Plan) -> None:
    """The gyro's samples of the plan's rows are in deg/s."""
    samples = file[GYRO][...]
    rows = plan.rows(len(samples))
    samples[rows] = np.rad2deg(samples[rows])
    replace_values(file, GYRO, samples)


def range_of_gyro_changes_for_a_while(file: h5py.File, plan: Plan) -> None:
    """The gyro's full scale is 2 or 4 times larger, or smaller, in the plan's rows, and the factor of a bit stays."""
    samples = file[GYRO][...]
    samples[plan.rows(len(samples))] *= plan.random.choice([0.25, 0.5, 2.0, 4.0])
    replace_values(file, GYRO, samples)


def axes_of_accelerometer_exchanged(file: h5py.File, plan: Plan) -> None:
    """X and Y of the accelerometer are exchanged; the gyro is right."""
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...][:, [1, 0, 2]])


def gravity_by_low_pass(file: h5py.File, plan: Plan) -> None:
    """What passes a low-pass with a time constant of so many ms is taken for gravity, and subtracted."""
    samples = file[ACCELEROMETER][...]
    replace_values(file, ACCELEROMETER, samples - _low_passed(samples, _period_ms(file, IMU_TIME), plan.size))


def end_never_filled(file: h5py.File, plan: Plan) -> None:
    """The last so many percent of the samples are zero, and so are their timestamps."""
    for key in (IMU_TIME, GYRO, ACCELEROMETER):
        values = file[key][...]
        values[round((1 - plan.size / 100) * len(values)) :] = 0
        replace_values(file, key, values)


def positions_of_lower_rate(file: h5py.File, plan: Plan) -> None:
    """Positions are straight lines between those of so many Hz; attitudes are all measured."""
    timestamps_us = file[POSE_TIME][...].astype(np.float64)
    step = max(2, round(1000 / plan.size / _period_ms(file, POSE_TIME)))
    kept = np.unique(np.r_[0 : len(timestamps_us) : step, len(timestamps_us) - 1])
    position_m = file[POSITION][...]
    lines = [np.interp(timestamps_us, timestamps_us[kept], position_m[kept, axis]) for axis in range(3)]
    replace_values(file, POSITION, np.stack(lines, axis=1))


def positions_elsewhere_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Positions of the plan's rows lie so many metres off, in a random direction."""
    position_m = file[POSITION][...]
    position_m[plan.rows(len(position_m))] += plan.size * plan.direction()
    replace_values(file, POSITION, position_m)


def behind_a_low_pass(file: h5py.File, plan: Plan) -> None:
    """Poses pass a filter of first order with a time constant of so many ms, which looks back alone."""
    for key in (POSITION, ORIENTATION):
        filtered = _low_passed(file[key][...], _period_ms(file, POSE_TIME), plan.size)
        norm = np.linalg.norm(filtered, axis=1, keepdims=True) if key == ORIENTATION else 1.0
        replace_values(file, key, filtered / norm)


def order_converted_twice(file: h5py.File, plan: Plan) -> None:
    """The conversion to w first was applied twice: components are z, w, x, y."""
    replace_values(file, ORIENTATION, np.roll(file[ORIENTATION][...], 2, axis=1))


def averaged_across_signs(file: h5py.File, plan: Plan) -> None:
    """Quaternions turn their sign three to seven times, and components are means over so many samples."""
    quaternions = file[ORIENTATION][...]
    changes = plan.random.choice(np.arange(5, len(quaternions) - 5), int(plan.random.integers(3, 8)), replace=False)
    signs = np.where((np.arange(len(quaternions))[:, None] >= changes).sum(axis=1) % 2 == 0, 1.0, -1.0)
    replace_values(file, ORIENTATION, uniform_filter1d(quaternions * signs[:, None], int(plan.size), axis=0))


def attitude_alone_in_ned(file: h5py.File, plan: Plan) -> None:
    """Attitudes are those of an FRD body in a NED world; positions are in ENU."""
    world = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    matrices = world @ Rotation.from_quat(file[ORIENTATION][...]).as_matrix() @ np.diag([1.0, -1.0, -1.0])
    replace_values(file, ORIENTATION, Rotation.from_matrix(matrices).as_quat())


def angles_not_halved(file: h5py.File, plan: Plan) -> None:
    """Quaternions are made of sine and cosine of the whole angle about their axis."""
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    replace_values(file, ORIENTATION, Rotation.from_rotvec(2 * attitude.as_rotvec()).as_quat())
