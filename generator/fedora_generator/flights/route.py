"""A route: legs from waypoint to waypoint, and lines with corners smoothed over time.

A line is averaged over time with a Gaussian: the result is C-infinity, and has every derivative in closed form. Let the
line jump by ``step`` and bend by ``bend`` (change its slope) at a corner, tau after it and z = tau / sigma. The average
of a jump is the normal distribution Phi(z), that of a bend tau Phi(z) + sigma phi(z). An average never leaves the
convex hull of the averaged values: the curve stays within the hull of the line, and its derivative within that of the
slopes (and steps). So a smoothed route cuts corners, overshoots none, and is nowhere faster than ordered.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict
from scipy.special import ndtr

Floats = NDArray[np.float64]

REACH_SIGMAS: Final = 9.0
"""Farther from a corner than this its average is the line to rounding: Phi(-9) = 1e-19."""


class Derivatives(NamedTuple):
    """A quantity (n, k) and its first three derivatives with respect to time in seconds."""

    value: Floats
    first: Floats
    second: Floats
    third: Floats


@dataclass(frozen=True, slots=True)
class SmoothedLine:
    """A piecewise linear quantity of k columns, averaged with a Gaussian of standard deviation ``sigma_s``.

    Parameters
    ----------
    start
        (k,) value before the first corner, where the line is level.
    times_s
        (m,) corners, ascending.
    steps, bends
        (m, k) jump of the value, and change of the slope per second, at each corner.
    """

    start: Floats
    times_s: Floats
    steps: Floats
    bends: Floats
    sigma_s: float

    def at(self, times_s: Floats) -> Derivatives:
        """Value and derivatives at ``times_s`` (n,), seconds, in the unit of ``start`` per s, s^2 and s^3."""
        # Corners before ``first_corner`` bend the line fully; those from ``stop_corner`` on do not act yet. Between the
        # two, each corner adds its average.
        reach_s = REACH_SIGMAS * self.sigma_s
        first_corner = np.searchsorted(self.times_s, times_s - reach_s)
        stop_corner = np.searchsorted(self.times_s, times_s + reach_s)

        # Value and slope (n, k) of the line that is bent by the corners before ``first_corner`` only.
        slopes = np.vstack([np.zeros_like(self.start), np.cumsum(self.bends, axis=0)])
        rises = slopes[:-1] * np.diff(self.times_s, prepend=self.times_s[:1])[:, None] + self.steps
        vertices = self.start + np.vstack([np.zeros_like(self.start), np.cumsum(rises, axis=0)])
        corner_times_s = np.concatenate([[0.0], self.times_s])
        slope = slopes[first_corner]
        value = vertices[first_corner] + slope * (times_s - corner_times_s[first_corner])[:, None]
        total = Derivatives(value, slope, np.zeros_like(value), np.zeros_like(value))

        # Rows have different numbers of corners in reach: the k-th corner of every row that has one is added at once.
        for k in range(int(np.max(stop_corner - first_corner, initial=0))):
            rows = np.flatnonzero(first_corner + k < stop_corner)
            corners = first_corner[rows] + k
            steps, bends = self.steps[corners], self.bends[corners]
            tau_s = (times_s[rows] - self.times_s[corners])[:, None]
            z = tau_s / self.sigma_s
            phi = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
            # First, second and third derivative of Phi(z) with respect to time.
            density = phi / self.sigma_s
            density_rate = -z / self.sigma_s * density
            density_curvature = (z**2 - 1) / self.sigma_s**2 * density
            total.value[rows] += steps * ndtr(z) + bends * (tau_s * ndtr(z) + self.sigma_s * phi)
            total.first[rows] += steps * density + bends * ndtr(z)
            total.second[rows] += steps * density_rate + bends * density
            total.third[rows] += steps * density_curvature + bends * density_rate
        return total


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """A position in the world (ENU) to fly by, or to rest at for ``hold_s``.

    ``yaw_deg`` (counter-clockwise from east) holds from here to the next waypoint that has a yaw; before the first of
    them the nose points along each leg. ``speed_m_s`` holds from here on; None leaves it as it was.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    position_m: tuple[float, float, float]
    hold_s: float = 0.0
    yaw_deg: float | None = None
    speed_m_s: float | None = None

    def __post_init__(self) -> None:
        numbers = (*self.position_m, self.yaw_deg or 0.0)
        if not np.isfinite(numbers).all():
            raise ValueError(f"Expected a finite waypoint, got position {self.position_m}, yaw {self.yaw_deg}")
        if not (math.isfinite(self.hold_s) and self.hold_s >= 0):
            raise ValueError(f"Expected hold_s >= 0, got {self.hold_s}")
        if self.speed_m_s is not None and not (math.isfinite(self.speed_m_s) and self.speed_m_s > 0):
            raise ValueError(f"Expected speed_m_s > 0, got {self.speed_m_s}")


