"""A small canonical file written by hand from the format's text, with bare h5py.

The generator and the reader share one description of the layout; an error in it would go unnoticed between them. So
nothing here is taken from that description: every path, type, unit and attribute is written out.

The scene: a tenth of a second at rest, five metres before a grey wall, with a little declared shot noise.
"""

from pathlib import Path
from typing import Any

import h5py
import hdf5plugin  # noqa: F401  makes filter 32001 known to HDF5
import numpy as np

WIDTH, HEIGHT = 36, 27
EVENT_WIDTH, EVENT_HEIGHT = 16, 12
DURATION_US = 100_000
BLOSC, BLOSC_ZSTD_5_SHUFFLE = 32001, (0, 0, 0, 0, 5, 1, 5)

FRAMES_US = np.arange(0, DURATION_US + 1, 20_000, dtype=np.int64)
IMU_US = np.arange(0, DURATION_US + 1, 1_000, dtype=np.int64)
POSE_US = np.arange(0, DURATION_US + 1, 5_000, dtype=np.int64)
EVENTS_US = np.arange(700, DURATION_US, 1_300, dtype=np.int64)


def write_handmade(path: Path) -> Path:
    """Write the file and return its path."""
    with h5py.File(path, "w") as file:
        file.attrs.update({
            "format": "fedora", "format_version": "1.0", "sequence": "rest", "world": "wall", "illumination": "day",
            "created_by": "hand", "scene_digest": "none", "seed": 1,
        })  # fmt: skip
        _frames(file)
        _events(file)
        _motion(file)
        _flow(file)
        _metadata(file)
    return path


def _frames(file: h5py.File) -> None:
    count = len(FRAMES_US)
    _images(file, "path/rgb", np.full((count, HEIGHT, WIDTH, 3), 128, dtype=np.uint8), "DN")
    file["path/rgb"].attrs["transfer"] = "linear"
    _samples(file, "path/rgb_ts", FRAMES_US, "us")
    depth_mm = np.full((count, HEIGHT, WIDTH), 5000.0, dtype=np.float32)
    depth_mm[:, :3] = np.nan
    _images(file, "path/depth", depth_mm, "mm")
    _samples(file, "path/depth_ts", FRAMES_US, "us")


def _events(file: h5py.File) -> None:
    random = np.random.default_rng(1)
    count = len(EVENTS_US)
    _samples(file, "path/events/x", random.integers(0, EVENT_WIDTH, count).astype(np.uint16), "px")
    _samples(file, "path/events/y", random.integers(0, EVENT_HEIGHT, count).astype(np.uint16), "px")
    _samples(file, "path/events/t", EVENTS_US, "us")
    _samples(file, "path/events/p", random.integers(0, 2, count).astype(np.uint8), "1")


def _motion(file: h5py.File) -> None:
    _samples(file, "path/imu/angular_velocity", np.zeros((len(IMU_US), 3)), "rad/s")
    _samples(file, "path/imu/linear_acceleration", np.tile([0.0, 0.0, 9.81], (len(IMU_US), 1)), "m/s^2")
    _samples(file, "path/imu/ts", IMU_US, "us")
    _samples(file, "path/pose/position", np.tile([1.0, 2.0, 3.0], (len(POSE_US), 1)), "m")
    _samples(file, "path/pose/orientation", np.tile([0.0, 0.0, 0.0, 1.0], (len(POSE_US), 1)), "1")
    _samples(file, "path/pose/ts", POSE_US, "us")


def _flow(file: h5py.File) -> None:
    for rate_hz, stride in ((10, 5), (25, 2), (50, 1)):
        starts = FRAMES_US[:-stride:stride]
        stops = starts + stride * 20_000
        keep = stops <= DURATION_US
        flow = np.zeros((int(keep.sum()), HEIGHT, WIDTH, 2), dtype=np.float32)
        flow[:, :3] = np.nan
        _images(file, f"path/flow/{rate_hz}hz", flow, "px")
        _samples(file, f"path/flow/{rate_hz}hz_ts", np.column_stack([starts, stops])[keep], "us")


def _metadata(file: h5py.File) -> None:
    event_index = np.array([int(np.sum(frame > EVENTS_US)) for frame in FRAMES_US], dtype=np.int64)
    _samples(file, "metadata/rgb_to_event", event_index, "1")
    _samples(file, "metadata/depth_to_event", event_index, "1")
    depth_range = file.create_dataset("metadata/depth_range", data=np.array([0.1, 30.0]))
    depth_range.attrs["units"] = "m"
    _camera(file, "rgb", WIDTH, HEIGHT)
    _camera(file, "depth", WIDTH, HEIGHT)
    _camera(file, "events", EVENT_WIDTH, EVENT_HEIGHT)
    file["metadata"].create_group("events").attrs.update({
        "model": "log", "threshold_on": 0.2, "threshold_off": 0.2, "log_eps_dn": 0.0, "packet_interval_us": 0,
        "polarity": "1=brighter", "initial_phase": "uniform", "shot_rate_hz": 4.0,
        "hot_pixels": np.empty((0, 2), dtype=np.int64),
    })  # fmt: skip
    file["metadata"].create_group("imu").attrs.update({
        "gyro_noise_density": 0.0, "accel_noise_density": 0.0, "gyro_bias_walk": 0.0, "accel_bias_walk": 0.0,
        "gravity": 9.81, "sampling": "instant",
    })  # fmt: skip
    file["metadata"].create_group("pose").attrs.update({"position_sigma": 0.0, "rotation_sigma": 0.0})
    file["metadata"].create_group("flow").attrs.update({"unit": "px", "model": "rigid"})


def _camera(file: h5py.File, name: str, width: int, height: int) -> None:
    focal = width / (2 * np.tan(np.pi / 6))
    T_body_camera = np.eye(4)
    T_body_camera[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    file.create_group(f"metadata/cameras/{name}").attrs.update({
        "width": width, "height": height, "exposure_us": 0.0, "camera_model": "pinhole",
        "K": np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]]),
        "T_body_camera": T_body_camera,
    })  # fmt: skip


def _images(file: h5py.File, path: str, values: np.ndarray[Any, Any], units: str) -> None:
    chunks = (1, *values.shape[1:])
    dataset = file.create_dataset(
        path, data=values, chunks=chunks, fletcher32=True, compression=BLOSC, compression_opts=BLOSC_ZSTD_5_SHUFFLE
    )
    dataset.attrs["units"] = units


def _samples(file: h5py.File, path: str, values: np.ndarray[Any, Any], units: str) -> None:
    dataset = file.create_dataset(path, data=values, chunks=values.shape, fletcher32=True)
    dataset.attrs["units"] = units
