"""One walk over time that writes a sequence; memory does not grow with its length."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import h5py
import numpy as np

from fedora_generator.camera import colour_camera, event_camera
from fedora_generator.choices import DEFAULT_DURATION_S, STREAMS, Quality
from fedora_generator.errors import SceneError
from fedora_generator.events.stream import EventRecorder
from fedora_generator.mesh.context import open_context
from fedora_generator.partial_file import partial_file, require_writable
from fedora_generator.rates import pieces, timestamps_us, whole_us
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.resources import expected_bytes, least_bytes, require_disk_space, require_memory, shortage_warning
from fedora_generator.sampling import MOTION_BOUND_PX
from fedora_generator.scene import Scene
from fedora_generator.streams import create_frames, write_imu_stream, write_pose_stream
from fedora_generator.surroundings import Surroundings, render_surroundings, surroundings_of
from fedora_generator.threads import thread_count
from fedora_generator.write import write_root
from fedora_qa.conventions import US_PER_S
from fedora_qa.errors import did_you_mean
from fedora_qa.layout.direct_chunks import ChunkWriter

RENDERED_STREAMS: Final = frozenset({"rgb", "depth", "events", "flow"})
"""Streams that are images of the world; the others follow from the flight alone."""

_MOST_COLUMNS: Final = 1 << 16
"""Events are stored with 16 bits for the column and 16 for the row."""

# Keys of the random streams: each sensor draws from its own, whatever else is generated.
_EVENTS_KEY, _IMU_KEY, _POSE_KEY = range(3)

_COLLISION_HZ: Final = 1000
"""How often the flight is tested for collisions."""

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What to generate of a scene: how long, which streams, how densely the events are rendered."""

    duration_s: float = DEFAULT_DURATION_S
    streams: frozenset[str] = frozenset(STREAMS)
    quality: Quality = "standard"

    def __post_init__(self) -> None:
        whole_us(self.duration_s)
        unknown = sorted(self.streams - set(STREAMS))
        if unknown or not self.streams:
            got = ", ".join(unknown) or "none"
            hint = did_you_mean(unknown[0], STREAMS) if unknown else ""
            raise SceneError(f"Expected streams among {', '.join(STREAMS)}, got {got}{hint}")
        if self.quality not in MOTION_BOUND_PX:
            raise SceneError(f"Expected a quality among {', '.join(MOTION_BOUND_PX)}, got {self.quality!r}")


@dataclass(frozen=True, slots=True)
class Summary:
    """What was written."""

    frames: int
    events: int
    size_bytes: int


def generate_sequence(
    scene: Scene,
    target: Path,
    request: Request,
    *,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
    warn: Callable[[str], None] = lambda _: None,
) -> Summary:
    """Write the sequence of a scene to ``target``: all of it, or nothing.

    The same scene, seed and request give the same datasets, bit for bit, on any number of threads.

    Parameters
    ----------
    scene
        With its seed.
    request
        Duration, streams and quality.
    overwrite
        Whether the target may exist.
    progress
        Called with the time that was reached, us.
    warn
        Called, before any work, with a sentence where the disk may be too small.

    Raises
    ------
    SceneError
        The flight meets or leaves the world, or the size does not fit the sensors or the memory.
    GraphicsMissingError
        The scene is drawn by OpenGL, and there is none.
    OutputError
        The target exists and ``overwrite`` is false, or cannot be written; or the disk is full.
    """
    duration_us = whole_us(request.duration_s)
    require_possible(scene, target, duration_us, request.streams, overwrite=overwrite)
    drawn = bool(request.streams & RENDERED_STREAMS)
    surroundings = surroundings_of(scene, drawn=drawn)
    _require_free_flight(scene, surroundings, duration_us)
    if warning := shortage_warning(target.parent, expected_bytes(scene, request.duration_s, request.streams)):
        warn(warning)

    def report(time_us: int) -> None:  # a failed write or an interrupt ends the walk here
        partial.raise_pending()
        progress(time_us)

    # Whole chunks are written once: a cache of them would only fill, up to 1 MB a dataset.
    with partial_file(target, overwrite=overwrite) as partial, h5py.File(partial, "w", rdcc_nbytes=0) as file:
        write_root(file, scene, surroundings.name)
        if "imu" in request.streams:
            write_imu_stream(file, scene, duration_us, _seed(scene, _IMU_KEY))
        if "pose" in request.streams:
            write_pose_stream(file, scene, duration_us, _seed(scene, _POSE_KEY))
        frames, events = 0, 0
        if drawn:
            # Positions (frames, 3) of the camera, near which textures must be fine.
            camera, flight = colour_camera(scene.camera), scene.fly()
            frames_us = pieces(timestamps_us(duration_us, max(scene.rates.frames_hz, scene.rates.of_depth_hz)))
            path_world_m = np.concatenate([camera.poses_at(flight, times_us)[:, :3, 3] for times_us in frames_us])
            world = render_surroundings(scene, surroundings, request.quality, path_world_m)
            with ChunkWriter(thread_count()) as chunks:
                frames, events = _walk(file, chunks, scene, world, duration_us, request, report)
    return Summary(frames, events, target.stat().st_size)


