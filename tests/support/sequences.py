"""Small generated sequences for integration tests, each made once a run."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import Scene, load_scene

CleanSequence = Callable[[str], Path]
"""Gives a clean sequence of a scene, by name."""

CLEAN_PART_S = {"exact": 0.6, "mesh": 0.3}
"""As short as still gives every check of most scenes, by renderer, the outcome of a second (of meshes half of one)."""

CLEAN_S = {"fast-turn": 1.0, "park-noisy": 1.0, "park-mesh-day": 0.75, "racetrack-mesh-day": 0.4}
"""In less there are too few fields with enough events, noise hides gravity, there is too little colour to tell red from
blue, or too few edges to tell a delay."""

CLEAN_SIZE_PX = {"exact": (270, 200), "mesh": (180, 136)}
"""Width and height of the frames of most scenes, by renderer."""

CLEAN_SIZES_PX = {
    **dict.fromkeys(("park-day", "racetrack", "fast-turn"), (198, 147)),
    "park-mesh-day": (270, 200),
}
"""Of the others: in smaller frames of these exact scenes each check has the outcome that it has in 270x200 pixels, or
passes where it could not tell. Faults of colour and of alignment are planted in the park of meshes, and need size."""

MESH_STEP_US = 4000
"""Least step between renders of a world of meshes, of which each takes 0.1 s. At an eighth of the full size an image
moves in 4 ms by half of the pixels that it moves in 1 ms at full size. Of the transfer of frames the racetrack tells
nothing in such steps; the park does, which is rendered as its motion asks."""


def small_scene(name: str, width: int = 270, height: int = 200) -> Scene:
    """Return a scene at a small size (the event sensor scales with it)."""
    scene = load_scene(name)
    if scene.renderer == "mesh" and scene.event_step_us:
        scene = replace(scene, event_step_us=max(scene.event_step_us, MESH_STEP_US))
    return replace(scene, camera=replace(scene.camera, width=width, height=height))


def make_sequence(target: Path, name: str, duration_s: float = 1.0, width: int = 270, height: int = 200) -> Path:
    """Write a small sequence of a scene."""
    generate_sequence(small_scene(name, width, height), target, Request(duration_s=duration_s, quality="draft"))
    return target
