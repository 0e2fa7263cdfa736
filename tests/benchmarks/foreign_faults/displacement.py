"""Optical flow that is computed or stored wrongly."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import FLOW_RATES, replace_values
from tests.benchmarks.foreign_faults.kind import Plan, Plant

KEYS: Final = tuple(f"path/flow/{rate}" for rate in FLOW_RATES)
Matrix = NDArray[np.float64]


def changed(matrix: tuple[tuple[float, float], tuple[float, float]]) -> Plant:
    """Vectors (u, v) are multiplied by a matrix."""

    def plant(file: h5py.File, plan: Plan) -> None:
        for key in KEYS:
            values = file[key][...]
            replace_values(file, key, (values @ np.array(matrix).T).astype(values.dtype))

    return plant


def gained(file: h5py.File, plan: Plan) -> None:
    """Vectors are too long by so many percent."""
    for key in KEYS:
        values = file[key][...]
        replace_values(file, key, (values * (1 + plan.size / 100)).astype(values.dtype))


def noisy(file: h5py.File, plan: Plan) -> None:
    """Vectors have white noise of that standard deviation, px."""
    for key in KEYS:
        values = file[key][...]
        noise = plan.random.normal(0.0, plan.size, values.shape)
        replace_values(file, key, (values + noise).astype(values.dtype))


def per_second(file: h5py.File, plan: Plan) -> None:
    """Vectors are divided by the length of their interval, s."""
    for key in KEYS:
        values = file[key][...]
        seconds = np.diff(file[f"{key}_ts"][...], axis=1)[:, 0] / 1e6
        replace_values(file, key, (values / seconds[:, None, None, None]).astype(values.dtype))


def normalised(file: h5py.File, plan: Plan) -> None:
    """Vectors are shares of half the image's width and height, as networks take them."""
    for key in KEYS:
        values = file[key][...]
        halves = np.array([values.shape[2] / 2, values.shape[1] / 2])
        replace_values(file, key, (values / halves).astype(values.dtype))


def of_neighbour(file: h5py.File, plan: Plan) -> None:
    """Each field belongs to the interval before its own; the first occurs twice."""
    for key in KEYS:
        values = file[key][...]
        replace_values(file, key, np.concatenate([values[:1], values[:-1]]))


def rates_exchanged(file: h5py.File, plan: Plan) -> None:
    """Fields of 50 Hz are those of 25 Hz of the same time."""
    fine, coarse = file["path/flow/50hz"][...], file["path/flow/25hz"][...]
    starts_us = file["path/flow/25hz_ts"][...][:, 0]
    rows = np.searchsorted(starts_us, file["path/flow/50hz_ts"][...][:, 0], "right") - 1
    replace_values(file, "path/flow/50hz", coarse[np.clip(rows, 0, len(coarse) - 1)].astype(fine.dtype))


def _camera_poses(
    file: h5py.File, position_m: Matrix, attitude: Rotation, instants_us: NDArray[np.int64]
) -> tuple[Matrix, Matrix]:
    """Return rotation (N, 3, 3) and position (N, 3), camera in the world, at instants."""
    mount = np.asarray(file["metadata/cameras/depth"].attrs["T_body_camera"])
    stamps_us = file["path/pose/ts"][...].astype(np.float64)
    instants = np.clip(instants_us.astype(np.float64), stamps_us[0], stamps_us[-1])
    body = Slerp(stamps_us, attitude)(instants).as_matrix()
    origin_m = np.stack([np.interp(instants, stamps_us, position_m[:, axis]) for axis in range(3)], axis=1)
    return body @ mount[:3, :3], origin_m + body @ mount[:3, 3]


def _between(depth_m: Matrix, K: Matrix, R: Matrix, T: Matrix) -> Matrix:
    """Return how far each pixel moves where its point moves by X1 = R X0 + T; ``depth_m`` has shape (H, W)."""
    rows, columns = np.indices(depth_m.shape)
    points = np.stack([(columns - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1], np.ones(rows.shape)]) * depth_m
    x, y, z = np.tensordot(R, points, axes=1) + T[:, None, None]
    z = np.where(z > 0, z, np.nan)
    return np.stack([K[0, 0] * x / z + K[0, 2] - columns, K[1, 1] * y / z + K[1, 2] - rows], axis=-1)


def _computed(
    file: h5py.File, position_m: Matrix, attitude: Rotation, K: Matrix, backwards: bool = False
) -> dict[str, Matrix]:
    """Return flow by key from depth at one end of each interval and the motion to the other end."""
    depth_us = file["path/depth_ts"][...]
    computed: dict[str, Matrix] = {}
    for key in KEYS:
        intervals_us = file[f"{key}_ts"][...]
        source, target = (1, 0) if backwards else (0, 1)
        R0, p0 = _camera_poses(file, position_m, attitude, intervals_us[:, source])
        R1, p1 = _camera_poses(file, position_m, attitude, intervals_us[:, target])
        fields = file[key][...]
        for row, instant_us in enumerate(intervals_us[:, source]):
            frame = int(np.argmin(np.abs(depth_us - instant_us)))
            depth_m = file["path/depth"][frame].astype(np.float64) / 1000
            fields[row] = _between(depth_m, K, R1[row].T @ R0[row], R1[row].T @ (p0[row] - p1[row]))
        computed[key] = fields
    return computed


