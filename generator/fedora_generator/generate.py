"""One walk over time that writes a sequence; memory does not grow with its length."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import colour_camera, event_camera
from fedora_generator.errors import SceneError
from fedora_generator.event_stream import EventRecorder
from fedora_generator.frames import create_frames
from fedora_generator.imu import sample_imu
from fedora_generator.instants import FRAME_RATE_HZ, IMU_RATE_HZ, POSE_RATE_HZ, stamps_us, whole_us
from fedora_generator.metadata import write_imu, write_pose, write_root
from fedora_generator.pose import sample_pose
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.sampling import MOTION_BOUND_PX, Quality
from fedora_generator.scene import Scene
from fedora_generator.surroundings import Surroundings, render_surroundings, surroundings_of
from fedora_generator.write import atomic_file, write_dataset
from fedora_qa.conventions import US_PER_S

STREAMS: Final = ("rgb", "depth", "events", "imu", "pose", "flow")

DEFAULT_DURATION_S: Final = 2.0

CHECKED_AT_ONCE: Final = 1 << 16

# Keys of the random streams: each sensor draws from its own, whatever else is generated.
_EVENTS_KEY, _IMU_KEY, _POSE_KEY = range(3)

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What to make of a scene: how long, which streams, how densely the events are rendered."""

    duration_s: float = DEFAULT_DURATION_S
    streams: frozenset[str] = frozenset(STREAMS)
    quality: Quality = "standard"

    def __post_init__(self) -> None:
        whole_us(self.duration_s)
        unknown = sorted(self.streams - set(STREAMS))
        if unknown or not self.streams:
            got = ", ".join(unknown) or "none"
            raise SceneError(f"Expected streams among {', '.join(STREAMS)}, got {got}")
        if self.quality not in MOTION_BOUND_PX:
            raise SceneError(f"Expected a quality among {', '.join(MOTION_BOUND_PX)}, got {self.quality!r}")


@dataclass(frozen=True, slots=True)
class Summary:
    """What was written."""

    frames: int
    events: int
    event_renders: int
    size_bytes: int


def generate_sequence(
    scene: Scene, target: Path, request: Request, *, overwrite: bool = False, progress: Progress = lambda _: None
) -> Summary:
    """Write the sequence of a scene to ``target``: all of it, or nothing.

    The same scene, seed and request give the same datasets, bit for bit, on any number of threads. ``progress`` is
    told the time that was reached, microseconds.

    Raises
    ------
    SceneError
        The flight meets the world, or the size is too small.
    GraphicsMissingError
        The scene is drawn by OpenGL, and there is none.
    OutputError
        The target exists and ``overwrite`` is false, or cannot be written.
    """
    duration_us = whole_us(request.duration_s)
    surroundings = surroundings_of(scene)
    _require_free_flight(scene, surroundings, duration_us)
    with atomic_file(target, overwrite=overwrite) as file:
        write_root(file, scene, surroundings.name)
        _write_samples(file, scene, duration_us, request.streams)
        world = render_surroundings(scene, surroundings, request.quality, _path_world_m(scene, duration_us))
        frames, events, renders = _walk(file, scene, world, duration_us, request, progress)
    return Summary(frames, events, renders, target.stat().st_size)


def require_free_flight(scene: Scene, duration_us: int) -> None:
    """Raise SceneError where the camera enters a solid or the ground, looked at every millisecond."""
    _require_free_flight(scene, surroundings_of(scene), duration_us)


def _require_free_flight(scene: Scene, surroundings: Surroundings, duration_us: int) -> None:
    event_camera(scene.camera)  # raises where it would have no pixel
    camera, flight = colour_camera(scene.camera), scene.fly()
    for times_us in _pieces(stamps_us(duration_us, IMU_RATE_HZ)):
        positions_world_m = camera.poses_at(flight, times_us)[:, :3, 3]
        collision = surroundings.collision(positions_world_m)
        if collision is not None:
            index, what = collision
            raise SceneError(
                f"Expected the camera to stay free of the world of {scene.name}, got {what} at "
                f"{times_us[index] / US_PER_S:g} s; shorten the sequence or change the flight"
            )


def _path_world_m(scene: Scene, duration_us: int) -> NDArray[np.float64]:
    """Positions (n, 3) of the camera at every frame."""
    poses = colour_camera(scene.camera).poses_at(scene.fly(), stamps_us(duration_us, FRAME_RATE_HZ))
    return np.asarray(poses[:, :3, 3])


def _pieces(times_us: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Cut times into pieces of bounded size."""
    return np.split(times_us, range(CHECKED_AT_ONCE, len(times_us), CHECKED_AT_ONCE))


def _walk(
    file: h5py.File, scene: Scene, world: RenderedWorld, duration_us: int, request: Request, progress: Progress
) -> tuple[int, int, int]:
    """Render frames and events in the order of time; return the numbers of frames, events and event renders."""
    stamps = stamps_us(duration_us, FRAME_RATE_HZ)
    frames = create_frames(file, scene, world, duration_us, request.streams)
    recorder = _event_recorder(file, scene, world, duration_us, request) if "events" in request.streams else None
    for index, stamp_us in enumerate(stamps.tolist()):
        if recorder is not None:
            recorder.run_to(stamp_us)
        frames.render(index, stamp_us)
        progress(stamp_us)
    if recorder is None:
        return len(stamps), 0, 0
    recorder.run_to(duration_us)
    recorder.finish()
    return len(stamps), recorder.events, recorder.renders


def _event_recorder(
    file: h5py.File, scene: Scene, world: RenderedWorld, duration_us: int, request: Request
) -> EventRecorder:
    stamps = stamps_us(duration_us, FRAME_RATE_HZ)
    sizes = {"rgb": "N", "depth": "D"}
    maps = {f"metadata/{name}_to_event": (size, stamps) for name, size in sizes.items() if name in request.streams}
    return EventRecorder(file, scene, world, request.quality, maps, _seed(scene, _EVENTS_KEY))


def _write_samples(file: h5py.File, scene: Scene, duration_us: int, streams: frozenset[str]) -> None:
    """Inertial and pose samples, which are small: all at once."""
    flight = scene.fly()
    if "imu" in streams:
        stamps = stamps_us(duration_us, IMU_RATE_HZ)
        imu = sample_imu(flight, stamps, scene.imu, np.random.default_rng(_seed(scene, _IMU_KEY)))
        write_dataset(file, "path/imu/angular_velocity", imu.angular_velocities_body_rad_s, M=len(stamps))
        write_dataset(file, "path/imu/linear_acceleration", imu.specific_forces_body_m_s2, M=len(stamps))
        write_dataset(file, "path/imu/ts", stamps, M=len(stamps))
        write_imu(file, scene)
    if "pose" in streams:
        stamps = stamps_us(duration_us, POSE_RATE_HZ)
        pose = sample_pose(flight, stamps, scene.pose, np.random.default_rng(_seed(scene, _POSE_KEY)))
        write_dataset(file, "path/pose/position", pose.positions_world_m, P=len(stamps))
        write_dataset(file, "path/pose/orientation", pose.orientations_xyzw, P=len(stamps))
        write_dataset(file, "path/pose/ts", stamps, P=len(stamps))
        write_pose(file, scene)


def _seed(scene: Scene, key: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(scene.seed, spawn_key=(key,))
