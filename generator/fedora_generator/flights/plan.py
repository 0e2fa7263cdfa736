"""Missions of QGroundControl as waypoints, from geodetic coordinates around a home position.

A ``.plan`` file is JSON. Of its mission these items are flown (numbers of MAV_CMD, MAVLink's common message set):

=== =============== ==================================================================================
 22 TAKEOFF         rest on the ground below its place, climb to its altitude
 16 WAYPOINT        fly by, or rest for its hold time; its yaw, where it has one
 19 LOITER_TIME     rest for its time
178 DO_CHANGE_SPEED the speed, from the last place on
 21 LAND            fly above its place without changing altitude, then straight down; must be last
 20 RETURN          land where home is
=== =============== ==================================================================================

Surveys, corridor scans and structure scans list the simple items that they stand for, and these are flown. Commands
to a camera move nothing and are ignored. Acceptance radii are ignored as well: ``corner_s`` sets how corners are cut.
Everything else is refused by name.
Source: QGroundControl developer guide, Plan File Format, version 1 and its mission, version 2.

Geodetic coordinates in a flat world around a home position.

East and north are the coordinates in the plane that touches the WGS84 ellipsoid at home, up is the difference in
altitude: so level flight stays level, as over the flat ground of a world. This neglects the Earth's curvature: at a
distance d from home a point lies d^2 / 2R lower in a true tangent plane (8 cm at 1 km, 8 m at 10 km), and lengths along
the ground are too short by d^2 / 6R^2 of themselves (4e-9 at 1 km). Altitudes above the sea count as above the
ellipsoid, which changes lengths by at most a further 1e-5 of themselves.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, TypeGuard

import numpy as np
from numpy.typing import NDArray

from fedora_generator.errors import SceneError
from fedora_generator.flights.route import Waypoint

Floats = NDArray[np.float64]

FARTHEST_M: Final = 10_000.0
"""Largest distance from home: beyond, the neglected curvature exceeds 8 m."""

# Defining constants of WGS84: NGA.STND.0036, table 3.1.
_SEMI_MAJOR_M: Final = 6_378_137.0
_FLATTENING: Final = 1 / 298.257223563
_ECCENTRICITY_SQUARED: Final = _FLATTENING * (2 - _FLATTENING)


def enu_from_geodetic(place: tuple[float, float, float], home: tuple[float, float, float]) -> Floats:
    """East, north, up (3,) of a place, metres from home.

    Parameters
    ----------
    place, home
        Latitude and longitude, degrees, and altitude, metres.

    Raises
    ------
    ValueError
        An impossible latitude or longitude, or a place farther than ``FARTHEST_M`` from home.
    """
    latitude_rad, longitude_rad = np.radians(home[:2])
    sin_lat, cos_lat = math.sin(latitude_rad), math.cos(latitude_rad)
    sin_lon, cos_lon = math.sin(longitude_rad), math.cos(longitude_rad)
    east = np.array([-sin_lon, cos_lon, 0.0])
    north = np.array([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat])
    offset_m = ecef_from_geodetic(place) - ecef_from_geodetic(home)
    if (distance_m := float(np.linalg.norm(offset_m))) > FARTHEST_M:
        raise ValueError(f"Expected places within {FARTHEST_M:g} m of home, got one {distance_m:.0f} m away")
    return np.array([east @ offset_m, north @ offset_m, place[2] - home[2]])


def ecef_from_geodetic(place: tuple[float, float, float]) -> Floats:
    """Earth-centred, Earth-fixed coordinates (3,), metres, of latitude, longitude (degrees) and height (metres).

    Source: NGA.STND.0036, World Geodetic System 1984, eq. 4-14 and 4-15.
    """
    if not (np.isfinite(place).all() and abs(place[0]) <= 90 and abs(place[1]) <= 360):
        raise ValueError(f"Expected a latitude within 90 and a longitude within 360 degrees, got {place}")
    latitude_rad, longitude_rad = np.radians(place[:2])
    sin_lat = math.sin(latitude_rad)
    normal_m = _SEMI_MAJOR_M / math.sqrt(1 - _ECCENTRICITY_SQUARED * sin_lat**2)
    equatorial_m = (normal_m + place[2]) * math.cos(latitude_rad)
    return np.array(
        [
            equatorial_m * math.cos(longitude_rad),
            equatorial_m * math.sin(longitude_rad),
            ((1 - _ECCENTRICITY_SQUARED) * normal_m + place[2]) * sin_lat,
        ]
    )


TAKEOFF: Final = 22
WAYPOINT: Final = 16
LOITER_TIME: Final = 19
DO_CHANGE_SPEED: Final = 178
LAND: Final = 21
RETURN: Final = 20

TO_A_CAMERA: Final = frozenset({205, 206, 530, 531, 532, 1000, 2000, 2001, 2500, 2501})
"""Mount, trigger distance, mode, zoom, focus, gimbal, start and stop of capture and of video."""

ABOVE_SEA: Final = (0, 5)
ABOVE_HOME: Final = (3, 6)
"""Values of MAV_FRAME: what an altitude counts from."""

SAME_PLACE_M: Final = 1e-3
"""Places closer than this are the same: 1e-8 degrees of latitude, the last digit that files have."""


@dataclass(slots=True)
class Mission:
    """The mission up to an item; ``home`` is latitude, longitude (degrees) and altitude (m).

    ``waypoints`` are metres from home, east, north, up.
    """

    home: tuple[float, float, float]
    speed_m_s: float | None
    waypoints: list[Waypoint] = field(default_factory=list)
    landed: bool = False

    def fly_to(self, position_m: NDArray[np.float64], hold_s: float = 0.0, yaw_deg: float | None = None) -> None:
        """Add a waypoint; at the position of the last waypoint, extend its rest instead.

        Parameters
        ----------
        position_m
            (3,) east, north, up from home.
        hold_s
            Rest at the waypoint.
        yaw_deg
            Counter-clockwise from east; None if the item has none.
        """
        if self.waypoints:
            last = self.waypoints[-1]
            if np.linalg.norm(position_m - last.position_m) < SAME_PLACE_M:
                yaw_deg = last.yaw_deg if yaw_deg is None else yaw_deg
                self.waypoints[-1] = replace(last, hold_s=last.hold_s + hold_s, yaw_deg=yaw_deg)
                return
        x, y, z = position_m.tolist()
        self.waypoints.append(Waypoint(position_m=(x, y, z), hold_s=hold_s, yaw_deg=yaw_deg))


def waypoints_table(flight: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Turn a scene's table of kind ``plan`` into one of kind ``waypoints``.

    Parameters
    ----------
    flight
        ``file`` is the plan; ``origin_m`` is the position of home in the world (default 0, 0, 0); ``speed_m_s``
        replaces the mission's hover speed. All other keys stay as they are.

    Raises
    ------
    SceneError
        No such file, not a plan, or an item that cannot be flown.
    """
    options = {key: value for key, value in flight.items() if key not in ("kind", "file", "origin_m")}
    path = folder / str(flight.get("file", ""))
    origin_m = flight.get("origin_m", [0.0, 0.0, 0.0])
    if not (isinstance(origin_m, list) and len(origin_m) == 3 and all(map(_is_number, origin_m))):
        raise SceneError(f"Expected origin_m to be x, y, z of home in the world, got {origin_m}")
    try:
        mission = read_plan(json.loads(path.read_text(encoding="utf-8")))
        waypoints = [
            {
                "position_m": np.add(waypoint.position_m, origin_m, dtype=np.float64).tolist(),
                "hold_s": waypoint.hold_s,
                "yaw_deg": waypoint.yaw_deg,
                "speed_m_s": waypoint.speed_m_s,
            }
            for waypoint in mission.waypoints
        ]
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise SceneError(f"Expected file to be a readable .plan of QGroundControl, got {path}: {error}") from error
    except ValueError as error:
        raise SceneError(f"{error} ({path.name})") from error
    if mission.speed_m_s is not None:
        options.setdefault("speed_m_s", mission.speed_m_s)
    return {"kind": "waypoints", "waypoints": waypoints, **options}


