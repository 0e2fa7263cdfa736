"""The inertial unit: angular velocity and specific force of the flight, exact before noise."""

import math
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from fedora_generator.flight import Flight
from fedora_qa.conventions import STANDARD_GRAVITY_M_S2, US_PER_S

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuOptions:
    """Rate, gravity and noise of the unit; a noise of 0 is not added.

    Densities are rad/s/sqrt(Hz) and m/s^2/sqrt(Hz): a sample's sigma is ``density * sqrt(rate_hz)``. Walks are
    rad/s^2/sqrt(Hz) and m/s^3/sqrt(Hz): a bias moves by ``walk * sqrt(dt)`` between samples, from 0 at the first.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    rate_hz: float = 1000.0
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2
    gyro_noise_density: float = 0.0
    accel_noise_density: float = 0.0
    gyro_bias_walk: float = 0.0
    accel_bias_walk: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"Expected {field.name} >= 0, got {value}")
        if self.rate_hz == 0:
            raise ValueError("Expected rate_hz > 0, got 0")


@dataclass(frozen=True, slots=True)
class ImuSamples:
    """Instantaneous samples in the body frame, float64."""

    angular_velocities_body_rad_s: Floats
    """(m, 3)"""
    specific_forces_body_m_s2: Floats
    """(m, 3), +g on Z at rest and level"""


def sample_imu(
    flight: Flight, times_us: NDArray[np.int64], options: ImuOptions, rng: np.random.Generator
) -> ImuSamples:
    """Sample the unit at ``times_us`` (m,), int64 microseconds of the flight's clock.

    The specific force is ``f = R_world_body^T (a - g)`` with g = (0, 0, -gravity). Each noise has a random stream
    of its own, so that adding one leaves the others as they were, and a longer recording begins like a shorter one.
    """
    states = flight.states_at(times_us / US_PER_S)
    gravity_world_m_s2 = np.array([0.0, 0.0, -options.gravity_m_s2])
    proper_accelerations = states.accelerations_world_m_s2 - gravity_world_m_s2
    specific_forces = np.einsum("nji,nj->ni", states.R_world_body, proper_accelerations)
    gyro_white, accel_white, gyro_walk, accel_walk = rng.spawn(4)
    return ImuSamples(
        states.angular_velocities_body_rad_s
        + _white_noise(times_us, options.gyro_noise_density, options.rate_hz, gyro_white)
        + _bias_walk(times_us, options.gyro_bias_walk, gyro_walk),
        specific_forces
        + _white_noise(times_us, options.accel_noise_density, options.rate_hz, accel_white)
        + _bias_walk(times_us, options.accel_bias_walk, accel_walk),
    )


def _white_noise(times_us: NDArray[np.int64], density: float, rate_hz: float, rng: np.random.Generator) -> Floats:
    if density == 0:
        return np.zeros((times_us.size, 3))
    return density * math.sqrt(rate_hz) * rng.standard_normal((times_us.size, 3))


def _bias_walk(times_us: NDArray[np.int64], walk: float, rng: np.random.Generator) -> Floats:
    if walk == 0:
        return np.zeros((times_us.size, 3))
    steps_s = np.diff(times_us, prepend=times_us[:1]) / US_PER_S  # the first step is 0: the bias starts at 0
    increments = walk * np.sqrt(steps_s)[:, None] * rng.standard_normal((times_us.size, 3))
    return np.cumsum(increments, axis=0)
