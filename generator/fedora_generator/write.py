"""Writing of a sequence: its datasets, whole or growing, and what the file declares."""

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.events.keys import EventBatch
from fedora_generator.scene import Scene
from fedora_qa.conventions import FORMAT_NAME, FORMAT_VERSION
from fedora_qa.layout.canonical import EVENT_CHUNK_ROWS
from fedora_qa.layout.create import create_dataset


def write_dataset(file: h5py.File, key: str, values: NDArray[Any], **sizes: int) -> None:
    """Create a dataset of the layout and fill it; ``sizes`` are its symbolic sizes."""
    create_dataset(file, key, sizes)[...] = values


class EventColumns:
    """The four event columns, grown by whole chunks so that none is compressed twice."""

    def __init__(self, file: h5py.File) -> None:
        self._columns = {name: create_dataset(file, f"path/events/{name}", {"E": 0}) for name in "xytp"}
        self._waiting: list[EventBatch] = []
        self._waiting_rows = 0
        self._written_rows = 0

    @property
    def rows(self) -> int:
        """Events appended so far."""
        return self._written_rows + self._waiting_rows

    def append(self, batch: EventBatch) -> None:
        """Add events that are not earlier than those before."""
        self._waiting.append(batch)
        self._waiting_rows += len(batch)
        if self._waiting_rows >= EVENT_CHUNK_ROWS:
            self._write(self._waiting_rows - self._waiting_rows % EVENT_CHUNK_ROWS)

    def finish(self) -> None:
        """Write the rows that wait."""
        self._write(self._waiting_rows)

    def _write(self, rows: int) -> None:
        if rows == 0:
            return
        waiting = self._waiting
        columns = {
            "x": np.concatenate([batch.x for batch in waiting]),
            "y": np.concatenate([batch.y for batch in waiting]),
            "t": np.concatenate([batch.t_us for batch in waiting]),
            "p": np.concatenate([batch.p for batch in waiting]),
        }
        for name, dataset in self._columns.items():
            dataset.resize(self._written_rows + rows, axis=0)
            dataset[self._written_rows :] = columns[name][:rows]
        self._written_rows += rows
        self._waiting_rows -= rows
        self._waiting = [EventBatch(*(columns[name][rows:] for name in "xytp"))]


class IndexMap:
    """``searchsorted(events_t, timestamps, "left")``, computed batch by batch."""

    def __init__(self, timestamps_us: NDArray[np.int64]) -> None:
        self._timestamps_us = timestamps_us
        self._indices = np.empty(len(timestamps_us), dtype=np.int64)
        self._resolved = 0
        self._events = 0

    def append(self, times_us: NDArray[np.int64]) -> None:
        """Add the times of the next events (n,), us, not earlier than those before."""
        if len(times_us) == 0:
            return
        reached = int(np.searchsorted(self._timestamps_us, times_us[-1], side="right"))
        if reached > self._resolved:
            ready = slice(self._resolved, reached)
            self._indices[ready] = self._events + np.searchsorted(times_us, self._timestamps_us[ready], side="left")
            self._resolved = reached
        self._events += len(times_us)

    def finish(self) -> NDArray[np.int64]:
        """Return the index (frames,) of the earliest event not before each timestamp, or the number of events."""
        self._indices[self._resolved :] = self._events
        return self._indices


EVENT_ATTRIBUTES: Final = (
    *("model", "threshold_on", "threshold_off", "log_eps_dn", "initial_phase", "packet_interval_us"),
    *("threshold_sigma", "leak_rate_hz", "shot_rate_hz", "bandwidth_hz", "refractory_us", "hot_pixel_rate_hz"),
)


def write_root(file: h5py.File, scene: Scene, world: str) -> None:
    """Write format and origin of the sequence as attributes of the file."""
    _set(
        file,
        {
            "format": FORMAT_NAME,
            "format_version": FORMAT_VERSION,
            "sequence": scene.name,
            "world": world,
            "illumination": scene.light.name,
            "created_by": f"fedora-generate {generator_version()}",
            "scene_digest": scene.digest,
            "seed": scene.seed,
        },
    )


def write_camera(file: h5py.File, stream: str, camera: Camera) -> None:
    """Write the geometry of the camera of a stream: K in px, ``T_body_camera`` in metres, its lens, no exposure time.

    Parameters
    ----------
    stream
        ``rgb``, ``depth`` or ``events``.
    camera
        ``T_body_camera`` takes points of the optical frame into the body frame (X forward, Y left, Z up).
    """
    _set(
        file.require_group(f"metadata/cameras/{stream}"),
        {
            "width": camera.width,
            "height": camera.height,
            "K": camera.K,
            "T_body_camera": camera.T_body_camera,
            "exposure_us": 0.0,
            "camera_model": "pinhole",
        },
    )
    if camera.lens is not None:
        lens = {"distortion_model": camera.lens.model, "distortion": np.array(camera.lens.coefficients)}
        _set(file[f"metadata/cameras/{stream}"], lens)


def write_depth_range(file: h5py.File, scene: Scene) -> None:
    """Write the nearest and the farthest valid z-depth, metres."""
    write_dataset(file, "metadata/depth_range", np.array(scene.depth_range_m))


def write_events(file: h5py.File, scene: Scene, hot_pixels: NDArray[np.int64]) -> None:
    """Write the sensor model, its thresholds and its effects, in the units of ``EventSensorOptions``.

    Parameters
    ----------
    hot_pixels
        (n, 2) column and row; not written if there are none.
    """
    group = file.require_group("metadata/events")
    _set(group, {name: getattr(scene.events, name) for name in EVENT_ATTRIBUTES})
    _set(group, {"polarity": "1=brighter"})
    if scene.events.linear_below_dn:
        _set(group, {"linear_below_dn": scene.events.linear_below_dn})
    if len(hot_pixels):
        _set(group, {"hot_pixels": hot_pixels})


def write_imu(file: h5py.File, scene: Scene) -> None:
    """Write noise and gravity of the inertial unit.

    Densities are rad/s/sqrt(Hz) and m/s^2/sqrt(Hz), walks rad/s^2/sqrt(Hz) and m/s^3/sqrt(Hz), gravity m/s^2. Samples
    are instantaneous values, not averages over a sampling interval.
    """
    imu = scene.imu
    _set(
        file.require_group("metadata/imu"),
        {
            "gyro_noise_density": imu.gyro_noise_density,
            "accel_noise_density": imu.accel_noise_density,
            "gyro_bias_walk": imu.gyro_bias_walk,
            "accel_bias_walk": imu.accel_bias_walk,
            "gravity": imu.gravity_m_s2,
            "sampling": "instant",
        },
    )


def write_pose(file: h5py.File, scene: Scene) -> None:
    """Write the standard deviations of the pose per axis: position in the world, m; rotation in the body frame, rad."""
    _set(
        file.require_group("metadata/pose"),
        {"position_sigma": scene.pose.position_sigma_m, "rotation_sigma": scene.pose.rotation_sigma_rad},
    )


def write_flow(file: h5py.File, *, moves: bool) -> None:
    """Write unit and model of the flow: of a rigid world, or of one where objects move."""
    _set(file.require_group("metadata/flow"), {"unit": "px", "model": "scene" if moves else "rigid"})


def _set(owner: h5py.Group, attributes: Mapping[str, Any]) -> None:
    for name, value in attributes.items():
        owner.attrs[name] = value


def generator_version() -> str:
    """Return the version of the installed package."""
    try:
        return version("fedora-qa")
    except PackageNotFoundError:
        return "from source"