def read_plan(document: Any) -> Mission:
    """Mission of a parsed ``.plan``; a ValueError names the item that cannot be flown."""
    if not isinstance(document, Mapping) or document.get("fileType") != "Plan":
        raise ValueError("Expected a plan of QGroundControl, got JSON without fileType 'Plan'")
    table = document.get("mission")
    if not (isinstance(table, Mapping) and isinstance(table.get("items"), list)):
        raise ValueError("Expected a mission with a list of items, got none")
    home = table.get("plannedHomePosition")
    if not (isinstance(home, list) and len(home) == 3 and all(map(_is_number, home))):
        raise ValueError(f"Expected plannedHomePosition to be latitude, longitude, altitude, got {home}")
    speed_m_s = table.get("hoverSpeed")
    mission = Mission(
        (home[0], home[1], home[2]), float(speed_m_s) if _is_number(speed_m_s) and speed_m_s > 0 else None
    )
    for number, item in enumerate(table["items"], start=1):
        try:
            for simple_item in _simple_items(item):
                _add_item(mission, simple_item)
        except ValueError as error:
            raise ValueError(f"{error}, at mission item {number}") from error
    if not mission.waypoints:
        raise ValueError("Expected a mission with at least one place, got none")
    return mission


def _simple_items(item: Any) -> list[Mapping[str, Any]]:
    """Return the item, or those that a complex item stands for, without commands to a camera."""
    items: Any = [item]
    if isinstance(item, Mapping) and item.get("type") == "ComplexItem":
        transects = item.get("TransectStyleComplexItem")
        items = transects.get("Items") if isinstance(transects, Mapping) else None
        if not (isinstance(items, list) and items):
            kind = item.get("complexItemType")
            raise ValueError(f"Expected a complex item with the simple Items it stands for, got {kind!r} without")
    for simple in items:
        if not isinstance(simple, Mapping) or simple.get("type") != "SimpleItem":
            raise ValueError(f"Expected an item of type SimpleItem or ComplexItem, got {simple!r:.60}")
    return [simple for simple in items if simple.get("command") not in TO_A_CAMERA]


