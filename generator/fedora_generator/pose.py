"""The pose stream: the flight's pose with the white noise that the file declares."""

import math
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from fedora_generator.flight import Flight
from fedora_generator.rotations import multiply_quaternions, normalise_quaternions, quaternions_from_rotation_vectors
from fedora_qa.conventions import US_PER_S

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseOptions:
    """Standard deviations per axis: position in the world, metres; rotation in the body frame, radians."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    position_sigma_m: float = 0.0
    rotation_sigma_rad: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"Expected {field.name} >= 0, got {value}")


@dataclass(frozen=True, slots=True)
class PoseSamples:
    """Body poses in the world, float64."""

    positions_world_m: Floats
    """(m, 3)"""
    orientations_xyzw: Floats
    """(m, 4), unit, body to world; the sign follows the flight's own, which never jumps"""


class PoseSensor:
    """A source of poses, one piece of time after the other; they do not depend on where time is cut."""

    def __init__(self, options: PoseOptions, rng: np.random.Generator) -> None:
        self._options = options
        self._position_rng, self._rotation_rng = rng.spawn(2)

    def sample(self, flight: Flight, times_us: NDArray[np.int64]) -> PoseSamples:
        """Sample at ``times_us`` (m,), int64 microseconds; orientation = q * Exp(N(0, rotation_sigma^2 I)).

        Position and rotation noise come from random streams of their own, one row of draws a sample.
        """
        states, options = flight.states_at(times_us / US_PER_S), self._options
        positions_world_m, orientations_xyzw = states.positions_world_m, states.orientations_xyzw
        if options.position_sigma_m > 0:
            noise_m = options.position_sigma_m * self._position_rng.standard_normal(positions_world_m.shape)
            positions_world_m = positions_world_m + noise_m
        if options.rotation_sigma_rad > 0:
            noise_rad = options.rotation_sigma_rad * self._rotation_rng.standard_normal(positions_world_m.shape)
            orientations_xyzw = multiply_quaternions(orientations_xyzw, quaternions_from_rotation_vectors(noise_rad))
        return PoseSamples(positions_world_m, normalise_quaternions(orientations_xyzw))
