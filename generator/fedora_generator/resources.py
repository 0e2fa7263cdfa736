"""Memory and disk space: how much a sequence takes, and how much is available.

Memory: how much a sequence takes at its peak, and how much is available.

The numbers are measurements of the resident set, rounded up. Memory does not grow with the length of a
sequence, but for its timestamps.
"""

import resource
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from fedora_generator.camera import CameraOptions, event_camera
from fedora_generator.errors import OutputError, SceneError
from fedora_generator.events.options import EventSensorOptions
from fedora_generator.scene import Scene
from fedora_qa.conventions import US_PER_S

_MB: Final = 1e6

# Bytes a pixel of the colour camera: radiance in float64 thrice (rendered, clipped, rounded) and what is stored of it.
_COLOUR_BYTES: Final = 80
_WAITING_BYTES: Final = 128 * _MB  # images that wait to be compressed, and what has been compressed of others
_DEPTH_BYTES: Final = 40  # inverse depth twice, depth, and flow as it is computed and stored
_OPENGL_BYTES: Final = 80  # beyond these, of images in the memory of OpenGL and on their way from it

_EVENT_PIXEL_BYTES: Final = 200  # reference, signals, thresholds, effects, and the renders between which events lie
_EVENT_BYTES: Final = 64  # of an event that no motion causes, while it is sorted and decoded
_SPURIOUS_BLOCK_S, _LONGEST_STEP_S = 0.05, 0.02

_NARROWEST: Final = 64
"""Where not even this width fits, a smaller size is no remedy."""

_COMPILED_BYTES: Final = 100 * _MB  # kernels as they are loaded
_DRAWN_BYTES: Final = 700 * _MB  # drivers, meshes and textures of a mesh world, and its supersampled band of an image


def peak_bytes(scene: Scene, streams: frozenset[str]) -> float:
    """Estimate the memory that generating takes beyond what the process has already, an upper estimate."""
    pixels = scene.camera.width * scene.camera.height
    drawn = scene.renderer == "mesh"
    images = [_COLOUR_BYTES] * ("rgb" in streams) + [_DEPTH_BYTES] * bool({"depth", "flow"} & streams)
    frame_bytes = pixels * (max(images, default=0) + (_OPENGL_BYTES if drawn and images else 0))
    pixel_bytes = _event_pixels(scene.camera) * _EVENT_PIXEL_BYTES
    event_bytes = pixel_bytes + _spurious_bytes(scene.camera, scene.events) if "events" in streams else 0.0
    waiting_bytes = _WAITING_BYTES if images else 0.0
    return frame_bytes + waiting_bytes + event_bytes + _COMPILED_BYTES + (_DRAWN_BYTES if drawn else 0)


def _event_pixels(camera: CameraOptions) -> int:
    sensor = event_camera(camera)
    return sensor.width * sensor.height


def _spurious_bytes(camera: CameraOptions, events: EventSensorOptions) -> float:
    """Bytes of the events that no motion causes, as many as are in memory at once."""
    pixels = _event_pixels(camera)
    drawn_hz = events.shot_rate_hz * pixels + events.hot_pixel_rate_hz * events.hot_pixel_count
    at_once = drawn_hz * _SPURIOUS_BLOCK_S + events.leak_rate_hz * pixels * _LONGEST_STEP_S
    return at_once * _EVENT_BYTES


def require_memory(scene: Scene, streams: frozenset[str]) -> None:
    """Raise SceneError where generating would take more memory than is available."""
    needed, available = peak_bytes(scene, streams), available_bytes()
    if needed <= available:
        return
    if fitting := _fitting_size(scene, streams, available):
        remedy = f"use --size {fitting}, or fewer streams"
    elif "events" in streams and _spurious_bytes(scene.camera, scene.events) > available:
        remedy = "lower the rates of events that nothing causes"
    else:
        remedy = "free some, or raise its limit"
    raise SceneError(
        f"Expected at most {available / _MB:.0f} MB of memory, which is free, got {scene.camera.width}x"
        f"{scene.camera.height} of {', '.join(sorted(streams))}, which takes about {needed / _MB:.0f} MB; "
        f"{remedy}"
    )


def _fitting_size(scene: Scene, streams: frozenset[str], available: float) -> str:
    """Return the widest WIDTHxHEIGHT of the same shape that fits, or nothing."""
    fits, too_wide = 0, scene.camera.width
    while too_wide - fits > 1:
        width = (fits + too_wide) // 2
        height = max(3, round(width * scene.camera.height / scene.camera.width))
        if width >= _NARROWEST and peak_bytes(scene.with_size(width, height), streams) > available:
            too_wide = width
        else:
            fits = width
    height = max(3, round(fits * scene.camera.height / scene.camera.width))
    return f"{fits}x{height}" if fits >= _NARROWEST else ""


def available_bytes() -> float:
    """Memory that this process can still get, by the machine, its cgroup and its limits; infinite where unknown."""
    available = [*_kilobytes(Path("/proc/meminfo"), "MemAvailable"), *of_the_cgroups()]
    for limit, used in ((resource.RLIMIT_AS, "VmSize"), (resource.RLIMIT_DATA, "VmData")):
        most, _ = resource.getrlimit(limit)
        if most != resource.RLIM_INFINITY:
            available += [most - bytes_used for bytes_used in _kilobytes(Path("/proc/self/status"), used)]
    return min(available, default=float("inf"))


