"""The flight: one closed-form 6-DoF trajectory from which every stream is derived.

Either position and the three Euler angles are each a constant rate plus sines, the yaw also plus smooth turns
(``FlightOptions``, in this file); or a quadrotor flies a route (``flights/``). All are infinitely differentiable and
their derivatives are written down, so pose, IMU, depth and flow agree to rounding.
"""

import math
from dataclasses import dataclass, field, fields
from typing import ClassVar, Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict
from scipy.special import erf

from fedora_generator.flights.gusts import draw_gusts
from fedora_generator.flights.kinds import BurstOptions, HoverOptions, LoopOptions, SurveyOptions, WaypointsOptions
from fedora_generator.flights.quadrotor import FlightState, Quadrotor
from fedora_generator.rotations import body_rates_from_zyx, matrices_from_quaternions, quaternions_from_zyx

Floats = NDArray[np.float64]
Axis = Literal["x", "y", "z", "yaw", "pitch", "roll"]

AXES: Final[tuple[Axis, ...]] = ("x", "y", "z", "yaw", "pitch", "roll")
_YAW: Final = AXES.index("yaw")
_ANGLES: Final = slice(_YAW, None)
_POSITION: Final = slice(0, _YAW)


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicTerm:
    """``amplitude * sin(2 pi frequency_hz t + phase_deg)`` added to one axis; metres, or degrees for an angle."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    axis: Axis
    amplitude: float
    frequency_hz: float
    phase_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise ValueError(f"Expected axis to be one of {', '.join(AXES)}, got {self.axis!r}")
        _require_finite(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A smooth yaw step of ``angle_deg`` centred at ``time_s``.

    The yaw rate is a Gaussian of standard deviation ``sigma_s``; it peaks at ``angle / (sigma_s sqrt(2 pi))``.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    angle_deg: float
    time_s: float
    sigma_s: float

    def __post_init__(self) -> None:
        _require_finite(self)
        if self.sigma_s <= 0:
            raise ValueError(f"Expected sigma_s > 0, got {self.sigma_s}; a turn takes time")


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOptions:
    """A flight: where it starts at t = 0, its steady rates, and what is added to them.

    ``position_m`` and ``velocity_m_s`` are x, y, z in the world (ENU); ``attitude_deg`` is yaw, pitch, roll.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    position_m: tuple[float, float, float]
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    attitude_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rate_deg_s: float = 0.0
    terms: tuple[HarmonicTerm, ...] = ()
    turns: tuple[Turn, ...] = ()

    def __post_init__(self) -> None:
        _require_finite(self)


AnyFlightOptions = FlightOptions | WaypointsOptions | SurveyOptions | LoopOptions | HoverOptions | BurstOptions


class Motion(Protocol):
    """Anything with a state at every time."""

    def states_at(self, times_s: Floats) -> FlightState:
        """State at ``times_s`` (n,), seconds."""


@dataclass(frozen=True, slots=True)
class Flight:
    """The flight that ``options`` describe, at any time, however long.

    ``seed`` is that of its wind. ``start_s`` is the time of the flight, s, at which the clock is 0.
    """

    options: AnyFlightOptions
    seed: int | None = None
    start_s: float = 0.0
    _motion: Motion = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        options, seed = self.options, self.seed
        motion: Motion
        if isinstance(options, FlightOptions):
            motion = HarmonicMotion(options)
        elif options.wind is None:
            motion = Quadrotor(options.route(), options.drag_per_s)
        elif seed is None:  # a default would give each stream of a scene another wind, or all scenes the same
            raise ValueError("Expected a seed with a wind, got none; use Scene.fly()")
        else:
            gusts = draw_gusts(options.wind, options.drag_per_s, seed)
            motion = Quadrotor(options.route(), options.drag_per_s, gusts)
        object.__setattr__(self, "_motion", motion)

    def states_at(self, times_s: Floats) -> FlightState:
        """State at ``times_s`` (n,), seconds of the clock, in closed form.

        Raises
        ------
        SceneError
            A quadrotor would have to turn over.
        """
        times_s = np.asarray(times_s, dtype=np.float64)
        if times_s.ndim != 1 or not np.all(np.isfinite(times_s)):
            raise ValueError(f"Expected times_s to be finite and of shape (n,), got shape {times_s.shape}")
        return self._motion.states_at(self.start_s + times_s)


@dataclass(frozen=True, slots=True)
class HarmonicMotion:
    """Steady rates, sines and turns on each axis."""

    options: FlightOptions

    def states_at(self, times_s: Floats) -> FlightState:
        """State at ``times_s`` (n,), seconds, in closed form."""
        value, rate, acceleration = self._axes_at(times_s)
        yaw_rad, pitch_rad, roll_rad = np.moveaxis(value[:, _ANGLES], -1, 0)
        orientations_xyzw = quaternions_from_zyx(yaw_rad, pitch_rad, roll_rad)
        return FlightState(
            positions_world_m=value[:, _POSITION].copy(),
            orientations_xyzw=orientations_xyzw,
            R_world_body=matrices_from_quaternions(orientations_xyzw),
            velocities_world_m_s=rate[:, _POSITION].copy(),
            accelerations_world_m_s2=acceleration[:, _POSITION].copy(),
            angular_velocities_body_rad_s=body_rates_from_zyx(pitch_rad, roll_rad, rate[:, _ANGLES]),
        )

    def _axes_at(self, times_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Value, first and second derivative (n, 6) of the axes in the order of AXES, metres and radians."""
        options = self.options
        start = np.array([*options.position_m, *np.radians(options.attitude_deg)])
        steady_rate = np.array([*options.velocity_m_s, math.radians(options.yaw_rate_deg_s), 0.0, 0.0])
        value = start + steady_rate * times_s[:, None]
        rate = np.tile(steady_rate, (times_s.size, 1))
        acceleration = np.zeros_like(value)
        for term in options.terms:
            # a sin(w t + p), its rate a w cos(w t + p) and its acceleration -w^2 a sin(w t + p)
            column = AXES.index(term.axis)
            amplitude = term.amplitude if column < _YAW else math.radians(term.amplitude)
            omega_rad_s = 2 * math.pi * term.frequency_hz
            phase_rad = omega_rad_s * times_s + math.radians(term.phase_deg)
            sine = amplitude * np.sin(phase_rad)
            value[:, column] += sine
            rate[:, column] += amplitude * omega_rad_s * np.cos(phase_rad)
            acceleration[:, column] += -(omega_rad_s**2) * sine
        for turn in options.turns:
            # A Gaussian yaw rate, its integral and its derivative.
            angle_rad = math.radians(turn.angle_deg)
            deviate = (times_s - turn.time_s) / turn.sigma_s
            turn_rate_rad_s = angle_rad / (turn.sigma_s * math.sqrt(2 * math.pi)) * np.exp(-0.5 * deviate**2)
            value[:, _YAW] += angle_rad * 0.5 * (1 + erf(deviate / math.sqrt(2)))
            rate[:, _YAW] += turn_rate_rad_s
            acceleration[:, _YAW] += -deviate / turn.sigma_s * turn_rate_rad_s
        return value, rate, acceleration


def _require_finite(options: HarmonicTerm | Turn | FlightOptions) -> None:
    for name in (option.name for option in fields(options)):
        value = getattr(options, name)
        if isinstance(value, (int, float)) and not math.isfinite(value):
            raise ValueError(f"Expected {name} to be finite, got {value}")
        if name.endswith(("_m", "_m_s", "_deg")) and isinstance(value, tuple) and not np.isfinite(value).all():
            raise ValueError(f"Expected {name} to be finite, got {value}")
