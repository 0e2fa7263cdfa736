"""Options of a quadrotor's flight by kind, and bursts of rotation on the spot.

::

    [flight]
    kind = "survey"
    start_m = [0.0, 0.0, 12.0]
    lane_m = 60.0
    lanes = 5
    spacing_m = 8.0
    speed_m_s = 4.0

Each kind may have ``drag_per_s = 0.3`` and a ``[flight.wind]`` (``gusts.py``).

Bursts rotate on the spot, each to the same angular speed. A burst of yaw steps the yaw by ``angle_deg``: the rate is a
Gaussian, so its peak gives the standard deviation.

A burst of roll is a sudden start (or stop) sideways. A change of velocity dv spread over sigma needs the
acceleration g A exp(-x^2 / 2), with x = t / sigma and A = dv / (sigma g sqrt(2 pi)), the tangent of the greatest roll.
The roll is its arc tangent, so the roll rate is (A / sigma) x e / (1 + A^2 e^2) with e = exp(-x^2 / 2), up to its sign.
That is greatest where 1 - x^2 + A^2 e^2 (1 + x^2) = 0; the root is found numerically, and ``sigma`` follows from the
angular speed.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Final, Literal

import numpy as np
from pydantic import ConfigDict
from scipy.optimize import brentq

from fedora_generator.flights.gusts import WindOptions
from fedora_generator.flights.route import Route, SmoothedLine, Waypoint, route_through
from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

MOST_REPEATS: Final = 3600
"""The longest sequence lasts an hour, and a lap, a lane or a burst takes at least a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class QuadrotorOptions(ABC):
    """Options of every kind: ``drag_per_s``, the deceleration per speed through the air, and a wind or none."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    drag_per_s: float = 0.0
    wind: WindOptions | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.drag_per_s) and self.drag_per_s >= 0):
            raise ValueError(f"Expected drag_per_s >= 0, got {self.drag_per_s}")
        if self.wind is not None and self.drag_per_s == 0:
            raise ValueError("Expected drag_per_s > 0 with a wind, got 0; without drag the air cannot push")
        self.route()

    @abstractmethod
    def route(self) -> Route:
        """Route that the options describe; a ValueError names the option that is impossible."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LegsOptions(QuadrotorOptions):
    """A route of straight legs at ``speed_m_s``, its largest speed.

    ``corner_s`` and ``turn_s`` are the standard deviations in time of its changes of velocity and of yaw.
    """

    speed_m_s: float = 2.0
    corner_s: float = 0.5
    turn_s: float = 0.5

    def route(self) -> Route:
        """Route through ``waypoints_in_order``."""
        require_positive(self, "speed_m_s", "corner_s", "turn_s")
        return route_through(self.waypoints_in_order(), self.speed_m_s, self.corner_s, self.turn_s)

    @abstractmethod
    def waypoints_in_order(self) -> tuple[Waypoint, ...]:
        """Every waypoint, in the order of flying."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WaypointsOptions(LegsOptions):
    """From waypoint to waypoint; at rest before the first and after the last."""

    kind: Literal["waypoints"] = "waypoints"
    waypoints: tuple[Waypoint, ...]

    def waypoints_in_order(self) -> tuple[Waypoint, ...]:
        """Return the option ``waypoints``."""
        return self.waypoints


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopOptions(LegsOptions):
    """Around closed waypoints ``laps`` times, from the first back to the first."""

    kind: Literal["loop"] = "loop"
    waypoints: tuple[Waypoint, ...]
    laps: int = 1

    def waypoints_in_order(self) -> tuple[Waypoint, ...]:
        """All laps, one after the other."""
        if self.laps < 1 or len(self.waypoints) < 2:
            raise ValueError(f"Expected at least two waypoints and one lap, got {len(self.waypoints)} and {self.laps}")
        require_few("laps", self.laps)
        return self.waypoints * self.laps + self.waypoints[:1]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyOptions(LegsOptions):
    """Back and forth along ``lanes`` parallel lanes.

    The first starts at ``start_m`` and leads ``lane_m`` along ``course_deg`` (counter-clockwise from east); the next
    lies ``spacing_m`` to its left, or to its right if negative. ``yaw_deg`` fixes the yaw; without it, the nose points
    along the lanes.
    """

    kind: Literal["survey"] = "survey"
    start_m: tuple[float, float, float]
    lane_m: float
    lanes: int
    spacing_m: float
    course_deg: float = 0.0
    yaw_deg: float | None = None

    def waypoints_in_order(self) -> tuple[Waypoint, ...]:
        """Both ends of each lane, in the order of flying."""
        require_positive(self, "lane_m")
        if self.lanes < 1 or self.spacing_m == 0:
            raise ValueError(f"Expected lanes >= 1, spacing_m not 0, got {self.lanes} and {self.spacing_m}")
        require_few("lanes", self.lanes)
        course_rad = math.radians(self.course_deg)
        along = np.array([math.cos(course_rad), math.sin(course_rad), 0.0])
        left = np.array([-along[1], along[0], 0.0])
        ends_m = [
            np.array(self.start_m) + lane * self.spacing_m * left + end_m * along
            for lane in range(self.lanes)
            for end_m in ((0.0, self.lane_m) if lane % 2 == 0 else (self.lane_m, 0.0))
        ]
        return tuple(Waypoint(position_m=tuple(end_m.tolist()), yaw_deg=self.yaw_deg) for end_m in ends_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class HoverOptions(QuadrotorOptions):
    """At rest at ``position_m``; only the wind moves it."""

    kind: Literal["hover"] = "hover"
    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0

    def route(self) -> Route:
        """Route of one waypoint."""
        return route_through(
            [Waypoint(position_m=self.position_m, yaw_deg=self.yaw_deg)], speed_m_s=1.0, corner_s=1.0, turn_s=1.0
        )


def require_few(name: str, value: int) -> None:
    """Raise ValueError if the number ``value`` of laps, lanes or bursts exceeds what fits an hour's flight."""
    if value > MOST_REPEATS:
        raise ValueError(f"Expected {name} up to {MOST_REPEATS}, got {value}")


