"""A folder laid out like a sequence of EDS, with content of the reference generator.

Written by hand from what public loaders read (``pp_eds.py`` of DEVO, the provider of E-NeRF, deep_ev_tracker) and from
the calibration of its makers (github.com/uzh-rpg/bundles-eds), so that an error of the dialect is none of the writer.
Both cameras sit in one place and have one lens: in that it is no recording.
"""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from tests.support.dsec_folder import write_png
from tests.support.event_view import TwoViews, camera_poses
from tests.support.m3ed_folder import turned_axes

Array = np.ndarray[Any, Any]

EPOCH_US = 1_643_891_234_567_891


def write_eds_folder(source: TwoViews, folder: Path) -> Path:
    """Write a sequence that was seen through a radial-tangential lens as a folder of EDS, and return the folder."""
    (folder / "images").mkdir(parents=True)
    with h5py.File(source.sequence) as file:
        with h5py.File(folder / "events.h5", "w") as written:
            for name, dtype in (("x", np.uint16), ("y", np.uint16), ("p", np.uint8)):
                written[name] = file[f"path/events/{name}"][:].astype(dtype)
            written["t"] = file["path/events/t"][:] + EPOCH_US
        for row, image in enumerate(file["path/rgb"]):
            write_png(folder / f"images/frame_{row:010d}.png", image)
        times = file["path/rgb_ts"][:] + EPOCH_US
        np.savetxt(folder / "images_timestamps.txt", times, "%d")
        (folder / "times.txt").write_text(
            "".join(f"{row} {time / 1e6:.6f} 10.0 0.0 frame_{row:010d}.png\n" for row, time in enumerate(times))
        )
        times = file["path/pose/ts"][:]
        poses = camera_poses(file, times)
        rows = np.column_stack([poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_quat()])
        lines = [f"{_seconds(time)} {' '.join(map(_decimals, row))}" for time, row in zip(times, rows, strict=True)]
        (folder / "stamped_groundtruth.txt").write_text("\n".join(["# timestamp tx ty tz qx qy qz qw", *lines, ""]))
        _imu(file, folder / "imu.csv")
        cameras = {name: dict(file[f"metadata/cameras/{name}"].attrs) for name in ("rgb", "events")}
    _calibration(cameras, folder / "calib.yaml")
    return folder


def write_eds_side(source: TwoViews, path: Path) -> Path:
    """Declare what is true of the stand-in and of no file of EDS: exact poses, and where the IMU is."""
    with h5py.File(source.sequence) as file:
        T_body_events = file["metadata/cameras/events"].attrs["T_body_camera"]
    # The body of the dialect is the event camera; the IMU sits in that of the generator, turned against it.
    T_generator_imu = np.eye(4)
    T_generator_imu[:3, :3] = turned_axes().T
    T_body_imu = np.linalg.inv(T_body_events) @ T_generator_imu
    lines = [f'"metadata/pose/{name}" = 0.0' for name in ("position_sigma", "rotation_sigma")]
    lines.append(f'"metadata/T_body_imu" = {T_body_imu.tolist()}')
    path.write_text("\n".join(["[metadata]", *lines, ""]), "utf-8")
    return path


def _seconds(time_us: int) -> str:
    """Return seconds since 1970 with all their decimals."""
    whole, part = divmod(int(time_us) + EPOCH_US, 1_000_000)
    return f"{whole}.{part:06d}"


def _decimals(number: float) -> str:
    return f"{number:.15f}"


def _imu(file: h5py.File, path: Path) -> None:
    samples = [file[f"path/imu/{name}"][:] @ turned_axes().T for name in ("angular_velocity", "linear_acceleration")]
    rows = np.concatenate(samples, axis=1)
    times_ns = (file["path/imu/ts"][:] + EPOCH_US) * 1000
    lines = [f"{time},{','.join(map(_decimals, row))}" for time, row in zip(times_ns, rows, strict=True)]
    path.write_text("\n".join([*lines, ""]))


def _calibration(cameras: dict[str, dict[str, Any]], path: Path) -> None:
    def intrinsics(name: str) -> dict[str, Any]:
        K = cameras[name]["K"]
        return {
            "camera_model": "pinhole",
            "distortion_coeffs": [float(number) for number in cameras[name]["distortion"]],
            "distortion_model": "radtan",
            "intrinsics": [float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])],
            "resolution": [int(cameras[name]["width"]), int(cameras[name]["height"])],
        }

    T_events_rgb = np.linalg.inv(cameras["events"]["T_body_camera"]) @ cameras["rgb"]["T_body_camera"]
    document = {"cam0": intrinsics("rgb"), "cam1": {**intrinsics("events"), "T_cn_cnm1": T_events_rgb.tolist()}}
    path.write_text(yaml.safe_dump(document), "utf-8")