def _add_item(mission: Mission, item: Mapping[str, Any]) -> None:
    """Add a simple item to the mission."""
    if mission.landed:
        raise ValueError("Expected LAND or RETURN to be the last item, got another one after it")
    numbers = item.get("params")
    if not (isinstance(numbers, list) and len(numbers) == 7 and all(_is_number(p) or p is None for p in numbers)):
        raise ValueError(f"Expected seven numbers as params, got {numbers}")
    params = [math.nan if value is None else float(value) for value in numbers]
    command = item.get("command")
    if command == DO_CHANGE_SPEED:
        kind, speed_m_s = params[:2]
        if kind not in (0, 1):
            raise ValueError(f"Expected DO_CHANGE_SPEED of kind 0 or 1 (air or ground), got {kind:g}")
        if speed_m_s != -1:  # MAVLink: no change
            if not speed_m_s > 0:
                raise ValueError(f"Expected DO_CHANGE_SPEED to more than 0 m/s, got {speed_m_s:g}")
            if mission.waypoints:  # from the last waypoint on
                mission.waypoints[-1] = replace(mission.waypoints[-1], speed_m_s=speed_m_s)
            else:
                mission.speed_m_s = speed_m_s
    elif command == TAKEOFF:
        position_m = _place_m(mission, item, params)
        if mission.waypoints:
            raise ValueError("Expected TAKEOFF to be the first place, got one before it")
        mission.fly_to(position_m * (1.0, 1.0, 0.0))
        mission.fly_to(position_m)
    elif command == WAYPOINT:
        yaw_deg = None if math.isnan(params[3]) else 90.0 - params[3]  # clockwise from north there
        mission.fly_to(_place_m(mission, item, params), _or_zero(params[0]), yaw_deg)
    elif command == LOITER_TIME:
        mission.fly_to(_place_m(mission, item, params), _or_zero(params[0]))
    elif command == LAND:
        _land(mission, _place_m(mission, item, params))
    elif command == RETURN:
        _land(mission, np.zeros(3))
    else:
        raise ValueError(
            f"Expected a command among TAKEOFF (22), WAYPOINT (16), LOITER_TIME (19), DO_CHANGE_SPEED (178), "
            f"LAND (21) and RETURN (20), got {command!r}; remove or replace it"
        )


def _land(mission: Mission, position_m: NDArray[np.float64]) -> None:
    if not mission.waypoints:
        raise ValueError("Expected a place before LAND or RETURN, got none")
    above_m = position_m.copy()
    above_m[2] = mission.waypoints[-1].position_m[2]
    mission.fly_to(above_m)
    mission.fly_to(position_m)
    mission.landed = True


def _place_m(mission: Mission, item: Mapping[str, Any], params: list[float]) -> NDArray[np.float64]:
    """East, north, up (3,) of an item from home; a latitude and longitude of 0 or null keep the current place."""
    latitude_deg, longitude_deg, altitude_m = params[4:7]
    frame = item.get("frame")
    if frame not in (*ABOVE_SEA, *ABOVE_HOME):
        raise ValueError(f"Expected an altitude above sea (frame 0) or home (frame 3), got frame {frame!r}")
    if not math.isfinite(altitude_m):
        raise ValueError("Expected an altitude, got none")
    above_home_m = altitude_m - mission.home[2] if frame in ABOVE_SEA else altitude_m
    if math.isnan(latitude_deg) or math.isnan(longitude_deg) or latitude_deg == longitude_deg == 0:
        x, y, _ = mission.waypoints[-1].position_m if mission.waypoints else (0.0, 0.0, 0.0)
        return np.array([x, y, above_home_m])
    return enu_from_geodetic((latitude_deg, longitude_deg, above_home_m + mission.home[2]), mission.home)


def _or_zero(value: float) -> float:
    return 0.0 if math.isnan(value) else value


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