def require_positive(options: QuadrotorOptions, *names: str) -> None:
    """Raise ValueError if one of the options ``names`` is not a finite number above 0."""
    for name in names:
        value = getattr(options, name)
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"Expected {name} > 0, got {value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstOptions(QuadrotorOptions):
    """``count`` bursts, ``period_s`` apart, the first at ``first_s``, each peaking at ``angular_speed_rad_s``.

    ``axis = "yaw"``: turns by ``angle_deg``, left and right in turn. ``axis = "roll"``: starts and stops to the left,
    then to the right, and so on, leaning up to ``angle_deg``. The peak is exact without drag and wind.
    """

    kind: Literal["burst"] = "burst"
    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0
    axis: Literal["yaw", "roll"] = "yaw"
    angular_speed_rad_s: float
    angle_deg: float = 40.0
    first_s: float = 0.5
    period_s: float = 1.0
    count: int = 8

    def route(self) -> Route:
        """Hover with corners of yaw, or of velocity, at each burst."""
        require_positive(self, "angular_speed_rad_s", "angle_deg", "period_s")
        if not np.isfinite([*self.position_m, self.yaw_deg, self.first_s]).all():
            raise ValueError(f"Expected finite numbers, got {self.position_m}, {self.yaw_deg} and {self.first_s}")
        if self.count < 1:
            raise ValueError(f"Expected count >= 1, got {self.count}")
        require_few("count", self.count)
        if self.axis == "roll" and self.angle_deg >= 90:
            raise ValueError(f"Expected angle_deg below 90 for a roll, got {self.angle_deg}")

        angle_rad = math.radians(self.angle_deg)
        if self.axis == "yaw":
            # The peak of a Gaussian yaw rate: angle / (sigma sqrt(2 pi)).
            sigma_s = angle_rad / (self.angular_speed_rad_s * math.sqrt(2 * math.pi))
        else:
            sigma_s = _roll_sigma_s(math.tan(angle_rad), self.angular_speed_rad_s)
        if self.period_s < 8 * sigma_s:  # at 8 sigma a neighbour adds less than 1e-10 of its peak
            raise ValueError(
                f"Expected period_s >= {8 * sigma_s:.3g}, so that bursts do not run together, got {self.period_s}"
            )
        times_s = self.first_s + self.period_s * np.arange(self.count, dtype=np.float64)
        zeros = np.zeros((self.count, 3))
        yaw_steps, bends = zeros[:, :1], zeros
        if self.axis == "yaw":
            signs = np.resize(np.array((1, -1), dtype=np.float64), self.count)
            yaw_steps = angle_rad * signs[:, None]
        else:
            # Changes of velocity dv = A sigma g sqrt(2 pi) along the body's left: start and stop, left and then right.
            signs = np.resize(np.array((1, -1, -1, 1), dtype=np.float64), self.count)
            speed_m_s = sigma_s * math.sqrt(2 * math.pi) * STANDARD_GRAVITY_M_S2 * math.tan(angle_rad)
            yaw_rad = math.radians(self.yaw_deg)
            left_m_s = speed_m_s * np.array([-math.sin(yaw_rad), math.cos(yaw_rad), 0.0])
            bends = np.outer(signs, left_m_s)
        return Route(
            SmoothedLine(np.array(self.position_m), times_s, zeros, bends, sigma_s),
            SmoothedLine(np.radians([self.yaw_deg]), times_s, yaw_steps, zeros[:, :1], sigma_s),
            self.first_s + self.period_s * (self.count - 1),
        )


def _roll_sigma_s(tangent: float, angular_speed_rad_s: float) -> float:
    """Compute the standard deviation of a change of velocity whose roll rate peaks at a speed; ``tangent`` is A."""

    def slope(x: float) -> float:
        squared = (tangent * math.exp(-0.5 * x * x)) ** 2
        return 1 - x * x + squared * (1 + x * x)

    farthest = 2 + math.sqrt(2 * math.log1p(tangent**2))  # there A^2 e^2 < e^-4, and the slope is below 0
    x = float(brentq(slope, 1.0, farthest, xtol=1e-14))
    e = math.exp(-0.5 * x * x)
    return tangent * x * e / (1 + (tangent * e) ** 2) / angular_speed_rad_s
