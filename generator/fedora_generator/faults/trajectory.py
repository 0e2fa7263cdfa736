"""The pose stream of a file between its samples."""

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from fedora_generator.faults.fault import FaultError
from fedora_qa.conventions import US_PER_S

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
