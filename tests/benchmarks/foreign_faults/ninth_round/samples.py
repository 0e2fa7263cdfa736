"""Samples of the IMU, and poses, that tables, filters, drivers and trackers change."""

from typing import Final

import h5py
import numpy as np
from scipy.signal import lfilter, savgol_filter
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.sixth_round.samples import IMU_TIME, POSE_TIME

NED_FROM_ENU: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_FROM_FLU: Final = np.diag([1.0, -1.0, -1.0])

VELOCITY_STEPS: Final = 5
"""Poses before and behind, from which a tracker takes its velocity."""

KEYFRAME_RAD: Final = np.radians(3)

UNIT_Q14: Final = 2**14
UNIT_Q15: Final = 2**15


def outliers_removed(file: h5py.File, plan: Plan) -> None:
    """The so many percent of samples are left out that lie farthest, in deviations of an axis, from its mean."""
    samples = np.hstack([file[GYRO][...], file[ACCELEROMETER][...]])
    scores = np.max(np.abs(samples - samples.mean(axis=0)) / samples.std(axis=0), axis=1)
    keep_rows(file, "imu", np.flatnonzero(scores <= np.quantile(scores, 1 - plan.size / 100)))


def gyro_behind_a_high_pass(file: h5py.File, plan: Plan) -> None:
    """Rates are those behind a high-pass of the first order, of so many Hz, which begins at rest."""
    rates = file[GYRO][...]
    period_s = float(np.median(np.diff(file[IMU_TIME][...]))) / 1e6
    kept = np.exp(-2 * np.pi * plan.size * period_s)
    replace_values(file, GYRO, lfilter([kept, -kept], [1.0, -kept], rates - rates[0], axis=0))


def _attitude_at(file: h5py.File, instants_us: np.ndarray) -> Rotation:
    stamps_us = file[POSE_TIME][...].astype(np.float64)
    attitudes = Slerp(stamps_us, Rotation.from_quat(file[ORIENTATION][...]))
    return attitudes(np.clip(instants_us.astype(np.float64), stamps_us[0], stamps_us[-1]))


def gravity_removed_by_a_late_attitude(file: h5py.File, plan: Plan) -> None:
    """Gravity is taken off along the vertical of the attitude so many ms before."""
    attitude = _attitude_at(file, file[IMU_TIME][...] - 1000 * plan.size)
    gravity = attitude.inv().apply([0.0, 0.0, float(file["metadata/imu"].attrs["gravity"])])
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] - gravity)


def accelerometer_of_the_other_sign_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows all axes of the accelerometer have the other sign."""
    samples = file[ACCELEROMETER][...]
    samples[plan.rows(len(samples))] *= -1
    replace_values(file, ACCELEROMETER, samples)


def gap_of_the_imu_reindexed(file: h5py.File, plan: Plan) -> None:
    """So many samples in sequence, from the plan's first row on, have times and no values."""
    begin = plan.rows(len(file[IMU_TIME])).start
    for key in (GYRO, ACCELEROMETER):
        samples = file[key][...]
        samples[begin : min(begin + int(plan.size), len(samples) - 1)] = np.nan
        replace_values(file, key, samples)


def imu_by_differences_of_poses(file: h5py.File, plan: Plan) -> None:
    """Both sensors are differences of the poses of the file, fitted by parabolas within so many ms."""
    poses_us, instants_us = file[POSE_TIME][...], file[IMU_TIME][...]
    period_s = float(np.median(np.diff(poses_us))) / 1e6
    window = 2 * round(plan.size / 1000 / period_s / 2) + 1
    acceleration = savgol_filter(file[POSITION][...], window, 2, deriv=2, delta=period_s, axis=0)
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    steps = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / period_s
    rates = savgol_filter(steps, window, 2, axis=0)
    acceleration[:, 2] += float(file["metadata/imu"].attrs["gravity"])
    middles_us = (poses_us[1:] + poses_us[:-1]) / 2
    for key, times_us, values in (
        (GYRO, middles_us, rates),
        (ACCELEROMETER, poses_us, attitude.inv().apply(acceleration)),
    ):
        resampled = np.stack([np.interp(instants_us, times_us, axis) for axis in values.T], axis=1)
        replace_values(file, key, resampled)


