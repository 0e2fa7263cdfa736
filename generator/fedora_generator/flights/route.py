"""A route: waypoints flown along straight legs at constant speed, with rests and turns, as corners in time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from fedora_generator.flights.smoothed_line import SmoothedLine

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """A place to fly by, or to rest at for ``hold_s``.

    ``yaw_deg`` (counter-clockwise from east) is kept from here to the next waypoint that has one; with none so far, the
    nose points along each leg. ``speed_m_s`` is ordered from here on; None leaves it as it was.
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
    """Position and yaw over time, each a smoothed line."""

    position_world_m: SmoothedLine
    """3 columns: x, y, z"""
    yaw_rad: SmoothedLine
    """1 column, counter-clockwise from east, without jumps of a turn"""
    duration_s: float
    """From the start to the last corner"""


def route_through(waypoints: Sequence[Waypoint], speed_m_s: float, corner_s: float, turn_s: float) -> Route:
    """Route along straight legs; rests before the first waypoint and after the last.

    ``corner_s`` and ``turn_s`` are the standard deviations over which changes of velocity and of yaw are spread. A
    corner that changes the velocity by dv is cut by 0.40 corner_s |dv| and takes dv / (2.5 corner_s) at its peak.

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
    speeds_m_s = _speeds(waypoints, speed_m_s)
    arrivals_s, departures_s = _times(waypoints, lengths_m / speeds_m_s)
    velocities_m_s = legs_m / lengths_m[:, None] * speeds_m_s[:, None]
    position = _position(positions_m[0], velocities_m_s, arrivals_s, departures_s, corner_s)
    yaw = _yaw(_yaws_rad(waypoints, legs_m), 0.5 * (arrivals_s + departures_s), turn_s)
    return Route(position, yaw, float(departures_s[-1]))


def _speeds(waypoints: Sequence[Waypoint], speed_m_s: float) -> Floats:
    """Speed (legs,) of each leg."""
    speeds = []
    for waypoint in waypoints[:-1]:
        speed_m_s = speed_m_s if waypoint.speed_m_s is None else waypoint.speed_m_s
        speeds.append(speed_m_s)
    return np.array(speeds)


def _times(waypoints: Sequence[Waypoint], leg_times_s: Floats) -> tuple[Floats, Floats]:
    """Arrival at and departure from each waypoint (n,), the first arrival at 0."""
    holds_s = np.array([waypoint.hold_s for waypoint in waypoints])
    arrivals_s = np.concatenate([[0.0], np.cumsum(holds_s[:-1] + leg_times_s)])
    return arrivals_s, arrivals_s + holds_s


def _position(
    start_m: Floats, velocities_m_s: Floats, arrivals_s: Floats, departures_s: Floats, corner_s: float
) -> SmoothedLine:
    """Stop at each arrival, start at each departure; without a rest the two are one corner."""
    times_s = np.stack([departures_s[:-1], arrivals_s[1:]], axis=1).ravel()
    bends = np.stack([velocities_m_s, -velocities_m_s], axis=1).reshape(-1, 3)
    return SmoothedLine(start_m, times_s, np.zeros_like(bends), bends, corner_s)


def _yaws_rad(waypoints: Sequence[Waypoint], legs_m: Floats) -> Floats:
    """Yaw (n,) from each waypoint on; where nothing says it (straight up, or the end) it stays.

    What comes before the first yaw that is known already has it, so that a climb is flown with the nose where it goes.
    """
    yaws: list[float | None] = []
    ordered: float | None = None
    for waypoint, leg in zip(waypoints, [*legs_m, np.zeros(3)], strict=True):
        ordered = math.radians(waypoint.yaw_deg) if waypoint.yaw_deg is not None else ordered
        course = math.atan2(leg[1], leg[0]) if np.any(leg[:2] != 0) else None
        yaws.append(ordered if ordered is not None else course)
    latest_yaw = next((yaw for yaw in yaws if yaw is not None), 0.0)
    filled = []
    for yaw in yaws:
        latest_yaw = latest_yaw if yaw is None else yaw
        filled.append(latest_yaw)
    return np.unwrap(np.array(filled))  # the shorter way round


def _yaw(yaws_rad: Floats, times_s: Floats, turn_s: float) -> SmoothedLine:
    """Turn at each waypoint, in the middle of its rest."""
    steps = np.diff(yaws_rad)[:, None]
    return SmoothedLine(yaws_rad[:1], times_s[1:], steps, np.zeros_like(steps), turn_s)
