"""The IMU and pose streams: the flight with the noise that the file declares."""

import math
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from fedora_generator.flight import Flight
from fedora_generator.rates import require_rate
from fedora_generator.rotations import multiply_quaternions, normalise_quaternions, quaternions_from_rotation_vectors
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
        require_rate("rate_hz", self.rate_hz)


@dataclass(frozen=True, slots=True)
class ImuSamples:
    """Instantaneous samples in the body frame, float64."""

    angular_velocities_body_rad_s: Floats
    """(m, 3)"""
    specific_forces_body_m_s2: Floats
    """(m, 3), +g on Z at rest and level"""


class Imu:
    """A unit that samples one piece of time after the other; its samples do not depend on where time is cut.

    Each noise has a random stream of its own, so that adding one leaves the others as they were, and a longer recording
    begins like a shorter one.
    """

    def __init__(self, options: ImuOptions, rng: np.random.Generator) -> None:
        gyro_white, accel_white, gyro_walk, accel_walk = rng.spawn(4)
        self._gravity_world_m_s2 = np.array([0.0, 0.0, -options.gravity_m_s2])
        sigmas_per_density = math.sqrt(options.rate_hz)
        self._gyro_noise = WhiteNoise(options.gyro_noise_density * sigmas_per_density, gyro_white)
        self._accel_noise = WhiteNoise(options.accel_noise_density * sigmas_per_density, accel_white)
        self._gyro_bias = BiasWalk(options.gyro_bias_walk, gyro_walk)
        self._accel_bias = BiasWalk(options.accel_bias_walk, accel_walk)

    def sample(self, flight: Flight, times_us: NDArray[np.int64]) -> ImuSamples:
        """Sample at ``times_us`` (m,), int64 microseconds of the flight's clock, later than those before.

        The specific force is ``f = R_world_body^T (a - g)`` with g = (0, 0, -gravity).
        """
        states = flight.states_at(times_us / US_PER_S)
        proper_accelerations = states.accelerations_world_m_s2 - self._gravity_world_m_s2
        specific_forces = np.einsum("nji,nj->ni", states.R_world_body, proper_accelerations)
        return ImuSamples(
            states.angular_velocities_body_rad_s + self._gyro_noise.draw(times_us) + self._gyro_bias.draw(times_us),
            specific_forces + self._accel_noise.draw(times_us) + self._accel_bias.draw(times_us),
        )


class WhiteNoise:
    """Independent normal samples of standard deviation ``sigma``; none are drawn where it is 0."""

    def __init__(self, sigma: float, rng: np.random.Generator) -> None:
        self._sigma, self._rng = sigma, rng

    def draw(self, times_us: NDArray[np.int64]) -> Floats:
        """Draw samples (m, 3) for the next times (m,)."""
        if self._sigma == 0:
            return np.zeros((times_us.size, 3))
        return self._sigma * self._rng.standard_normal((times_us.size, 3))


class BiasWalk:
    """A bias (3,) that starts at 0 and moves by ``walk * sqrt(dt)`` between samples; nothing is drawn where it is 0."""

    def __init__(self, walk: float, rng: np.random.Generator) -> None:
        self._walk, self._rng = walk, rng
        self._bias = np.zeros(3)
        self._last_us: int | None = None

    def draw(self, times_us: NDArray[np.int64]) -> Floats:
        """Biases (m, 3) at the next times (m,)."""
        if self._walk == 0 or times_us.size == 0:
            return np.zeros((times_us.size, 3))
        before_us = times_us[0] if self._last_us is None else self._last_us
        steps_s = np.diff(times_us, prepend=before_us) / US_PER_S
        increments = self._walk * np.sqrt(steps_s)[:, None] * self._rng.standard_normal((times_us.size, 3))
        biases: Floats = np.cumsum(np.concatenate([self._bias[None], increments]), axis=0)[1:]
        self._bias, self._last_us = biases[-1], int(times_us[-1])
        return biases


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
