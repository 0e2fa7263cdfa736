"""The flights that are learned from: independent ones of two kinds, split by place.

Both kinds move through one world, in one light, before one sensor, so that only the motion differs. *Flying* is any
second of the paper's first two sequences, in gusts of its own: six degrees of freedom, up to 5 m/s. *Driving* is the
scene ``racetrack-drive`` on the same avenue, planar position and yaw; speed, lane, direction and sway are drawn.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from fedora_generator.errors import SceneError
from fedora_generator.flight import FlightOptions, HarmonicTerm
from fedora_generator.flights.gusts import WindOptions
from fedora_generator.flights.kinds import LoopOptions
from fedora_generator.generate import Request, generate_sequence, require_free_flight
from fedora_generator.scene import Scene, load_scene
from fedora_qa.conventions import US_PER_S
from tests.benchmarks.learning.budget import COLOUR_SIZE, FLIGHT_S

MotionKind = Literal["flying", "driving"]
Split = Literal["train", "validation", "test"]

MOTION_KINDS: Final[tuple[MotionKind, ...]] = ("flying", "driving")
SPLITS: Final[tuple[Split, ...]] = ("train", "validation", "test")

STREAMS: Final = frozenset({"events", "depth", "flow", "pose"})

REGIONS_M: Final[dict[Split, tuple[float, float]]] = {
    "train": (-7.0, 44.0),
    "validation": (-7.0, 44.0),
    "test": (47.0, 71.0),
}
"""Where along the avenue a flight may be, east in m: test flights are over ground that no other flight crosses."""

THRESHOLD: Final = 0.3
"""Contrast threshold of the log sensor, nat: some ten events a pixel and second."""

WIND_M_S: Final = 4.0
"""Mean wind at 20 ft, with Dryden gusts. In a calm a quadrotor on a straight leg does not turn at all."""

_FLOWN: Final = ("baylands-day1", "baylands-day2")
_DRIVEN: Final = "racetrack-drive"
_SPEEDS_M_S: Final = (6.0, 14.0)
_LANES_M: Final = (-1.0, 1.0)
_SWAY_M: Final = (0.1, 0.5)
_SWAY_HZ: Final = (0.1, 0.4)
_MOST_DRAWS: Final = 1000


@dataclass(frozen=True, slots=True)
class FlightDraw:
    """One flight: the ``number``-th of its kind and split. ``threshold_gain`` multiplies the contrast thresholds."""

    kind: MotionKind
    split: Split
    number: int
    threshold_gain: float = 1.0

    @property
    def name(self) -> str:
        """Name of its file, without a suffix."""
        gain = "" if self.threshold_gain == 1 else f"-thresholds-x{self.threshold_gain:g}"
        return f"{self.kind}-{self.split}-{self.number}{gain}"

    def scene(self) -> Scene:
        """Return the scene, drawn until the camera stays within the split's region and in the open."""
        rng = np.random.default_rng([MOTION_KINDS.index(self.kind), SPLITS.index(self.split), self.number])
        low_m, high_m = REGIONS_M[self.split]
        for _ in range(_MOST_DRAWS):
            flying = self.kind == "flying"
            drawn = _draw_flying(rng, self.number) if flying else _draw_driving(rng, (low_m, high_m))
            scene = self._before_sensor(drawn)
            east_m = scene.fly().states_at(np.linspace(0.0, FLIGHT_S, 11)).positions_world_m[:, 0]
            if east_m.min() < low_m or east_m.max() > high_m:
                continue
            try:
                require_free_flight(scene, round(FLIGHT_S * US_PER_S))
            except SceneError:
                continue
            return scene
        raise RuntimeError(f"Expected a free flight within {_MOST_DRAWS} draws, got none for {self.name}")

    def write(self, target: Path) -> None:
        """Generate the flight, if it is not there."""
        if not target.exists():
            partial = target.with_suffix(".partial")
            request = Request(duration_s=FLIGHT_S, streams=STREAMS, quality="draft")
            generate_sequence(self.scene(), partial, request, overwrite=True)
            partial.rename(target)

    def _before_sensor(self, scene: Scene) -> Scene:
        """Return the scene with the study's world, light and sensor, which ran before the flight began."""
        events = replace(
            scene.events,
            model="log",
            threshold_on=THRESHOLD * self.threshold_gain,
            threshold_off=THRESHOLD * self.threshold_gain,
            initial_phase="uniform",
        )
        seed = 10_000 * MOTION_KINDS.index(self.kind) + 1_000 * SPLITS.index(self.split) + self.number
        # The drive is another world's, and one of the paper's sequences has another light.
        first = load_scene(_FLOWN[0])
        return replace(
            scene.with_size(*COLOUR_SIZE),
            events=events,
            event_step_us=0,
            world=first.world,
            light=first.light,
            seed=seed,
        )


def _draw_flying(rng: np.random.Generator, number: int) -> Scene:
    scene = load_scene(_FLOWN[number % len(_FLOWN)])
    if not isinstance(scene.flight, LoopOptions):
        raise RuntimeError(f"Expected a quadrotor's loop, got {type(scene.flight).__name__}")
    wind = WindOptions(speed_m_s=WIND_M_S, towards_deg=float(rng.uniform(0.0, 360.0)))
    scene = replace(scene, flight=replace(scene.flight, wind=wind))
    # Before the first second the quadrotor starts, after the last it stops.
    remaining_s = scene.remaining_s
    if remaining_s is None:
        raise RuntimeError(f"Expected a flight with an end, got that of {scene.name}")
    return scene.starting_at(float(rng.uniform(1.0, remaining_s - FLIGHT_S - 1.0)))


def _draw_driving(rng: np.random.Generator, region_m: tuple[float, float]) -> Scene:
    scene = load_scene(_DRIVEN)
    if not isinstance(scene.flight, FlightOptions):
        raise RuntimeError(f"Expected a drive of steady rates and sines, got {type(scene.flight).__name__}")
    eastward = bool(rng.integers(2))
    speed_m_s, lane_m, sway_m, sway_hz = (
        float(rng.uniform(*bounds)) for bounds in (_SPEEDS_M_S, _LANES_M, _SWAY_M, _SWAY_HZ)
    )
    phase_deg = float(rng.uniform(0.0, 360.0))
    # The nose points along the path: tan(yaw) = y' / x' with y' = sway omega cos(omega t + phase), to first order.
    yaw_deg = math.degrees(sway_m * 2 * math.pi * sway_hz / speed_m_s)
    heading = 1.0 if eastward else -1.0
    flight = FlightOptions(
        position_m=(float(rng.uniform(*region_m)), lane_m, scene.flight.position_m[2]),
        velocity_m_s=(heading * speed_m_s, 0.0, 0.0),
        attitude_deg=(0.0 if eastward else 180.0, 0.0, 0.0),
        terms=(
            HarmonicTerm(axis="y", amplitude=sway_m, frequency_hz=sway_hz, phase_deg=phase_deg),
            HarmonicTerm(axis="yaw", amplitude=heading * yaw_deg, frequency_hz=sway_hz, phase_deg=phase_deg + 90.0),
        ),
    )
    return replace(scene, flight=flight)


def draws_of(kind: MotionKind, split: Split, count: int) -> tuple[FlightDraw, ...]:
    """Return the first flights of a kind and split."""
    return tuple(FlightDraw(kind, split, number) for number in range(count))
