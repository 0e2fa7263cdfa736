"""How much a corpus takes, and whether there is room for it."""

import shutil
from pathlib import Path
from typing import Final

from fedora_generator.camera import event_camera
from fedora_generator.errors import OutputError
from fedora_generator.instants import FRAME_RATE_HZ
from fedora_generator.scene import Scene
from fedora_qa.conventions import FLOW_RATES_HZ

_COLOUR_BYTES, _DEPTH_BYTES, _FLOW_BYTES = 3, 4, 8
_EVENTS_PER_PIXEL_S: Final = 10
_EVENT_BYTES: Final = 13
_COMPRESSED: Final = 0.6
"""Of a second of ``park-day`` at 270x200, 0.53 of the bytes are left; flow and depth hardly compress."""

_SPARE: Final = 1.05


def expected_bytes(scene: Scene, duration_s: float) -> int:
    """Estimate the size of one sequence from its images; events are guessed at, for only the light decides on them."""
    pixels = scene.camera.width * scene.camera.height
    frame_bytes = pixels * (_COLOUR_BYTES + _DEPTH_BYTES) * FRAME_RATE_HZ + pixels * _FLOW_BYTES * sum(FLOW_RATES_HZ)
    sensor = event_camera(scene.camera)
    event_bytes = sensor.width * sensor.height * _EVENTS_PER_PIXEL_S * _EVENT_BYTES
    return round(duration_s * (frame_bytes + event_bytes) * _COMPRESSED)


def require_room(folder: Path, needed_bytes: int) -> None:
    """Raise OutputError where the disk of a folder, which need not exist yet, has too little left."""
    there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    free_bytes = shutil.disk_usage(there).free
    if needed_bytes * _SPARE > free_bytes:
        raise OutputError(
            f"Expected {needed_bytes * _SPARE / 1e9:.2f} GB free for the corpus, got {free_bytes / 1e9:.2f} GB at "
            f"{there}; ask for fewer causes, rungs or scenes, or a smaller size"
        )