def axis_of_the_gyro_in_another_range(file: h5py.File, plan: Plan) -> None:
    """One axis of the gyro is half, or twice, of what it was."""
    rates = file[GYRO][...]
    rates[:, plan.random.integers(3)] *= plan.random.choice([0.5, 2.0])
    replace_values(file, GYRO, rates)


def components_interpolated(file: h5py.File, plan: Plan) -> None:
    """Between attitudes of so many Hz, each component of the quaternion runs along a straight line."""
    times_us, quaternions = file[POSE_TIME][...], file[ORIENTATION][...]
    signs = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0, -1.0, 1.0)
    quaternions[1:] *= np.cumprod(signs)[:, None]
    instants_us = np.arange(times_us[0], times_us[-1], 1e6 / plan.size)
    knots = np.unique(np.r_[np.searchsorted(times_us, instants_us), len(times_us) - 1])
    between = [np.interp(times_us, times_us[knots], component[knots]) for component in quaternions.T]
    replace_values(file, ORIENTATION, np.stack(between, axis=1))


def predicted(file: h5py.File, plan: Plan) -> None:
    """Poses are those at which the vehicle is so many ms later, if it goes on as it does."""
    times_us, position = file[POSE_TIME][...], file[POSITION][...]
    ahead_s = plan.size / 1000
    rows = np.arange(len(times_us))
    before, after = np.maximum(rows - VELOCITY_STEPS, 0), np.minimum(rows + VELOCITY_STEPS, len(rows) - 1)
    velocity = (position[after] - position[before]) / ((times_us[after] - times_us[before]) / 1e6)[:, None]
    rates = np.stack([np.interp(times_us, file[IMU_TIME][...], rate) for rate in file[GYRO][...].T], axis=1)
    attitude = Rotation.from_quat(file[ORIENTATION][...]) * Rotation.from_rotvec(rates * ahead_s)
    replace_values(file, POSITION, position + velocity * ahead_s)
    replace_values(file, ORIENTATION, attitude.as_quat())


def of_keyframes(file: h5py.File, plan: Plan) -> None:
    """A pose is kept when the vehicle is so many metres, or 3 degrees, away from the last one that was kept."""
    position, attitude = file[POSITION][...], Rotation.from_quat(file[ORIENTATION][...])
    kept = [0]
    for row in range(1, len(position)):
        way_m = np.linalg.norm(position[row] - position[kept[-1]])
        if way_m >= plan.size or (attitude[kept[-1]].inv() * attitude[row]).magnitude() >= KEYFRAME_RAD:
            kept.append(row)
    keep_rows(file, "pose", np.array(kept))


def of_carla(file: h5py.File, plan: Plan) -> None:
    """Y of world and body points right, so that axes are left-handed; lengths are metres."""
    replace_values(file, POSITION, file[POSITION][...] * np.array([1.0, -1.0, 1.0]))
    # S R S with S = diag(1, -1, 1) turns about -S a where R turns about a.
    replace_values(file, ORIENTATION, file[ORIENTATION][...] * np.array([-1.0, 1.0, -1.0, 1.0]))


def in_ned_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows the world is north, east and down, and the body forward, right and down."""
    position, quaternions = file[POSITION][...], file[ORIENTATION][...]
    rows = plan.rows(len(position))
    position[rows] = position[rows] @ NED_FROM_ENU.T
    matrices = NED_FROM_ENU @ Rotation.from_quat(quaternions[rows]).as_matrix() @ FRD_FROM_FLU
    quaternions[rows] = Rotation.from_matrix(matrices).as_quat()
    replace_values(file, POSITION, position)
    replace_values(file, ORIENTATION, quaternions)


def position_stalls_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows the position is that of the row before them; the attitude goes on."""
    position = file[POSITION][...]
    rows = plan.rows(len(position))
    position[rows] = position[max(rows.start - 1, 0)]
    replace_values(file, POSITION, position)


def quaternions_of_other_fixed_point(file: h5py.File, plan: Plan) -> None:
    """Components were whole numbers of which 2^14 are 1, and are divided by 2^15."""
    replace_values(file, ORIENTATION, np.rint(file[ORIENTATION][...] * UNIT_Q14) / UNIT_Q15)
