"""Whole scenes against the finest sampling: which pixels have another sequence of events, and how far times differ."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.adaptive.follower import Follower
from fedora_generator.camera import event_camera
from fedora_generator.events.keys import EventBatch, KeyLayout, decode
from fedora_generator.events.sensor import Pixels
from fedora_generator.render import ExactWorld
from fedora_generator.sampling import Fidelity
from fedora_generator.scene import load_scene

FINEST: Final = Fidelity(motion_px=0.125, caution=128.0, tolerance_us=0.5)
SIZE: Final = (720, 540)
THRESHOLD: Final = 0.2
STEP_NS: Final = 20_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneRecording:
    """Events of a scene by pixel, and how often a pixel was rendered on average."""

    sequences: dict[int, tuple[bytes, NDArray[np.int64]]]
    """Polarities and stamps (us) of each pixel that fired"""
    events: int
    rendered: float


def record(name: str, fidelity: Fidelity, duration_ns: int) -> SceneRecording:
    """Follow the light of a scene from its start, with an ideal sensor."""
    scene = load_scene(name).with_size(*SIZE)
    if scene.world is None:
        raise ValueError(f"Expected a scene of the exact world, got {name}")
    world, camera, flight = ExactWorld.of(scene.world, scene.light), event_camera(scene.camera), scene.fly()
    signal = np.log(world.luma_dn(camera, camera.pose_at(flight, 0)))
    threshold = np.full((1, camera.width), THRESHOLD)
    pixels = Pixels(reference=signal.copy(), signal=signal, threshold_on=threshold, threshold_off=threshold)
    follower = Follower(world, camera, flight, fidelity)
    starts_ns = range(0, duration_ns, STEP_NS)
    keys = np.concatenate([follower.crossings(pixels, start_ns, start_ns + STEP_NS) for start_ns in starts_ns])
    events = decode(keys, KeyLayout(camera.height, camera.width), 0)
    return SceneRecording(
        sequences=_by_pixel(events, camera.width),
        events=len(events),
        rendered=follower.rendered_pixels / signal.size,
    )


def difference(recording: SceneRecording, finest: SceneRecording) -> tuple[int, float, float]:
    """Pixels with another sequence of polarities; RMS and largest difference of the stamps of all others, us."""
    every = set(recording.sequences) | set(finest.sequences)
    none = (b"", np.empty(0, np.int64))
    wrong = {k for k in every if recording.sequences.get(k, none)[0] != finest.sequences.get(k, none)[0]}
    same = every - wrong
    late_us = np.concatenate([recording.sequences[k][1] - finest.sequences[k][1] for k in same])
    return len(wrong), float(np.sqrt(np.mean(late_us.astype(float) ** 2))), float(np.abs(late_us).max())


def _by_pixel(events: EventBatch, width: int) -> dict[int, tuple[bytes, NDArray[np.int64]]]:
    pixels = events.y.astype(np.int64) * width + events.x
    order = np.argsort(pixels, kind="stable")  # each pixel's events stay in order of time
    numbers, starts = np.unique(pixels[order], return_index=True)
    polarities, timestamps_us = np.split(events.p[order], starts[1:]), np.split(events.t_us[order], starts[1:])
    return {number: (p.tobytes(), t) for number, p, t in zip(numbers.tolist(), polarities, timestamps_us, strict=True)}
