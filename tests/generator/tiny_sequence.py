"""A tiny file of the canonical layout with every stream, made by hand: noise-free, half a second."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.flight import Flight, FlightOptions, HarmonicTerm
from fedora_generator.flow import flow_px
from fedora_generator.imu import Imu, ImuOptions, PoseOptions, PoseSensor
from fedora_qa.conventions import R_BODY_OPTICAL
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.layout.create import create_dataset

FLIGHT = Flight(
    FlightOptions(
        position_m=(0, 0, 2),
        velocity_m_s=(2, 0, 0),
        yaw_rate_deg_s=40.0,
        terms=(
            HarmonicTerm(axis="roll", amplitude=10.0, frequency_hz=1.0),
            HarmonicTerm(axis="pitch", amplitude=5.0, frequency_hz=1.5),
        ),
    )
)
DURATION_US = 500_000
WIDTH, HEIGHT = 12, 9
DEPTH_M = 4.0
K = np.array([[10.0, 0.0, 5.5], [0.0, 10.0, 4.0], [0.0, 0.0, 1.0]])
T_BODY_CAMERA = np.eye(4)
T_BODY_CAMERA[:3, :3] = R_BODY_OPTICAL
NOISE = {
    "metadata/events": {"leak_rate_hz": 0.1, "shot_rate_hz": 0.2},
    "metadata/imu": {"gyro_noise_density": 1e-4, "accel_noise_density": 1e-3, "gyro_bias_walk": 1e-5},
    "metadata/pose": {"position_sigma": 5e-3, "rotation_sigma": 3e-3},
}


def write_tiny_sequence(path: Path, *, origin_us: int = 0) -> None:
    """Write the file; all stamps start at ``origin_us``."""
    rng = np.random.default_rng(12)
    with h5py.File(path, "w") as file:
        frames_us = np.arange(0, DURATION_US + 1, 20_000) + origin_us
        _write_frames(file, frames_us, rng)
        _write_events(file, frames_us, origin_us, rng)
        _write_motion(file, origin_us)
        for rate_hz in (10, 25, 50):
            _write_flow(file, rate_hz, origin_us)
        _write_metadata(file)


def put(file: h5py.File, key: str, values: NDArray[Any]) -> None:
    """Create a dataset of the layout with these values."""
    spec = DATASETS[key]
    sizes = {size: length for size, length in zip(spec.shape, values.shape, strict=True) if isinstance(size, str)}
    create_dataset(file, key, sizes)[...] = values


def poses_at(times_us: NDArray[np.int64]) -> NDArray[np.float64]:
    """Camera poses T_world_camera (n, 4, 4) of the flight."""
    states = FLIGHT.states_at(times_us / 1e6)
    T_world_body = np.tile(np.eye(4), (len(times_us), 1, 1))
    T_world_body[:, :3, :3] = states.R_world_body
    T_world_body[:, :3, 3] = states.positions_world_m
    return T_world_body @ T_BODY_CAMERA


def flow_with(K: NDArray[np.float64], start_us: int, end_us: int) -> NDArray[np.float32]:
    """Flow of the wall over one interval, as made with ``K``."""
    return flow_px(np.full((HEIGHT, WIDTH), 1 / DEPTH_M), K, *poses_at(np.array([start_us, end_us])))


def _write_frames(file: h5py.File, frames_us: NDArray[np.int64], rng: np.random.Generator) -> None:
    put(file, "path/rgb", rng.integers(20, 200, (len(frames_us), HEIGHT, WIDTH, 3)).astype(np.uint8))
    put(file, "path/rgb_ts", frames_us)
    depth_mm = np.full((len(frames_us), HEIGHT, WIDTH), DEPTH_M * 1e3, np.float32)
    depth_mm[:, 0, 0] = np.nan
    depth_mm[:, 0, 1] += np.arange(len(frames_us))  # so that no two frames are the same
    put(file, "path/depth", depth_mm)
    put(file, "path/depth_ts", frames_us)


def _write_events(file: h5py.File, frames_us: NDArray[np.int64], origin_us: int, rng: np.random.Generator) -> None:
    count = 5_000
    t = np.concatenate([rng.integers(1, DURATION_US + 1, count - 3), [20_000, 20_000, 40_000]])
    columns = [rng.integers(0, size, count) for size in (2, WIDTH, HEIGHT)]
    p, x, y = columns
    order = np.lexsort((p, x, y, t))
    for name, values in zip("xytp", (x, y, t + origin_us, p), strict=True):
        put(file, f"path/events/{name}", values[order])
    for stream in ("rgb_to_event", "depth_to_event"):
        put(file, f"metadata/{stream}", np.searchsorted(t[order] + origin_us, frames_us))


def _write_motion(file: h5py.File, origin_us: int) -> None:
    rng = np.random.default_rng(0)
    imu_us = np.arange(0, DURATION_US + 1, 1_000)
    imu = Imu(ImuOptions(), rng).sample(FLIGHT, imu_us)
    put(file, "path/imu/angular_velocity", imu.angular_velocities_body_rad_s)
    put(file, "path/imu/linear_acceleration", imu.specific_forces_body_m_s2)
    put(file, "path/imu/ts", imu_us + origin_us)
    pose_us = np.arange(0, DURATION_US + 1, 5_000)
    pose = PoseSensor(PoseOptions(), rng).sample(FLIGHT, pose_us)
    put(file, "path/pose/position", pose.positions_world_m)
    put(file, "path/pose/orientation", pose.orientations_xyzw)
    put(file, "path/pose/ts", pose_us + origin_us)


def _write_flow(file: h5py.File, rate_hz: int, origin_us: int) -> None:
    edges_us = np.arange(0, DURATION_US + 1, 1_000_000 // rate_hz)
    intervals_us = np.stack([edges_us[:-1], edges_us[1:]], axis=-1)
    fields = np.stack([flow_with(K, *interval_us) for interval_us in intervals_us])
    fields[:, 0, 0] = np.nan
    put(file, f"path/flow/{rate_hz}hz", fields)
    put(file, f"path/flow/{rate_hz}hz_ts", intervals_us + origin_us)


def _write_metadata(file: h5py.File) -> None:
    put(file, "metadata/depth_range", np.array([0.1, 30.0]))
    file.attrs["format"], file.attrs["format_version"] = "fedora", "1.0"
    for camera in ("rgb", "depth", "events"):
        attributes = file.create_group(f"metadata/cameras/{camera}").attrs
        attributes.update({"width": WIDTH, "height": HEIGHT, "K": K, "T_body_camera": T_BODY_CAMERA})
    declared = {
        "events": {"model": "log", "threshold_on": 0.2, "threshold_off": 0.25, "polarity": "1=brighter"},
        "imu": {"gravity": 9.80665},
        "pose": {"position_sigma": 0.0},
        "flow": {"unit": "px"},
    }
    for group, attributes in declared.items():
        file.create_group(f"metadata/{group}").attrs.update(attributes)


def declare_noise(path: Path) -> None:
    """Declare noise in a file that has none, so that it can be misdeclared."""
    with h5py.File(path, "r+") as file:
        for group, attributes in NOISE.items():
            file[group].attrs.update(attributes)