def require_possible(scene: Scene, target: Path, duration_us: int, streams: frozenset[str], *, overwrite: bool) -> None:
    """Raise where the request alone shows that the sequence cannot be written; takes no time and little memory.

    Parameters
    ----------
    scene
        Its size, sensors and renderer.
    duration_us
        Length of the sequence, us.
    streams
        Those that are written.
    overwrite
        Whether the target may exist.

    Raises
    ------
    SceneError
        The sensors do not fit the size or the duration, or the size does not fit the memory.
    OutputError
        The target cannot be written, or the disk is full.
    GraphicsMissingError
        The scene is drawn by OpenGL, and there is none.
    """
    require_writable(target, overwrite=overwrite)
    if "events" in streams:
        camera = event_camera(scene.camera)
        if max(camera.width, camera.height) > _MOST_COLUMNS:
            raise SceneError(
                f"Expected an event camera of at most {_MOST_COLUMNS} columns and rows, got "
                f"{camera.width}x{camera.height}; use a smaller --size"
            )
        if scene.events.hot_pixel_count > camera.width * camera.height:
            raise SceneError(
                f"Expected hot_pixel_count up to the {camera.width * camera.height} pixels of the event camera, got "
                f"{scene.events.hot_pixel_count}; lower it or use a larger --size"
            )
        if scene.event_step_us > duration_us:
            raise SceneError(
                f"Expected a duration of at least one event_step_us, {scene.event_step_us} us, got {duration_us} us"
            )
    require_memory(scene, streams)
    if scene.renderer == "mesh" and streams & RENDERED_STREAMS:
        open_context()
    require_disk_space(target.resolve().parent, least_bytes(scene, duration_us, streams), "the sequence", "make room")


def require_free_flight(scene: Scene, duration_us: int) -> None:
    """Raise SceneError where the camera enters a solid or the ground, at any millisecond."""
    _require_free_flight(scene, surroundings_of(scene), duration_us)


def _require_free_flight(scene: Scene, surroundings: Surroundings, duration_us: int) -> None:
    event_camera(scene.camera)  # raises where it would have no pixel
    camera, flight = colour_camera(scene.camera), scene.fly()
    for times_us in pieces(timestamps_us(duration_us, _COLLISION_HZ)):
        positions_world_m = camera.poses_at(flight, times_us)[:, :3, 3]
        if not np.isfinite(positions_world_m).all():
            raise SceneError(f"Expected a flight through places that are finite, got one of {scene.name} that is not")
        collision = surroundings.collision(positions_world_m, times_us / US_PER_S)
        if collision is not None:
            index, what = collision
            raise SceneError(
                f"Expected the camera to stay in the open world of {scene.name}, got {what} at "
                f"{times_us[index] / US_PER_S:g} s; shorten the sequence or change the flight"
            )


def _walk(
    file: h5py.File,
    chunks: ChunkWriter,
    scene: Scene,
    world: RenderedWorld,
    duration_us: int,
    request: Request,
    progress: Progress,
) -> tuple[int, int]:
    """Render frames and events in the order of time; return the numbers of frames and events."""
    frames = create_frames(file, chunks, scene, world, duration_us, request.streams)
    recorder: EventRecorder | None = None
    if "events" in request.streams:
        of_frames = (("rgb", "N", frames.rgb_us), ("depth", "D", frames.depth_us))
        maps = {f"metadata/{name}_to_event": (size, us) for name, size, us in of_frames if name in request.streams}
        recorder = EventRecorder(file, scene, world, request.quality, maps, _seed(scene, _EVENTS_KEY))
    instants_us = frames.instants_us.tolist()
    for timestamp_us in instants_us:
        if recorder is not None:
            recorder.run_to(timestamp_us)
        frames.render(timestamp_us)
        progress(timestamp_us)
    chunks.finish()
    if recorder is None:
        return len(instants_us), 0
    recorder.run_to(duration_us)
    recorder.finish()
    return len(instants_us), recorder.events


def _seed(scene: Scene, key: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(scene.seed, spawn_key=(key,))