def _kilobytes(path: Path, name: str) -> Iterator[float]:
    """Yield the value of a line ``name: 123 kB``."""
    for line in _text(path).splitlines():
        key, _, value = line.partition(":")
        if key == name:
            yield 1024.0 * int(value.split()[0])


def of_the_cgroups(
    root: Path = Path("/sys/fs/cgroup"), membership: Path = Path("/proc/self/cgroup")
) -> Iterator[float]:
    """Yield what each memory limit above this process leaves, page cache that can be dropped not counted as used."""
    for line in _text(membership).splitlines():
        number, controllers, path = line.split(":", 2)
        if number == "0":
            files = ("", "memory.max", "memory.current", "inactive_file")
        elif controllers == "memory":
            files = ("memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        top, limit, usage, cache = root / files[0], *files[1:]
        group = top / path.lstrip("/")
        for folder in (group, *group.parents):
            if folder.is_relative_to(top) and (most := _text(folder / limit).strip()).isdigit():
                used = int(_text(folder / usage) or 0)
                droppable = dict(line.split() for line in _text(folder / "memory.stat").splitlines()).get(cache, 0)
                yield float(int(most) - used + int(droppable))


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""


_STORED_COLOUR_BYTES, _STORED_DEPTH_BYTES, _FLOW_BYTES = 3, 4, 8
_EVENTS_PER_PIXEL_S: Final = 10
_STORED_EVENT_BYTES: Final = 13
_COMPRESSED: Final = 0.6
"""Of a second of ``park-day`` at 270x200, 0.53 of the bytes are left; flow and depth hardly compress."""

_BEST_COMPRESSION: Final = 8192
"""Images of one colour reach 7600 at 1440x1080, whatever they show; the least that a sequence takes follows from it."""

ALL_STREAMS: Final = frozenset({"rgb", "depth", "events", "flow"})

_SPARE: Final = 1.05


def expected_bytes(scene: Scene, duration_s: float, streams: frozenset[str] = ALL_STREAMS) -> int:
    """Estimate the size of one sequence from its images; its events are a rough guess, as they depend on the light.

    Parameters
    ----------
    duration_s
        Length of the sequence, s.
    streams
        Those that are written; only images and events count.
    """
    sensor = event_camera(scene.camera)
    event_bytes = sensor.width * sensor.height * _EVENTS_PER_PIXEL_S * _STORED_EVENT_BYTES if "events" in streams else 0
    return round(duration_s * (_image_bytes_a_second(scene, streams) + event_bytes) * _COMPRESSED)


def least_bytes(scene: Scene, duration_us: int, streams: frozenset[str]) -> int:
    """Smallest size of a sequence, bytes: that of images of a single colour.

    Parameters
    ----------
    duration_us
        Length of the sequence, us.
    streams
        Those that are written; only images count.
    """
    return round(_image_bytes_a_second(scene, streams) * duration_us / US_PER_S / _BEST_COMPRESSION)


def require_disk_space(folder: Path, needed_bytes: int, what: str, remedy: str) -> None:
    """Raise OutputError where the disk of a folder has too little space for a file.

    Parameters
    ----------
    folder
        Need not exist yet; then its nearest parent that exists decides.
    needed_bytes
        Size of the file; 5% more must be free.
    what, remedy
        What is written, and what to do about it: words of the error.

    Raises
    ------
    OutputError
        The disk has less free than that, or nothing.
    """
    existing, free_bytes = _free_bytes(folder)
    if needed_bytes * _SPARE > free_bytes or free_bytes == 0:
        raise OutputError(
            f"Expected {_size_text(needed_bytes * _SPARE)} free for {what}, got {_size_text(free_bytes)} "
            f"at {existing}; {remedy}"
        )


def shortage_warning(folder: Path, expected: int) -> str:
    """Return a warning where a sequence of ``expected`` bytes would fill the disk of a folder; else an empty text."""
    existing, free_bytes = _free_bytes(folder)
    if expected <= free_bytes:
        return ""
    return (
        f"about {_size_text(expected)} are expected, and {_size_text(free_bytes)} are free at {existing}; "
        "should the disk fill up, nothing is left of the sequence"
    )


def _image_bytes_a_second(scene: Scene, streams: frozenset[str]) -> int:
    pixels, rates = scene.camera.width * scene.camera.height, scene.rates
    colour = _STORED_COLOUR_BYTES * rates.frames_hz * ("rgb" in streams)
    depth = _STORED_DEPTH_BYTES * rates.of_depth_hz * ("depth" in streams)
    return round(pixels * (colour + depth + _FLOW_BYTES * sum(rates.flow_hz) * ("flow" in streams)))


def _free_bytes(folder: Path) -> tuple[Path, int]:
    """Return the folder, or the nearest parent that exists, and the free bytes of its disk."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    return existing, shutil.disk_usage(existing).free


def _size_text(size_bytes: float) -> str:
    return f"{size_bytes / 1e9:.2f} GB" if size_bytes >= 1e7 else f"{size_bytes / 1e6:.2f} MB"
