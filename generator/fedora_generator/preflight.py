"""What can be refused before any work: a target, a size or an option that no sequence can come of."""

from pathlib import Path
from typing import Final

from fedora_generator.camera import event_camera
from fedora_generator.errors import SceneError
from fedora_generator.memory import require_memory
from fedora_generator.mesh.context import open_context
from fedora_generator.partial_file import require_writable
from fedora_generator.room import least_bytes, require_room
from fedora_generator.scene import Scene

RENDERED_STREAMS: Final = frozenset({"rgb", "depth", "events", "flow"})
"""What shows the world; the others follow from the flight alone."""

_MOST_COLUMNS: Final = 1 << 16
"""Events are stored with 16 bits for the column and 16 for the row."""


def require_possible(scene: Scene, target: Path, duration_us: int, streams: frozenset[str], *, overwrite: bool) -> None:
    """Raise where it is plain that the sequence cannot be written; takes no time and little memory.

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
        _require_possible_events(scene, duration_us)
    require_memory(scene, streams)
    if scene.renderer == "mesh" and streams & RENDERED_STREAMS:
        open_context()
    require_room(target.resolve().parent, least_bytes(scene, duration_us, streams), "the sequence", "make room")


def _require_possible_events(scene: Scene, duration_us: int) -> None:
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
