"""A folder laid out like a sequence of MVSEC, with content of the reference generator.

Written by hand from the scripts that wrote MVSEC (github.com/daniilidis-group/mvsec, mvsec_h5py.py, mvsec_reader.py,
compute_flow.py), so that an error of the dialect is no error of the writer. The lens is free of distortion, and flow is
exact, where those scripts take the velocity of a pixel times an interval.
"""

from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import yaml

from tests.support.event_view import TwoViews, camera_poses
from tests.support.m3ed_folder import turned_axes

Array = np.ndarray[Any, Any]

EPOCH_S = 1_504_645_177.25


def write_mvsec_folder(source: TwoViews, folder: Path) -> Path:
    """Write a sequence of the generator as a folder of MVSEC, and return the folder."""
    folder.mkdir(parents=True)
    with h5py.File(source.sequence) as file, h5py.File(source.event_sized) as event_sized:
        camera = dict(file["metadata/cameras/events"].attrs)
        with h5py.File(folder / "flying1_data.hdf5", "w") as data:
            _data(file, event_sized, data.create_group("davis/left"))
            _imu(file, data["davis/left"])
        with h5py.File(folder / "flying1_gt.hdf5", "w") as truth:
            _truth(event_sized, truth.create_group("davis/left"))
    _calibration(camera, folder / "camchain-imucam-flying.yaml")
    return folder


def write_mvsec_side(path: Path) -> Path:
    """Declare what is true of the stand-in and of no file of MVSEC: a lens without distortion, exact poses."""
    lines = [f'"metadata/cameras/{name}/distortion_model" = "none"' for name in ("rgb", "events")]
    lines += [f'"metadata/pose/{name}" = 0.0' for name in ("position_sigma", "rotation_sigma")]
    path.write_text("\n".join(["[metadata]", *lines, ""]), "utf-8")
    return path


def seconds(times_us: Array) -> Array:
    """Return seconds since 1970 as float64."""
    return np.asarray(EPOCH_S + times_us / 1e6)


def _data(file: h5py.File, event_sized: h5py.File, group: h5py.Group) -> None:
    events = {name: file[f"path/events/{name}"][:] for name in "xytp"}
    times_s = seconds(events["t"])
    polarity = 2.0 * (events["p"] - 0.5)
    group["events"] = np.stack([events["x"], events["y"], times_s, polarity], axis=1).astype(np.float64)
    images = np.stack([cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in event_sized["path/rgb"]])
    group.create_dataset("image_raw", data=images, chunks=(1, *images.shape[1:]), compression="lzf")
    group["image_raw_ts"] = seconds(file["path/rgb_ts"][:])
    group["image_raw_event_inds"] = np.searchsorted(times_s, group["image_raw_ts"][:]) - 1


def _imu(file: h5py.File, group: h5py.Group) -> None:
    samples = (file[f"path/imu/{name}"][:] @ turned_axes().T for name in ("linear_acceleration", "angular_velocity"))
    group["imu"] = np.concatenate(list(samples), axis=1)
    group["imu_ts"] = seconds(file["path/imu/ts"][:])


def _truth(file: h5py.File, group: h5py.Group) -> None:
    times = file["path/depth_ts"][:]
    poses = camera_poses(file, times)
    depth_m = file["path/depth"][:] / np.float32(1000)
    # There is a flow for each depth image, also for the last, and 0 where there is none.
    flow_px = np.concatenate([file["path/flow/20hz"][:], np.zeros((1, *depth_m.shape[1:], 2))])
    flow = np.moveaxis(np.nan_to_num(flow_px), -1, 1)
    for name, values in (("depth_image_rect", depth_m), ("flow_dist", flow)):
        group.create_dataset(name, data=values, chunks=(1, *values.shape[1:]), compression="lzf")
        group[f"{name}_ts"] = seconds(times)
    group["odometry"] = poses
    group["odometry_ts"] = seconds(times)


def _calibration(camera: dict[str, Any], path: Path) -> None:
    K = camera["K"]
    T_body_imu = np.eye(4)
    T_body_imu[:3, :3] = turned_axes().T
    cam0 = {
        "camera_model": "pinhole",
        "intrinsics": [float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])],
        "distortion_model": "equidistant",
        "distortion_coeffs": [0.0, 0.0, 0.0, 0.0],
        "projection_matrix": np.column_stack([K, np.zeros(3)]).tolist(),
        "rectification_matrix": np.eye(3).tolist(),
        "resolution": [int(camera["width"]), int(camera["height"])],
        "T_cam_imu": (np.linalg.inv(camera["T_body_camera"]) @ T_body_imu).tolist(),
        "rostopic": "/davis/left/image_raw",
    }
    path.write_text(yaml.safe_dump({"cam0": cam0}), "utf-8")
