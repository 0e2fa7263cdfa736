"""Disk space: how much a sequence takes, and whether as much is free."""

import shutil
from pathlib import Path
from typing import Final

from fedora_generator.camera import event_camera
from fedora_generator.errors import OutputError
from fedora_generator.scene import Scene
from fedora_qa.conventions import US_PER_S

_COLOUR_BYTES, _DEPTH_BYTES, _FLOW_BYTES = 3, 4, 8
_EVENTS_PER_PIXEL_S: Final = 10
_EVENT_BYTES: Final = 13
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
    scene
        Its image sizes.
    duration_s
        Length of the sequence, s.
    streams
        Those that are written; only images and events count.
    """
    sensor = event_camera(scene.camera)
    event_bytes = sensor.width * sensor.height * _EVENTS_PER_PIXEL_S * _EVENT_BYTES if "events" in streams else 0
    return round(duration_s * (_image_bytes_a_second(scene, streams) + event_bytes) * _COMPRESSED)


def least_bytes(scene: Scene, duration_us: int, streams: frozenset[str]) -> int:
    """Smallest size of a sequence, bytes: that of images of a single colour.

    Parameters
    ----------
    scene
        Its image sizes.
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
    colour = _COLOUR_BYTES * rates.frames_hz * ("rgb" in streams)
    depth = _DEPTH_BYTES * rates.of_depth_hz * ("depth" in streams)
    return round(pixels * (colour + depth + _FLOW_BYTES * sum(rates.flow_hz) * ("flow" in streams)))


def _free_bytes(folder: Path) -> tuple[Path, int]:
    """Return the folder, or the nearest parent that exists, and the free bytes of its disk."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    return existing, shutil.disk_usage(existing).free


def _size_text(size_bytes: float) -> str:
    return f"{size_bytes / 1e9:.2f} GB" if size_bytes >= 1e7 else f"{size_bytes / 1e6:.2f} MB"
