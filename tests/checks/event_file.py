"""A file of the closed-form event world, written by hand: colour frames, events and what they declare."""

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import R_BODY_OPTICAL
from tests.estimators.event_world import MS, Checkers, Stream, Waves, camera_matrix, linear_events, log_events

SHAPE, FRAME_SHAPE = (40, 56), (90, 126)
DURATION_MS = 800
LOG_WORLD = Waves(amplitude_dn=10.0, mean_dn=140.0, velocity_px_s=(200.0, 40.0), seed=3)
LINEAR_WORLD = replace(LOG_WORLD, velocity_px_s=(80.0, 30.0), amplitude_dn=16.0, mean_dn=128.0)
JUMPING_WORLD = replace(LOG_WORLD, velocity_px_s=(1050.0, 300.0), amplitude_dn=22.0, mean_dn=128.0, seed=9)
"""Moves by up to a quarter of its shortest wave in a rendered step."""
SMOOTH_WORLD = Waves(amplitude_dn=58.0, mean_dn=128.0, velocity_px_s=(300.0, 60.0), seed=1, count=2)
"""Two waves of high contrast, that show several events of 0.5 nat on end."""
SHARP_WORLD = Checkers(amplitude_dn=90.0, mean_dn=100.0, velocity_px_s=(130.0, 47.0))
"""Squares of 190 and 10 DN."""
FRAMES_NS = np.arange(0, DURATION_MS + 1, 20) * MS


@dataclass(frozen=True)
class EventFile:
    """Events and colour frames, and the declarations that differ from those of an ideal log sensor with C = 0.2."""

    events: Stream
    frames: NDArray[np.uint8]
    frames_ns: NDArray[np.int64] = field(default_factory=FRAMES_NS.copy)
    declared: tuple[tuple[str, Any], ...] = ()
    rgb_moved_m: float = 0.0

    def altered(self, **changes: Any) -> "EventFile":
        return replace(self, **changes)

    def declaring(self, **attributes: Any) -> "EventFile":
        return replace(self, declared=(*self.declared, *attributes.items()))

    def write(self, path: Path) -> Path:
        with h5py.File(path, "w") as file:
            file.attrs.update({"format": "fedora", "format_version": "1.0"})
            file["path/rgb"], file["path/rgb_ts"] = self.frames, self.frames_ns // 1000
            events = self.events
            file["path/events/x"], file["path/events/y"] = events.x, events.y
            file["path/events/t"], file["path/events/p"] = events.times_ns // 1000, events.p
            ideal = {"model": "log", "threshold_on": 0.2, "threshold_off": 0.2, "polarity": "1=brighter"}
            file.create_group("metadata/events").attrs.update(ideal | dict(self.declared))
            self._camera(file, "events", SHAPE, 0.0)
            self._camera(file, "rgb", FRAME_SHAPE, self.rgb_moved_m)
        return path

    def _camera(self, file: h5py.File, name: str, shape: tuple[int, int], moved_m: float) -> None:
        T_body_camera = np.eye(4)
        T_body_camera[:3, :3], T_body_camera[1, 3] = R_BODY_OPTICAL, moved_m
        file.create_group(f"metadata/cameras/{name}").attrs.update({
            "width": shape[1], "height": shape[0], "K": camera_matrix(shape[1], shape[0]),
            "T_body_camera": T_body_camera, "camera_model": "pinhole",
        })  # fmt: skip


def frames_of(world: Waves) -> NDArray[np.uint8]:
    """Grey frames, 8 bit, at 9/4 of the resolution."""
    luma = [world.luma(time_ns * 1e-9, FRAME_SHAPE, 2.25) for time_ns in FRAMES_NS]
    return np.clip(np.rint(luma), 0, 255).astype(np.uint8)[..., np.newaxis].repeat(3, axis=3)


@cache
def log_file(world: Waves = LOG_WORLD, threshold: float = 0.2) -> EventFile:
    """An ideal log sensor with thresholds in nat."""
    events = log_events(world, SHAPE, DURATION_MS * MS, threshold, threshold)
    return EventFile(events, frames_of(world)).declaring(threshold_on=threshold, threshold_off=threshold)


@cache
def linear_file(world: Waves = LINEAR_WORLD, threshold_dn: float = 6.0) -> EventFile:
    """A sensor of grey values with a step of 1 ms."""
    events = linear_events(world, SHAPE, DURATION_MS * MS, threshold=threshold_dn)
    clean = EventFile(events, frames_of(world))
    return clean.declaring(model="linear", threshold_on=threshold_dn, threshold_off=threshold_dn)


def inserted(events: Stream, new: Stream) -> Stream:
    """Both streams in the order of time."""
    columns = [np.concatenate([getattr(one, name) for one in (events, new)]) for name in ("x", "y", "times_ns", "p")]
    order = np.argsort(columns[2], kind="stable")
    return Stream(*(column[order] for column in columns))
