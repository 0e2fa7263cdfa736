"""A folder laid out like a sequence of M3ED, with content of the reference generator.

Written by hand from the scripts that wrote M3ED (github.com/daniilidis-group/m3ed, rosbag2hdf5.py, fasterlio_gt.py),
so that an error of the dialect is no error of the writer. Depth is dense, and all lenses
are one.
"""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.support.event_view import TwoViews, camera_poses

Array = np.ndarray[Any, Any]

FIRST_US = 2_500
"""Stamps count from the start of all sensors, a little before the first sample."""


def write_m3ed_folder(source: TwoViews, folder: Path) -> Path:
    """Write a sequence of the generator as a folder of M3ED, and return the folder."""
    folder.mkdir(parents=True)
    with h5py.File(source.sequence) as file, h5py.File(source.event_sized) as event_sized:
        event_times = file["path/events/t"][:] + FIRST_US
        with h5py.File(folder / "falcon_data.h5", "w") as data:
            _events(file, data, event_times)
            _colour(file, data, event_times)
            _imu(file, data)
        times = file["path/depth_ts"][:]
        poses = camera_poses(file, times)
        for kind in ("pose", "depth"):
            with h5py.File(folder / f"falcon_{kind}_gt.h5", "w") as truth:
                truth["Cn_T_C0"] = np.linalg.inv(poses) @ poses[0]
                truth["ts"] = (times + FIRST_US).astype(np.float64)
                truth["ts_map_prophesee_left"] = index_map(event_times, times + FIRST_US)
                if kind == "depth":
                    depth_m = event_sized["path/depth"][:] / np.float32(1000)
                    truth.create_dataset(
                        "depth/prophesee/left",
                        data=np.where(np.isnan(depth_m), np.float32(np.inf), depth_m),
                        chunks=(1, *depth_m.shape[1:]),
                        compression="lzf",
                    )
    return folder


def write_m3ed_side(path: Path) -> Path:
    """Declare what is true of the stand-in and of no file of M3ED: exact poses."""
    lines = [f'"metadata/pose/{name}" = 0.0' for name in ("position_sigma", "rotation_sigma")]
    path.write_text("\n".join(["[metadata]", *lines, ""]), "utf-8")
    return path


def index_map(event_times: Array, times: Array) -> Array:
    """Return the earliest event not before each stamp, 0 where there is none."""
    index = np.searchsorted(event_times, times)
    return np.where(index < len(event_times), index, 0).astype(np.uint64)


def _events(file: h5py.File, data: h5py.File, event_times: Array) -> None:
    group = data.create_group("prophesee/left")
    for name, dtype in (("x", np.uint16), ("y", np.uint16), ("p", np.int8)):
        group.create_dataset(
            name, data=file[f"path/events/{name}"][:].astype(dtype), chunks=(10000,), compression="lzf"
        )
    group.create_dataset("t", data=event_times, chunks=(10000,), compression="lzf")
    group["ms_map_idx"] = index_map(event_times, np.arange(int(event_times[-1]) // 1000) * 1000)
    _calibration(file, group, "events")


def _colour(file: h5py.File, data: h5py.File, event_times: Array) -> None:
    group = data.create_group("ovc")
    times = file["path/rgb_ts"][:] + FIRST_US
    # OpenCV decodes to blue, green, red.
    images = file["path/rgb"][:][..., ::-1]
    group.create_dataset("rgb/data", data=images, chunks=(1, *images.shape[1:]), compression="lzf")
    group["ts"] = times
    group["ts_map_prophesee_left_t"] = index_map(event_times, times)
    _calibration(file, group["rgb"], "rgb")


def _imu(file: h5py.File, data: h5py.File) -> None:
    # The unit sits in the body's origin, turned against the body.
    R_imu_body = turned_axes()
    group = data.create_group("ovc/imu")
    for name, key in (("omega", "angular_velocity"), ("accel", "linear_acceleration")):
        group[name] = file[f"path/imu/{key}"][:] @ R_imu_body.T
    group["ts"] = file["path/imu/ts"][:] + FIRST_US
    T_body_imu = np.eye(4)
    T_body_imu[:3, :3] = R_imu_body.T
    T_body_events = file["metadata/cameras/events"].attrs["T_body_camera"]
    group["calib/T_to_prophesee_left"] = np.linalg.inv(T_body_events) @ T_body_imu


def turned_axes() -> Array:
    """Return a rotation R_imu_body that no convention of axes has."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    return np.asarray(Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix())


def _calibration(file: h5py.File, group: h5py.Group, name: str) -> None:
    camera = file[f"metadata/cameras/{name}"].attrs
    K = camera["K"]
    group["calib/camera_model"] = "pinhole"
    group["calib/distortion_model"] = "radtan"
    group["calib/distortion_coeffs"] = camera["distortion"]
    group["calib/intrinsics"] = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]])
    group["calib/resolution"] = np.array([camera["width"], camera["height"]])
    T_body_events = file["metadata/cameras/events"].attrs["T_body_camera"]
    group["calib/T_to_prophesee_left"] = np.linalg.inv(T_body_events) @ camera["T_body_camera"]
