"""Optical flow that was computed from another camera, or from other poses, than those that are right."""

from dataclasses import dataclass, replace

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA, FLOW
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION


@dataclass(frozen=True, slots=True)
class Inputs:
    """From what flow is computed, apart from depth.

    Attributes
    ----------
    K
        Of the depth camera.
    T_body_camera
        Of the depth camera.
    times_us
        Of the poses.
    position_m
        Of the body in the world, shape (P, 3).
    attitude
        From the body to the world, of P poses.
    """

    K: NDArray[np.float64]
    T_body_camera: NDArray[np.float64]
    times_us: NDArray[np.float64]
    position_m: NDArray[np.float64]
    attitude: Rotation

    def camera_pose(self, time_us: float) -> NDArray[np.float64]:
        """Return T_world_camera at a time."""
        time_us = float(np.clip(time_us, self.times_us[0], self.times_us[-1]))
        T_world_body = np.eye(4)
        T_world_body[:3, :3] = Slerp(self.times_us, self.attitude)(time_us).as_matrix()
        T_world_body[:3, 3] = [np.interp(time_us, self.times_us, along) for along in self.position_m.T]
        return T_world_body @ self.T_body_camera

    def flow_px(self, depth_mm: NDArray[np.float64], start_us: float, end_us: float) -> NDArray[np.float64]:
        """Return the flow (H, W, 2) of what does not move: x* = K pi(R z K^-1 x + T)."""
        T_end_start = np.linalg.inv(self.camera_pose(end_us)) @ self.camera_pose(start_us)
        y, x = np.indices(depth_mm.shape, dtype=np.float64)
        pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
        points_m = depth_mm[..., None] / 1000 * (pixels @ np.linalg.inv(self.K).T)
        moved_m = points_m @ T_end_start[:3, :3].T + T_end_start[:3, 3]
        moved_m[~(moved_m[..., 2] > 0)] = np.nan
        projected = (moved_m / moved_m[..., 2:]) @ self.K.T
        return np.asarray(projected[..., :2] - pixels[..., :2])


def _inputs(file: h5py.File) -> Inputs:
    camera = file[CAMERA + "depth"].attrs
    return Inputs(
        np.array(camera["K"], dtype=np.float64),
        np.array(camera["T_body_camera"], dtype=np.float64),
        file["path/pose/ts"][...].astype(np.float64),
        file[POSITION][...],
        Rotation.from_quat(file[ORIENTATION][...]),
    )


def _compute_again(file: h5py.File, right: Inputs, wrong: Inputs) -> None:
    """Add to all flow by what that of the wrong inputs differs from that of the right ones."""
    depth_mm, depth_us = file["path/depth"][...].astype(np.float64), file["path/depth_ts"][...]
    for key in FLOW:
        fields = file[key][...]
        for number, (start_us, end_us) in enumerate(file[f"{key}_ts"][...]):
            frame_mm = depth_mm[np.argmin(np.abs(depth_us - start_us))]
            change_px = wrong.flow_px(frame_mm, start_us, end_us) - right.flow_px(frame_mm, start_us, end_us)
            fields[number] = (fields[number] + change_px).astype(fields.dtype)
        replace_values(file, key, fields)


def of_another_focal_length(file: h5py.File, plan: Plan) -> None:
    """Flow was computed with focal lengths that are too large by so many percent."""
    right = _inputs(file)
    gain = 1 + plan.size / 100
    _compute_again(file, right, replace(right, K=right.K * np.array([[gain, 1, 1], [1, gain, 1], [1, 1, 1]])))


def of_another_centre(file: h5py.File, plan: Plan) -> None:
    """Flow was computed with a principal point that lies so many px from the right one, in any direction."""
    right = _inputs(file)
    angle = plan.random.uniform(0, 2 * np.pi)
    K = right.K.copy()
    K[:2, 2] += plan.size * np.array([np.cos(angle), np.sin(angle)])
    _compute_again(file, right, replace(right, K=K))


def of_another_mounting(file: h5py.File, plan: Plan) -> None:
    """Flow was computed with a camera that is turned by so many degrees about any axis."""
    right = _inputs(file)
    T_body_camera = right.T_body_camera.copy()
    T_body_camera[:3, :3] @= Rotation.from_rotvec(np.deg2rad(plan.size) * plan.direction()).as_matrix()
    _compute_again(file, right, replace(right, T_body_camera=T_body_camera))


def of_the_noisy_pose(file: h5py.File, plan: Plan) -> None:
    """Poses get noise of so many mrad and as many mm, which is declared, and flow was computed from them."""
    right = _inputs(file)
    turns = Rotation.from_rotvec(plan.random.normal(0.0, plan.size / 1000, right.position_m.shape))
    position_m = right.position_m + plan.random.normal(0.0, plan.size / 1000, right.position_m.shape)
    wrong = replace(right, position_m=position_m, attitude=right.attitude * turns)
    _compute_again(file, right, wrong)
    replace_values(file, POSITION, wrong.position_m)
    replace_values(file, ORIENTATION, wrong.attitude.as_quat())
    for name in ("position_sigma", "rotation_sigma"):
        file["metadata/pose"].attrs[name] = np.float64(plan.size / 1000)
