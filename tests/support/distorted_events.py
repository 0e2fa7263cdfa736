"""A sequence of the generator as a rectified data set has it: events of a distorted camera, all else of pinholes.

Three runs of one scene are joined: depth and flow of a pinhole, events of a camera with its centre that has a lens and
is turned by half a degree, and colour of a pinhole 5 cm beside. Each is rendered as it is; nothing is resampled.
"""

import math
from dataclasses import replace
from pathlib import Path
from shutil import copy
from typing import Any

import h5py

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.rates import RateOptions
from fedora_generator.scene import load_scene
from tests.support.event_view import LENSES

SIZE_PX = (240, 180)
"""Of events, depth and flow."""

_TO_EVENTS = 9 / 4
"""Size of the images of a scene over that of its events."""

_TURN_DEG, _BESIDE_M = 0.5, 0.05
_RATES = RateOptions(frames_hz=20.0, depth_hz=20.0, flow_hz=(10.0,))


def write_distorted_events(path: Path, name: str, duration_s: float = 1.0, size_px: tuple[int, int] = SIZE_PX) -> None:
    """Write a canonical file of a scene, with events through the lens ``radtan`` of ``LENSES``."""
    width, height = size_px
    scene = replace(load_scene(name), rates=_RATES)
    x_m, y_m, z_m = scene.camera.position_body_m
    cameras: dict[str, dict[str, Any]] = {
        "depth": {"width": width, "height": height},
        "events": {
            "width": round(_TO_EVENTS * width),
            "height": round(_TO_EVENTS * height),
            "pitch_deg": scene.camera.pitch_deg + _TURN_DEG,
            "distortion_model": "radtan",
            "distortion": LENSES["radtan"],
        },
        "rgb": {
            # Five quarters of them, and even.
            "width": 2 * math.ceil(5 / 8 * width),
            "height": 2 * math.ceil(5 / 8 * height),
            "position_body_m": (x_m, y_m - _BESIDE_M, z_m),
        },
    }
    streams = {"depth": {"depth", "flow"}, "events": {"events"}, "rgb": {"rgb"}}
    parts = {camera: path.with_name(f"{path.stem}-{camera}.h5") for camera in cameras}
    for camera, options in cameras.items():
        request = Request(duration_s=duration_s, quality="draft", streams=frozenset(streams[camera]))
        generate_sequence(replace(scene, camera=replace(scene.camera, **options)), parts[camera], request)
    copy(parts["depth"], path)
    with h5py.File(path, "r+") as file:
        for camera, keys in (("events", ("path/events", "metadata/events")), ("rgb", ("path/rgb", "path/rgb_ts"))):
            with h5py.File(parts[camera]) as part:
                for key in (*keys, f"metadata/cameras/{camera}"):
                    if key in file:
                        del file[key]
                    part.copy(key, file, name=key)
    for part_path in parts.values():
        part_path.unlink()
