"""Geodetic coordinates in a flat world around a home position.

East and north are the coordinates in the plane that touches the WGS84 ellipsoid at home, up is the difference in
altitude: so level flight stays level, as over the flat ground of a world. This neglects the Earth's curvature: at a
distance d from home a point lies d^2 / 2R lower in a true tangent plane (8 cm at 1 km, 8 m at 10 km), and lengths along
the ground are too short by d^2 / 6R^2 of themselves (4e-9 at 1 km). Altitudes above the sea count as above the
ellipsoid, which changes lengths by at most a further 1e-5 of themselves.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

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
