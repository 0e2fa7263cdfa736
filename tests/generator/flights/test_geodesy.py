import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_generator.flights.plan import ecef_from_geodetic, enu_from_geodetic

A, F = mpmath.mpf(6378137), 1 / mpmath.mpf("298.257223563")
LATITUDES_DEG = [-60.0, 0.0, 37.4, 80.0]


@pytest.mark.parametrize("latitude_deg", LATITUDES_DEG)
def test_a_step_north_is_an_arc_of_the_meridian(latitude_deg: float) -> None:
    """500 m due north: the length of the ellipse's arc, integrated by mpmath; nothing east."""
    east, north, up = enu_from_geodetic((latitude_deg + 0.0045, 10.0, 30.0), (latitude_deg, 10.0, 30.0))
    square = F * (2 - F)

    def radius_m(latitude_rad: mpmath.mpf) -> mpmath.mpf:
        return A * (1 - square) / (1 - square * mpmath.sin(latitude_rad) ** 2) ** 1.5 + 30

    ends = [mpmath.radians(mpmath.mpf(latitude_deg)), mpmath.radians(mpmath.mpf(latitude_deg) + mpmath.mpf("0.0045"))]
    assert north == pytest.approx(float(mpmath.quad(radius_m, ends)), abs=2e-6)
    assert east == pytest.approx(0.0, abs=1e-8)
    assert up == 0.0


@pytest.mark.parametrize("latitude_deg", LATITUDES_DEG)
def test_a_step_east_is_an_arc_of_the_parallel(latitude_deg: float) -> None:
    """East is the chord of the parallel's circle, whose radius follows from the ellipse x^2/a^2 + z^2/b^2 = 1."""
    east, _, up = enu_from_geodetic((latitude_deg, 10.002, 55.0), (latitude_deg, 10.0, 5.0))
    reduced = mpmath.atan((1 - F) * mpmath.tan(mpmath.radians(mpmath.mpf(latitude_deg))))
    radius_m = A * mpmath.cos(reduced) + 55 * mpmath.cos(mpmath.radians(mpmath.mpf(latitude_deg)))
    assert east == pytest.approx(float(radius_m * mpmath.sin(mpmath.radians(mpmath.mpf("0.002")))), abs=1e-6)
    assert up == 50.0


@given(st.floats(-89, 89), st.floats(-180, 180), st.floats(-100, 5000))
def test_every_place_lies_on_its_own_ellipsoid_normal(latitude_deg: float, longitude_deg: float, height: float) -> None:
    """Taken down its normal by its height, a place fulfils the equation of the ellipsoid."""
    place = ecef_from_geodetic((latitude_deg, longitude_deg, height))
    latitude, longitude = np.radians([latitude_deg, longitude_deg])
    normal = [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    x, y, z = place - height * np.array(normal)
    a, b = float(A), float(A * (1 - F))
    assert (x * x + y * y) / a**2 + (z / b) ** 2 == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(
    ("place", "message"),
    [((1.0, 0.0, 0.0), "within 10000 m of home, got one 110.* away"), ((91.0, 0.0, 0.0), "latitude within 90")],
)
def test_places_out_of_reach_are_refused(place: tuple[float, float, float], message: str) -> None:
    """A degree away, and off the globe."""
    with pytest.raises(ValueError, match=message):
        enu_from_geodetic(place, (0.0, 0.0, 0.0))
