"""A folder laid out like a sequence of TUM-VIE, with content of the reference generator.

Written by hand from what public loaders read (``TUMVIE`` of tonic, ``TumVieDatasetReader`` of OKVIS2-X,
``pp_tumvie.py`` of DEVO, the provider of E-NeRF), so that an error of the dialect is none of the writer. All cameras
sit in one place and have one lens, and the motion capture never loses the markers: in that it is no recording.
"""

import json
from pathlib import Path
from typing import Any

import cv2
import h5py
import hdf5plugin
import numpy as np
from scipy.spatial.transform import Rotation

from tests.support.event_view import TwoViews
from tests.support.m3ed_folder import turned_axes

Array = np.ndarray[Any, Any]

FIRST_US = 4_000_250.125
"""Stamps of everything but events are floating-point; the clock begins before the sequence."""

MARKERS_IN_IMU_M = (0.03, -0.11, 0.06)

QUALITY = 95
"""Of the JPEG files."""


def write_tum_vie_folder(source: TwoViews, folder: Path, name: str = "mocap-desk") -> Path:
    """Write a sequence that was seen through an equidistant lens as a folder of TUM-VIE, and return the folder."""
    (folder / "left_images").mkdir(parents=True)
    T_imu_body = np.eye(4)
    T_imu_body[:3, :3] = turned_axes()
    with h5py.File(source.sequence) as file:
        write_events(file, folder / f"{name}-events_left.h5")
        _images(file, folder / "left_images")
        _imu(file, folder / "imu_data.txt", T_imu_body)
        _mocap(file, folder / "mocap_data.txt", T_imu_body)
        cameras = {camera: dict(file[f"metadata/cameras/{camera}"].attrs) for camera in ("rgb", "events")}
    write_calibration(folder / "camera-calibrationA.json", cameras, T_imu_body)
    marker = {"value0": {"T_imu_marker": named_pose(marker_in_imu()), "mocap_time_offset_ns": 0}}
    (folder / "mocap-imu-calibrationA.json").write_text(json.dumps(marker))
    return folder


def write_tum_vie_side(path: Path) -> Path:
    """Declare what is true of the stand-in and of no file of TUM-VIE: exact poses."""
    lines = [f'"metadata/pose/{name}" = 0.0' for name in ("position_sigma", "rotation_sigma")]
    path.write_text("\n".join(["[metadata]", *lines, ""]), "utf-8")
    return path


def marker_in_imu() -> Array:
    """Return where the markers are."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([-0.6, 0.2, 1.9]).as_matrix()
    T[:3, 3] = MARKERS_IN_IMU_M
    return T


def named_pose(T: Array) -> dict[str, float]:
    """Return a transformation as Basalt names its numbers."""
    numbers = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
    return dict(zip(("px", "py", "pz", "qx", "qy", "qz", "qw"), map(float, numbers), strict=True))


def write_events(file: h5py.File, path: Path) -> None:
    """Write the events of a canonical file, and the map from milliseconds, as one HDF5 file of TUM-VIE."""
    times = file["path/events/t"][:] + round(FIRST_US)
    with h5py.File(path, "w") as written:
        blosc = hdf5plugin.Blosc(cname="zstd")
        written.create_dataset("events/t", data=times.astype(np.int64), **blosc)
        for name, dtype in (("x", np.uint16), ("y", np.uint16), ("p", np.uint8)):
            written.create_dataset(f"events/{name}", data=file[f"path/events/{name}"][:].astype(dtype), **blosc)
        milliseconds = np.arange(int(times[-1]) // 1000 + 1) * 1000
        written["ms_to_idx"] = np.searchsorted(times, milliseconds).astype(np.uint64)


def write_calibration(path: Path, cameras: dict[str, dict[str, Any]], T_imu_body: Array) -> None:
    """Write a calibration of Basalt: left and right grey camera, left and right event camera."""
    places, lenses, sizes = [], [], []
    for name, right_m in (("rgb", 0.0), ("rgb", 0.11), ("events", 0.0), ("events", 0.12)):
        camera, offset = cameras[name], np.eye(4)
        offset[0, 3] = right_m
        places.append(named_pose(T_imu_body @ camera["T_body_camera"] @ offset))
        K = camera["K"]
        numbers = [K[0, 0], K[1, 1], K[0, 2], K[1, 2], *camera["distortion"]]
        names = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")
        intrinsics = dict(zip(names, map(float, numbers), strict=True))
        lenses.append({"camera_type": "kb4", "intrinsics": intrinsics})
        sizes.append([int(camera["width"]), int(camera["height"])])
    document = {"value0": {"T_imu_cam": places, "intrinsics": lenses, "resolution": sizes}}
    path.write_text(json.dumps(document, indent=2))


def _images(file: h5py.File, folder: Path) -> None:
    for row, image in enumerate(file["path/rgb"]):
        grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        assert cv2.imwrite(str(folder / f"{row:05d}.jpg"), grey, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    times = file["path/rgb_ts"][:] + FIRST_US
    np.savetxt(folder / "image_timestamps_left.txt", times, "%.3f", header="image_timestamps_left")
    np.savetxt(folder / "image_exposures_left.txt", np.full(len(times), 1500.0), "%.3f", header="exposures [us]")


def _imu(file: h5py.File, path: Path, T_imu_body: Array) -> None:
    R_imu_body = T_imu_body[:3, :3]
    samples = (file[f"path/imu/{name}"][:] @ R_imu_body.T for name in ("angular_velocity", "linear_acceleration"))
    times = file["path/imu/ts"][:] + FIRST_US
    rows = np.column_stack([times, *samples, np.full(len(times), 41.5)])
    np.savetxt(path, rows, "%.3f" + 6 * " %.12f" + " %.2f", header="timestamp[us] gx gy gz[rad/s] ax ay az[m/s^2] temp")


def _mocap(file: h5py.File, path: Path, T_imu_body: Array) -> None:
    times = file["path/pose/ts"][:] + FIRST_US
    T_world_body = np.tile(np.eye(4), (len(times), 1, 1))
    T_world_body[:, :3, :3] = Rotation.from_quat(file["path/pose/orientation"][:]).as_matrix()
    T_world_body[:, :3, 3] = file["path/pose/position"][:]
    # Of the motion capture another axis points up, and its origin is elsewhere.
    T_mocap_world = np.eye(4)
    T_mocap_world[:3] = [[0, 1, 0, 2.0], [0, 0, 1, -0.5], [1, 0, 0, 1.25]]
    poses = T_mocap_world @ T_world_body @ np.linalg.inv(T_imu_body) @ marker_in_imu()
    rows = np.column_stack([times, poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_quat()])
    np.savetxt(path, rows, "%.3f" + 7 * " %.15f", header="timestamp[us] px py pz qx qy qz qw")
