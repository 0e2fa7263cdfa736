"""Samples of the IMU, and poses, in other axes, types and orders, or filtered and resampled."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.sixth_round.samples import IMU_TIME, POSE_TIME

OPTICAL_FROM_BODY: Final = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Rotation into X right, Y down, Z forward."""

BODY_FROM_BLENDER: Final = OPTICAL_FROM_BODY.T @ np.diag([1.0, -1.0, -1.0])
"""Rotation from a camera that looks along -Z, with Y upwards."""

Y_UP_FROM_Z_UP: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation of the world of glTF and FBX exporters."""


def _matrices(file: h5py.File) -> NDArray[np.float64]:
    """Return rotations (P, 3, 3), body to world."""
    return np.asarray(Rotation.from_quat(file[ORIENTATION][...]).as_matrix())


def _replace_matrices(file: h5py.File, matrices: NDArray[np.float64]) -> None:
    replace_values(file, ORIENTATION, Rotation.from_matrix(matrices).as_quat())


def attitude_of_blenders_camera(file: h5py.File, plan: Plan) -> None:
    """The attitude is that of a camera that looks along -Z, with Y upwards."""
    _replace_matrices(file, _matrices(file) @ BODY_FROM_BLENDER)


def _in_axes(file: h5py.File, turn: NDArray[np.float64]) -> None:
    """World and body are both turned in the same way."""
    _replace_matrices(file, turn @ _matrices(file) @ turn.T)
    replace_values(file, POSITION, file[POSITION][...] @ turn.T)


def y_upwards(file: h5py.File, plan: Plan) -> None:
    """World and body have Y where Z was, and Z where -Y was: Y upwards, right-handed."""
    _in_axes(file, Y_UP_FROM_Z_UP)


def in_camera_axes(file: h5py.File, plan: Plan) -> None:
    """World and body have X right, Y down and Z forward."""
    _in_axes(file, OPTICAL_FROM_BODY)


def of_the_gimbal(file: h5py.File, plan: Plan) -> None:
    """The attitude is that of a link pitched by so many degrees against the body."""
    turn = Rotation.from_euler("y", plan.size, degrees=True).as_matrix()
    _replace_matrices(file, _matrices(file) @ turn)


def attitude_of_lower_rate(file: h5py.File, plan: Plan) -> None:
    """Attitudes turn evenly between those of so many Hz; positions are right."""
    timestamps_us = file[POSE_TIME][...].astype(np.float64)
    step = max(2, round(1e6 / plan.size / float(np.median(np.diff(timestamps_us)))))
    kept = np.unique(np.r_[0 : len(timestamps_us) : step, len(timestamps_us) - 1])
    quaternions = file[ORIENTATION][...]
    turned = Slerp(timestamps_us[kept], Rotation.from_quat(quaternions[kept]))(timestamps_us).as_quat()
    # q and -q are the same attitude: the signs of the file are kept.
    signs = np.where(np.sum(turned * quaternions, axis=1) < 0, -1.0, 1.0)
    replace_values(file, ORIENTATION, turned * signs[:, None])


def position_in_half_precision(file: h5py.File, plan: Plan) -> None:
    """Positions were float16, so many metres from where they are."""
    offset_m = plan.size * np.sign(plan.direction())
    rounded = (file[POSITION][...] + offset_m).astype(np.float16).astype(np.float64)
    replace_values(file, POSITION, rounded - offset_m)


def pose_in_single_precision(file: h5py.File, plan: Plan) -> None:
    """Datasets of the pose are float32."""
    for key in (POSITION, ORIENTATION):
        replace_values(file, key, file[key][...].astype(np.float32))


def attitude_as_matrices(file: h5py.File, plan: Plan) -> None:
    """Attitudes are matrices (P, 3, 3)."""
    replace_values(file, ORIENTATION, _matrices(file))


def scalar_first_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Quaternions of the plan's rows are w, x, y, z."""
    quaternions = file[ORIENTATION][...]
    rows = plan.rows(len(quaternions))
    quaternions[rows] = np.roll(quaternions[rows], 1, axis=1)
    replace_values(file, ORIENTATION, quaternions)


def by_text_of_times(file: h5py.File, plan: Plan) -> None:
    """Samples are sorted by the text of their times, 10 before 9."""
    keep_rows(file, "imu", np.argsort(file[IMU_TIME][...].astype(str), kind="stable"))


def mean_taken_off(file: h5py.File, plan: Plan) -> None:
    """The mean of each axis of the accelerometer is subtracted."""
    samples = file[ACCELEROMETER][...]
    replace_values(file, ACCELEROMETER, samples - samples.mean(axis=0))


def decimated_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Of each so many of the plan's samples in sequence, the first alone is kept."""
    kept = np.ones(len(file[IMU_TIME]), dtype=bool)
    rows = plan.rows(len(kept))
    kept[rows] = np.arange(rows.stop - rows.start) % int(plan.size) == 0
    keep_rows(file, "imu", np.flatnonzero(kept))


def gyro_in_frd(file: h5py.File, plan: Plan) -> None:
    """The gyro alone has X forward, Y right and Z down."""
    replace_values(file, GYRO, file[GYRO][...] * np.array([1.0, -1.0, -1.0]))


def gyro_behind_a_low_pass(file: h5py.File, plan: Plan) -> None:
    """The gyro alone went through a low-pass of first order with a time constant of so many ms."""
    samples = file[GYRO][...]
    period_ms = float(np.median(np.diff(file[IMU_TIME][...]))) / 1000
    keep = np.exp(-period_ms / plan.size)
    # It has settled at the first sample.
    filtered, _ = lfilter([1 - keep], [1, -keep], samples, axis=0, zi=keep * samples[:1])
    replace_values(file, GYRO, filtered)