@dataclass(frozen=True, slots=True)
class Route:
    """Position in the world (ENU), metres, and yaw, rad, over time, each a smoothed line."""

    position_world_m: SmoothedLine
    """3 columns: x, y, z"""
    yaw_rad: SmoothedLine
    """1 column, counter-clockwise from east, without jumps of a turn"""
    duration_s: float
    """From the start to the last corner"""


def route_through(waypoints: Sequence[Waypoint], speed_m_s: float, corner_s: float, turn_s: float) -> Route:
    """Route along straight legs; rests before the first waypoint and after the last.

    Parameters
    ----------
    waypoints
        At least one; neighbours differ in position.
    speed_m_s
        Speed of each leg, until a waypoint has a speed of its own.
    corner_s, turn_s
        Standard deviations over which changes of velocity and of yaw are spread. A corner that changes the velocity by
        dv is cut by 0.40 corner_s |dv|; its acceleration peaks at dv / (2.5 corner_s).

    Raises
    ------
    ValueError
        No waypoint, or a leg without length.
    """
    if not waypoints:
        raise ValueError("Expected at least one waypoint, got none")
    positions_m = np.array([waypoint.position_m for waypoint in waypoints], dtype=np.float64)
    legs_m = np.diff(positions_m, axis=0)
    lengths_m = np.linalg.norm(legs_m, axis=1)
    if not np.all(lengths_m > 0):
        place = int(np.argmin(lengths_m))
        raise ValueError(
            f"Expected waypoints that differ from the one before, got {waypoints[place].position_m} twice; use hold_s"
        )

    # Velocity (legs, 3) of each leg.
    speeds: list[float] = []
    for waypoint in waypoints[:-1]:
        speed_m_s = speed_m_s if waypoint.speed_m_s is None else waypoint.speed_m_s
        speeds.append(speed_m_s)
    speeds_m_s = np.array(speeds)
    velocities_m_s = legs_m / lengths_m[:, None] * speeds_m_s[:, None]

    # Arrival at and departure from each waypoint (n,), the first arrival at 0.
    holds_s = np.array([waypoint.hold_s for waypoint in waypoints])
    arrivals_s = np.concatenate([[0.0], np.cumsum(holds_s[:-1] + lengths_m / speeds_m_s)])
    departures_s = arrivals_s + holds_s

    # The position stops at each arrival and starts at each departure; without a rest the two are one corner.
    corners_s = np.stack([departures_s[:-1], arrivals_s[1:]], axis=1).ravel()
    bends = np.stack([velocities_m_s, -velocities_m_s], axis=1).reshape(-1, 3)
    position = SmoothedLine(positions_m[0], corners_s, np.zeros_like(bends), bends, corner_s)

    # Yaw from each waypoint on: the yaw that a waypoint so far has, else the course of the leg. A leg straight up and
    # the last waypoint have no course.
    leg_yaws: list[float | None] = []
    waypoint_yaw: float | None = None
    for waypoint, leg_m in zip(waypoints, [*legs_m, np.zeros(3)], strict=True):
        waypoint_yaw = math.radians(waypoint.yaw_deg) if waypoint.yaw_deg is not None else waypoint_yaw
        course = math.atan2(leg_m[1], leg_m[0]) if np.any(leg_m[:2] != 0) else None
        leg_yaws.append(waypoint_yaw if waypoint_yaw is not None else course)
    # Without a yaw the last one stays; before the first one it already holds, so that a climb at the start does not
    # turn the nose.
    latest_yaw = next((yaw for yaw in leg_yaws if yaw is not None), 0.0)
    yaws = []
    for yaw in leg_yaws:
        latest_yaw = latest_yaw if yaw is None else yaw
        yaws.append(latest_yaw)
    yaws_rad = np.unwrap(np.array(yaws))  # the shorter way round

    # The yaw turns at each waypoint, in the middle of its rest.
    turns_s = 0.5 * (arrivals_s + departures_s)
    steps = np.diff(yaws_rad)[:, None]
    yaw_line = SmoothedLine(yaws_rad[:1], turns_s[1:], steps, np.zeros_like(steps), turn_s)
    return Route(position, yaw_line, float(departures_s[-1]))
