"""The mean event rate of a long flight at the sensor's full size, from windows in time and columns of its pixels.

A pixel's events depend on no other pixel, so a share of the pixels is enough: strips from top to bottom of the image,
at random columns. A pixel that has just been switched on fires too much, by some 5% of its rate 0.1 s later and half as
much 0.2 s later (its reference is the signal itself, where one that has been running lags behind), so a window begins
``WARM_US`` before it counts. What is left is under 1%.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fedora_generator.camera import Camera, event_camera
from fedora_generator.events.sensor import EventSensor
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.sampling import FixedSteps
from fedora_generator.scene import Scene
from fedora_qa.conventions import NS_PER_US, US_PER_S
from tests.benchmarks.presets.windows import Windows

COUNTED_US: Final = 750_000
WARM_US: Final = 250_000

STRIPS: Final = 2
"""A window looks at a strip in each of so many equal parts of the image."""
STRIP_PX: Final = 4


@dataclass(frozen=True, slots=True)
class EventRate:
    """Events a second of the whole sensor, with its standard error, and the share of brighter ones."""

    events_s: float
    standard_error: float
    brighter: float


def part_of(camera: Camera, column: int, row: int, width: int, height: int) -> Camera:
    """Return the camera that has only these pixels of another."""
    K = camera.K.copy()
    K[:2, 2] -= column, row
    return replace(camera, width=width, height=height, K=K)


def random_strips(camera: Camera, rng: np.random.Generator) -> Iterator[Camera]:
    """One strip at random in each part of the image."""
    part_px = camera.width // STRIPS
    for part in range(STRIPS):
        column = part * part_px + int(rng.integers(part_px - STRIP_PX + 1))
        yield part_of(camera, column, 0, STRIP_PX, camera.height)


def count_events(
    scene: Scene, world: RenderedWorld, camera: Camera, start_us: int, counted_us: int = COUNTED_US
) -> tuple[int, int]:
    """Brighter and darker events of a camera's pixels within ``counted_us`` after ``start_us``."""
    first_us = max(0, start_us - WARM_US)
    times_us = np.append(first_us, FixedSteps(scene.event_step_us).times_us(first_us, start_us + counted_us))
    poses = camera.poses_at(scene.fly(), times_us)
    sensor = EventSensor(scene.events, camera.height, camera.width, np.random.SeedSequence(scene.seed))
    sensor.start(first_us * NS_PER_US, world.luma_dn(camera, poses[0]))
    brighter = darker = 0
    for time_us, T_world_camera in zip(times_us[1:].tolist(), poses[1:], strict=True):
        batch = sensor.advance(time_us * NS_PER_US, world.luma_dn(camera, T_world_camera))
        if time_us > start_us:
            bright = int(np.count_nonzero(batch.p))
            brighter, darker = brighter + bright, darker + len(batch) - bright
    return brighter, darker


def mean_event_rate(scene: Scene, world: RenderedWorld, windows: Windows, rng: np.random.Generator) -> EventRate:
    """Measure in every window, and take the mean over the flight."""
    camera = event_camera(scene.camera)
    rates = np.array([_rates(scene, world, camera, start_s, rng) for start_s in windows.starts_s.tolist()])
    events_s, standard_error = windows.mean(rates.sum(axis=1))
    return EventRate(events_s, standard_error, windows.mean(rates[:, 0])[0] / events_s)


def _rates(
    scene: Scene, world: RenderedWorld, camera: Camera, start_s: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Brighter and darker events a second of the whole sensor, as the strips have them."""
    start_us = round(start_s * US_PER_S / scene.event_step_us) * scene.event_step_us
    counts = [count_events(scene, world, strip, start_us) for strip in random_strips(camera, rng)]
    seen = STRIPS * STRIP_PX / camera.width * COUNTED_US / US_PER_S
    brighter, darker = (np.sum(counts, axis=0) / seen).tolist()
    return brighter, darker
