"""Kinds of correct files: each a scene, a place in its flight, streams, a length, and what is done to the stamps.

Worlds without noise are the same for every seed, so that the files of a combination begin at different places of the
flight as well.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import h5py
import numpy as np

from fedora_generator.choices import STREAMS, Quality
from fedora_generator.flight import FlightOptions, HarmonicTerm
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import Scene, load_scene
from fedora_qa.layout.canonical import DATASETS
from tests.benchmarks.timing_scenes import NOON, SWAY, wall_of

SIZE: Final = (270, 200)
EPOCH_US: Final = 1_790_000_000_000_000
"""September 2026: wall-clock stamps, near 2^51."""

INERTIAL: Final = frozenset({"imu", "pose"})

SceneOf = Callable[[int], Scene]


@dataclass(frozen=True, slots=True, kw_only=True)
class Combination:
    """One kind of correct file.

    Attributes
    ----------
    name
        In the table.
    scene
        The scene of the n-th file.
    duration_s, streams, files
        Length and streams of each; how many of them a whole study makes.
    quality
        Of the events. Drafts of a fast turn stamp some of them badly enough for that to be found.
    epoch
        Whether stamps are wall-clock time.
    drop_streams
        Whether each file lacks other streams, drawn by its number.
    """

    name: str
    scene: SceneOf
    duration_s: float = 1.0
    streams: frozenset[str] = frozenset(STREAMS)
    files: int = 12
    quality: Quality = "draft"
    epoch: bool = False
    drop_streams: bool = False

    def write(self, number: int, target: Path) -> None:
        """Write the n-th file of this kind."""
        streams = self._streams(number)
        request = Request(duration_s=self.duration_s, streams=streams, quality=self.quality)
        generate_sequence(self.scene(number), target, request, overwrite=True)
        if self.epoch:
            _move_to_epoch(target)

    def _streams(self, number: int) -> frozenset[str]:
        if not self.drop_streams:
            return self.streams
        rng = np.random.default_rng(number)
        kept = [name for name in STREAMS if rng.random() < 0.6]
        return frozenset(kept or ["events"])


def along(name: str, *, step_s: float, first_s: float = 0.0, **changes: float) -> SceneOf:
    """Return a scene of the package that begins ``step_s`` later from file to file; ``changes`` are to its events."""

    def scene(number: int) -> Scene:
        there = load_scene(name).with_size(*SIZE)
        events = replace(there.events, **changes)  # type: ignore[arg-type]
        return replace(there, seed=number, events=events).starting_at(first_s + step_s * number)

    return scene


def _wall(texture: str, **changes: float) -> SceneOf:
    def scene(number: int) -> Scene:
        park = load_scene("park-day").with_size(*SIZE)
        events = replace(park.events, **changes)  # type: ignore[arg-type]
        world = wall_of(texture)
        return replace(park, world=world, light=NOON, flight=SWAY, events=events, seed=number, start_s=0.05 * number)

    return scene


def _bursts(number: int) -> Scene:
    """Yaw to and fro at up to 10 rad/s."""
    park = load_scene("park-day").with_size(*SIZE)
    yaw = HarmonicTerm(axis="yaw", amplitude=48.0, frequency_hz=2.0, phase_deg=30.0 * number)
    return replace(park, flight=FlightOptions(position_m=(0.0, 0.0, 1.7), terms=(yaw,)), seed=number)


def _noisy_survey(number: int) -> Scene:
    """A minute of a survey flight with IMU and pose as noisy as those of park-noisy."""
    noisy = load_scene("park-noisy")
    survey = replace(load_scene("baylands-day1").with_size(*SIZE), imu=noisy.imu, pose=noisy.pose, seed=number)
    return survey.starting_at(4.0 * number)


def _small(name: str) -> SceneOf:
    def scene(number: int) -> Scene:
        return replace(load_scene(name).with_size(90, 68), seed=number).starting_at(0.3 * number)

    return scene


COMBINATIONS: Final = (
    Combination(name="park-day", scene=along("park-day", step_s=2.3), files=16),
    Combination(name="park-day, half a second", scene=along("park-day", step_s=2.4), duration_s=0.5, files=16),
    Combination(name="park-day, wall-clock stamps", scene=along("park-day", step_s=3.1), epoch=True),
    Combination(name="park-day, some streams", scene=along("park-day", step_s=1.6), drop_streams=True, files=24),
    Combination(name="park-day, C = 0.1", scene=along("park-day", step_s=3.0, threshold_on=0.1, threshold_off=0.1)),
    Combination(name="park-day, C = 0.5", scene=along("park-day", step_s=3.2, threshold_on=0.5, threshold_off=0.5)),
    Combination(
        name="park-day, C+ 0.25, C- 0.15", scene=along("park-day", step_s=2.9, threshold_on=0.25, threshold_off=0.15)
    ),
    Combination(name="park-night", scene=along("park-night", step_s=2.3), files=16),
    Combination(name="hover", scene=along("hover", step_s=3.3)),
    Combination(name="fast-turn", scene=along("fast-turn", step_s=0.37)),
    Combination(name="bursts of 10 rad/s", scene=_bursts, quality="standard"),
    Combination(name="park-noisy", scene=along("park-noisy", step_s=1.6), files=24),
    Combination(name="park-noisy, half a second", scene=along("park-noisy", step_s=2.4), duration_s=0.5, files=16),
    Combination(
        name="noisy IMU and pose, 60 s",
        scene=_noisy_survey,
        duration_s=60.0,
        streams=INERTIAL,
        files=24,
    ),
    Combination(name="park-traffic", scene=along("park-traffic", step_s=0.6)),
    Combination(name="smooth wall", scene=_wall("smooth")),
    Combination(name="sharp wall", scene=_wall("sharp")),
    Combination(name="racetrack (linear)", scene=along("racetrack", step_s=0.9), files=16),
    Combination(name="baylands-day1 (linear)", scene=along("baylands-day1", step_s=12.0)),
    Combination(name="baylands-day2 (linear)", scene=along("baylands-day2", step_s=17.0)),
    Combination(name="baylands-ngt1 (linear)", scene=along("baylands-ngt1", step_s=12.0)),
    Combination(name="racetrack-day (linear)", scene=along("racetrack-day", step_s=8.0)),
    Combination(name="racetrack-ngt (linear)", scene=along("racetrack-ngt", step_s=8.0)),
    Combination(name="hover, 90x68, 60 s", scene=_small("hover"), duration_s=60.0, files=2),
    Combination(name="park-mesh-day", scene=along("park-mesh-day", step_s=0.5), duration_s=0.5, files=4),
    Combination(name="park-mesh-night", scene=along("park-mesh-night", step_s=0.5), duration_s=0.5, files=4),
    Combination(
        name="racetrack-mesh-day (linear)", scene=along("racetrack-mesh-day", step_s=0.5), duration_s=0.5, files=4
    ),
    Combination(name="racetrack-mesh-night", scene=along("racetrack-mesh-night", step_s=0.5), duration_s=0.5, files=4),
)
"""Every kind, about 350 files together."""


def _move_to_epoch(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        for key, spec in DATASETS.items():
            if spec.is_timestamps and key in file:
                file[key][...] = file[key][...] + EPOCH_US