def _pose(file: h5py.File) -> tuple[Matrix, Rotation]:
    return file["path/pose/position"][...], Rotation.from_quat(file["path/pose/orientation"][...])


def _replace(file: h5py.File, fields: dict[str, Matrix]) -> None:
    for key, values in fields.items():
        replace_values(file, key, values)


def recomputed(file: h5py.File) -> dict[str, Matrix]:
    """Return flow as the format defines it: what the planters below change in one respect."""
    return _computed(file, *_pose(file), np.asarray(file["metadata/cameras/depth"].attrs["K"]))


def backwards(file: h5py.File, plan: Plan) -> None:
    """Fields lead from the end of their interval to its start, on the grid of the end."""
    _replace(file, _computed(file, *_pose(file), np.asarray(file["metadata/cameras/depth"].attrs["K"]), True))


def of_other_focal(file: h5py.File, plan: Plan) -> None:
    """Flow is computed with a focal length that is too large by so many percent."""
    K = np.array(file["metadata/cameras/depth"].attrs["K"])
    K[[0, 1], [0, 1]] *= 1 + plan.size / 100
    _replace(file, _computed(file, *_pose(file), K))


def of_other_centre(file: h5py.File, plan: Plan) -> None:
    """Flow is computed with a principal point that lies so many px off, in a random direction."""
    K = np.array(file["metadata/cameras/depth"].attrs["K"])
    angle = plan.random.uniform(0, 2 * np.pi)
    K[:2, 2] += plan.size * np.array([np.cos(angle), np.sin(angle)])
    _replace(file, _computed(file, *_pose(file), K))


def of_noisy_pose(file: h5py.File, plan: Plan) -> None:
    """The pose has declared noise (size: of the angle, mrad; as many mm), and flow is computed from it."""
    position_m, attitude = _pose(file)
    sigma = plan.size / 1000
    position_m = position_m + plan.random.normal(0.0, sigma, position_m.shape)
    attitude = attitude * Rotation.from_rotvec(plan.random.normal(0.0, sigma, position_m.shape))
    K = np.asarray(file["metadata/cameras/depth"].attrs["K"])
    _replace(file, _computed(file, position_m, attitude, K))
    replace_values(file, "path/pose/position", position_m)
    replace_values(file, "path/pose/orientation", attitude.as_quat())
    attributes = file["metadata/pose"].attrs
    attributes["position_sigma"] = attributes["rotation_sigma"] = np.float64(sigma)


def per_frame(file: h5py.File, plan: Plan) -> None:
    """Vectors are those of one frame period of colour, whatever the interval."""
    period_us = float(np.median(np.diff(file["path/rgb_ts"][...])))
    for key in KEYS:
        values = file[key][...]
        frames = np.diff(file[f"{key}_ts"][...], axis=1)[:, 0] / period_us
        replace_values(file, key, (values / frames[:, None, None, None]).astype(values.dtype))


def shrunk(file: h5py.File, plan: Plan) -> None:
    """Fields were computed at a size so many times smaller, and enlarged without their vectors."""
    for key in KEYS:
        values = file[key][...]
        replace_values(file, key, (values / plan.size).astype(values.dtype))


def of_next_interval(file: h5py.File, plan: Plan) -> None:
    """Each field belongs to the interval after its own; the last occurs twice."""
    for key in KEYS:
        values = file[key][...]
        replace_values(file, key, np.concatenate([values[1:], values[-1:]]))


def limited(file: h5py.File, plan: Plan) -> None:
    """No component is longer than so many percent of the longest: integers of too few bits."""
    for key in KEYS:
        values = file[key][...]
        limit = plan.size / 100 * float(np.nanmax(np.abs(values)))
        replace_values(file, key, np.clip(values, -limit, limit).astype(values.dtype))


def turning(file: h5py.File) -> dict[str, Matrix]:
    """Return what the camera's turning alone moves: the way is a thousandth of what it was."""
    position_m, attitude = _pose(file)
    return _computed(file, position_m / 1000, attitude, np.asarray(file["metadata/cameras/depth"].attrs["K"]))


def of_turning_alone(file: h5py.File, plan: Plan) -> None:
    """Depth was in millimetres and the way in metres, so that the way moves nothing."""
    _replace(file, turning(file))


def on_late_grid(file: h5py.File, plan: Plan) -> None:
    """Vectors stand at the pixels to which they lead: shifted by each field's mean, away from zero to whole pixels."""
    for key in KEYS:
        values = file[key][...]
        for row, field in enumerate(values):
            mean_px = np.nanmean(field, axis=(0, 1))
            u, v = (np.sign(mean_px) * np.ceil(np.abs(mean_px))).astype(int)
            values[row] = np.roll(field, (v, u), axis=(0, 1))
        replace_values(file, key, values)
