"""Memory: how much a sequence takes at its peak, and how much is available.

The numbers are measurements of the resident set, rounded up. Memory does not grow with the length of a
sequence, but for its timestamps.
"""

import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from fedora_generator.camera import CameraOptions, event_camera
from fedora_generator.errors import SceneError
from fedora_generator.events.options import EventSensorOptions
from fedora_generator.scene import Scene

_MB: Final = 1e6

# Bytes a pixel of the colour camera: radiance in float64 thrice (rendered, clipped, rounded) and what is stored of it.
_COLOUR_BYTES: Final = 80
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
    return frame_bytes + event_bytes + _COMPILED_BYTES + (_DRAWN_BYTES if drawn else 0)


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
