"""Faults of the pose stream, and the pose between its samples."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.metadata import declare_noise
from fedora_generator.faults.rows import edit, window_of
from fedora_generator.rotations import multiply_quaternions
from fedora_qa.conventions import US_PER_S

POSITION, ORIENTATION, TIMESTAMPS = "path/pose/position", "path/pose/orientation", "path/pose/ts"
METADATA: Final = "metadata/pose"

_X: Final = np.array([1.0, 0.0, 0.0])
_Q_NED_ENU: Final = np.array([[np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]])
_Q_FLU_FRD: Final = np.array([[1.0, 0.0, 0.0, 0.0]])


def axes_swapped(file: h5py.File, fault: Fault) -> None:
    """Exchange X and Y of the position."""
    edit(file[POSITION], window_of(file, "pose", fault), lambda positions: positions[:, [1, 0, 2]])


def frame_convention(file: h5py.File, fault: Fault) -> None:
    """Write north-east-down positions, and orientations of a body X forward, Y right, Z down in that world."""
    window = window_of(file, "pose", fault)
    edit(file[POSITION], window, lambda positions: positions[:, [1, 0, 2]] * [1.0, 1.0, -1.0])
    edit(
        file[ORIENTATION],
        window,
        lambda q: multiply_quaternions(multiply_quaternions(_Q_NED_ENU, q), _Q_FLU_FRD),
    )


def unit_mm_m(file: h5py.File, fault: Fault) -> None:
    """Multiply positions by the magnitude: 1000 writes millimetres."""
    factor = fault.magnitude_in("1")
    edit(file[POSITION], window_of(file, "pose", fault), lambda positions: positions * factor)


def quaternion_order(file: h5py.File, fault: Fault) -> None:
    """Write w, x, y, z."""
    edit(file[ORIENTATION], window_of(file, "pose", fault), lambda q: q[:, [3, 0, 1, 2]])


def quaternion_inverted(file: h5py.File, fault: Fault) -> None:
    """Write the rotation from world to body."""
    edit(file[ORIENTATION], window_of(file, "pose", fault), lambda q: q * [-1.0, -1.0, -1.0, 1.0])


def quaternion_not_unit(file: h5py.File, fault: Fault) -> None:
    """Make quaternions too long by the magnitude: 0.01 is a length of 1.01."""
    edit(file[ORIENTATION], window_of(file, "pose", fault), lambda q: q * (1 + fault.magnitude_in("1")))


def teleport(file: h5py.File, fault: Fault) -> None:
    """Jump along world X by the magnitude, at the start or in the middle; with a stop, jump back there."""
    window = window_of(file, "pose", fault)
    if fault.start_s is None:
        window = slice((window.start + window.stop) // 2, window.stop)
    jump_m = fault.magnitude_in("m") * _X
    edit(file[POSITION], window, lambda positions: positions + jump_m)


def lever_arm(file: h5py.File, fault: Fault) -> None:
    """Refer the position to a point forward of the body's origin by the magnitude."""
    window = window_of(file, "pose", fault)
    arm_body_m = fault.magnitude_in("m") * _X
    file[POSITION][window] = file[POSITION][window] + Rotation.from_quat(file[ORIENTATION][window]).apply(arm_body_m)


def interpolated_pose(file: h5py.File, fault: Fault) -> None:
    """Keep the poses of the lower rate given and interpolate the others, linearly and on the shortest arc."""
    window = window_of(file, "pose", fault)
    times_s = (file[TIMESTAMPS][window] - file[TIMESTAMPS][window.start]) / US_PER_S
    stride = round((len(times_s) - 1) / times_s[-1] / fault.magnitude_in("Hz")) if len(times_s) > 2 else 0
    if not 2 <= stride < len(times_s):
        raise FaultError(f"Expected a rate below the stream's own and above 1 / duration, got {fault.magnitude:g} Hz")
    knots = np.unique([*range(0, len(times_s), stride), len(times_s) - 1])
    positions_m, orientations = file[POSITION][window], Rotation.from_quat(file[ORIENTATION][window])
    file[POSITION][window] = np.stack(
        [np.interp(times_s, times_s[knots], positions_m[knots, axis]) for axis in range(3)], axis=-1
    )
    file[ORIENTATION][window] = Slerp(times_s[knots], orientations[knots])(times_s).as_quat()


def noise_misdeclared(file: h5py.File, fault: Fault) -> None:
    """Declare the noise of position and rotation too large by the magnitude."""
    declare_noise(file, METADATA, ("position_sigma", "rotation_sigma"), fault)


Floats = NDArray[np.float64]

_POSITION, _ORIENTATION, _TIMESTAMPS = "path/pose/position", "path/pose/orientation", "path/pose/ts"


def attitudes_at(file: h5py.File, times_us: NDArray[np.int64]) -> Rotation:
    """Body-to-world rotations (n), exact at the stream's timestamps, a cubic spline between, constant outside."""
    pose_us = _pose_timestamps(file)
    # q and -q are the same rotation: signs are turned so that neighbours are close, and the spline has no jumps.
    orientations_xyzw = file[_ORIENTATION][...]
    jumps = np.sum(orientations_xyzw[1:] * orientations_xyzw[:-1], axis=1) < 0
    signs = np.cumprod(np.where(np.concatenate([[False], jumps]), -1.0, 1.0), dtype=np.float64)
    spline = CubicSpline((pose_us - pose_us[0]) / US_PER_S, orientations_xyzw * signs[:, None])
    return Rotation.from_quat(spline((np.clip(times_us, pose_us[0], pose_us[-1]) - pose_us[0]) / US_PER_S))


def body_poses_at(file: h5py.File, times_us: NDArray[np.int64]) -> Floats:
    """``T_world_body`` (n, 4, 4), positions linear between the stream's timestamps."""
    pose_us = _pose_timestamps(file)
    T_world_body = np.tile(np.eye(4), (len(times_us), 1, 1))
    T_world_body[:, :3, :3] = attitudes_at(file, times_us).as_matrix()
    for axis, positions_m in enumerate(file[_POSITION][...].T):
        T_world_body[:, axis, 3] = np.interp(times_us - pose_us[0], pose_us - pose_us[0], positions_m)
    return T_world_body


def _pose_timestamps(file: h5py.File) -> NDArray[np.int64]:
    if _TIMESTAMPS not in file or len(file[_TIMESTAMPS]) < 2:
        raise FaultError("Expected at least two poses, which this fault is computed from, got fewer")
    timestamps_us: NDArray[np.int64] = file[_TIMESTAMPS][...]
    return timestamps_us
