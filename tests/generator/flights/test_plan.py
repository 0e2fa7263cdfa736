"""Plans of QGroundControl: which mission items are flown, and how; what is refused."""

import json
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight
from fedora_generator.flights.kinds import WaypointsOptions
from fedora_generator.flights.plan import ecef_from_geodetic, enu_from_geodetic, read_plan
from fedora_generator.scene import load_scene

HOME = [37.4, -122.0, 20.0]
NORTH_DEG = 0.0009
NORTH_M = 99.887  # 0.0009 degrees of the meridian, whose radius is 6 358 981 m at this latitude


def item(command: int, *params: float | None, frame: int = 3) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": list(params), "autoContinue": True}


def plan(*items: Any, **mission: Any) -> dict[str, Any]:
    whole = {"version": 2, "plannedHomePosition": HOME, "hoverSpeed": 5, "items": list(items), **mission}
    return {"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "mission": whole}


TAKEOFF = item(22, 0, 0, 0, None, 37.4, -122.0, 10)
AWAY = item(16, 3, 0, 0, None, 37.4 + NORTH_DEG, -122.0, 15)
LAND = item(21, 0, 0, 0, None, 37.4, -122.0, 0)


def test_a_mission_is_flown_item_by_item() -> None:
    """Take off, climb, change speed, fly north and rest, loiter on, come back above home, land."""
    loiter = item(19, 4, 0, 0, 0, 37.4 + NORTH_DEG, -122.0, 15)
    mission = read_plan(plan(TAKEOFF, item(178, 1, 7, -1, 0, 0, 0, 0, frame=2), AWAY, loiter, LAND))
    positions_m = [waypoint.position_m for waypoint in mission.waypoints]
    expected_m = [(0, 0, 0), (0, 0, 10), (0, NORTH_M, 15), (0, 0, 15), (0, 0, 0)]
    np.testing.assert_allclose(positions_m, expected_m, atol=0.02)
    assert [waypoint.hold_s for waypoint in mission.waypoints] == [0, 0, 7, 0, 0]
    assert [waypoint.speed_m_s for waypoint in mission.waypoints] == [None, 7, None, None, None]
    assert mission.speed_m_s == 5


def test_altitudes_above_the_sea_count_from_home() -> None:
    """Frame 0 says 45 m where home lies at 20 m: 25 m up."""
    mission = read_plan(plan(item(16, 0, 0, 0, None, 37.4, -122.0, 45, frame=0)))
    np.testing.assert_allclose(mission.waypoints[0].position_m, [0, 0, 25], atol=1e-9)


def test_yaw_is_turned_from_compass_to_east() -> None:
    """Clockwise from north there, counter-clockwise from east here: north is 90, east is 0; null is none."""
    yaws = [item(16, 0, 0, 0, yaw, 37.4 + i * NORTH_DEG, -122.0, 9) for i, yaw in enumerate((0, 90, None))]
    assert [waypoint.yaw_deg for waypoint in read_plan(plan(*yaws)).waypoints] == [90.0, 0.0, None]


def test_an_item_without_a_place_is_where_it_was() -> None:
    """A latitude and longitude of 0 or null, as autopilots take them: over home first, then over the last place."""
    mission = read_plan(plan(item(22, 0, 0, 0, None, None, None, 10), AWAY, item(21, 0, 0, 0, 0, 0, 0, 0)))
    np.testing.assert_allclose([w.position_m for w in mission.waypoints][:2], [[0, 0, 0], [0, 0, 10]])
    np.testing.assert_allclose(mission.waypoints[-1].position_m, [0, NORTH_M, 0], atol=0.02)


def test_a_survey_is_the_items_it_stands_for() -> None:
    """Its own transects are flown as waypoints, its camera's triggers are passed over, and RETURN lands at home."""
    trigger = item(206, 25, 0, 1, 0, 0, 0, 0, frame=2)
    corners = [item(16, 0, 0, 0, None, 37.4 + north * NORTH_DEG, -122.0, 30) for north in (1, 3, 2)]
    inner = [corners[0], trigger, corners[1], corners[2]]
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": inner, "VisualTransectPoints": []},
        "polygon": [],
    }
    mission = read_plan(plan(TAKEOFF, survey, item(20, 0, 0, 0, 0, 0, 0, 0, frame=2)))
    positions_m = [waypoint.position_m for waypoint in mission.waypoints]
    north_m = [0, 0, NORTH_M, 3 * NORTH_M, 2 * NORTH_M, 0, 0]
    up_m = [0, 10, 30, 30, 30, 30, 0]
    np.testing.assert_allclose(positions_m, np.stack([np.zeros(7), north_m, up_m], axis=-1), atol=0.05)


def test_a_scene_flies_a_plan(tmp_path: Path) -> None:
    """The file beside the scene becomes waypoints, moved to where home lies; speeds of the plan, or of the scene."""
    (tmp_path / "north.plan").write_text(json.dumps(plan(TAKEOFF, AWAY)))
    path = tmp_path / "scene.toml"
    table = 'base = "park-day"\n[flight]\nkind = "plan"\nfile = "north.plan"\norigin_m = [1, 2, 0.5]\ncorner_s = 0.4\n'
    path.write_text(table)
    flight = load_scene(path).flight
    assert isinstance(flight, WaypointsOptions)
    assert (flight.speed_m_s, flight.corner_s) == (5.0, 0.4)
    end_m = Flight(flight).states_at(np.array([100.0])).positions_world_m[0]
    np.testing.assert_allclose(end_m, [1, 2 + NORTH_M, 15.5], atol=0.02)
    path.write_text(table + "speed_m_s = 2\n")
    slower = load_scene(path)
    assert slower.flight.speed_m_s == 2.0
    digest = slower.digest
    (tmp_path / "north.plan").write_text(json.dumps(plan(TAKEOFF, AWAY, LAND)))
    assert load_scene(path).digest != digest


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ([], "without fileType 'Plan'"),
        ({"fileType": "Mission"}, "without fileType 'Plan'"),
        ({"fileType": "Plan"}, "a mission with a list of items"),
        (plan(AWAY, plannedHomePosition=None), "plannedHomePosition to be latitude"),
        (plan(), "at least one place"),
        (plan(TAKEOFF, item(82, 0, 0, 0, 0, 0, 0, 0)), r"a command among .*, got 82; .* at mission item 2"),
        (
            plan({"type": "ComplexItem", "complexItemType": "survey"}),
            "the simple Items it stands for, got 'survey' without",
        ),
        (plan("fly"), "type SimpleItem or ComplexItem, got 'fly'"),
        (plan(TAKEOFF, LAND, AWAY), "LAND or RETURN to be the last item"),
        (plan(LAND), "a place before LAND"),
        (plan(AWAY, TAKEOFF), "TAKEOFF to be the first place"),
        (plan(item(16, 0, 0, 0, 0, 37.4, -122, 9, frame=10)), "frame 10"),
        (plan(item(16, 0, 0, 0, 0, 37.4, -122, None)), "Expected an altitude, got none"),
        (plan(item(16, 0, 0, 0, 0, 38.4, -122, 9)), "within 10000 m of home"),
        (plan(item(16, 0, 0)), "seven numbers"),
        (plan(item(16, -1, 0, 0, 0, 37.4, -122, 9)), "hold_s >= 0"),
        (plan(TAKEOFF, item(178, 2, 5, 0, 0, 0, 0, 0)), "kind 0 or 1"),
        (plan(TAKEOFF, item(178, 1, 0, 0, 0, 0, 0, 0)), "more than 0 m/s"),
    ],
)
def test_what_cannot_be_flown_is_refused(document: Any, message: str) -> None:
    """Each says what was expected, and which item it is."""
    with pytest.raises(ValueError, match=message):
        read_plan(document)


@pytest.mark.parametrize(
    ("text", "origin", "message"),
    [
        ("{", "[0, 0, 0]", "readable .plan of QGroundControl"),
        (None, "[0, 0, 0]", "readable .plan of QGroundControl"),
        ("[]", "[0, 0, 0]", r"without fileType 'Plan' \(a.plan\)"),
        ("[]", "[0, 0]", "origin_m to be x, y, z"),
    ],
)
def test_a_file_that_is_no_plan_is_one_sentence(tmp_path: Path, text: str | None, origin: str, message: str) -> None:
    """Broken, absent or other JSON, and a home without three coordinates, are errors of the scene."""
    if text is not None:
        (tmp_path / "a.plan").write_text(text)
    path = tmp_path / "scene.toml"
    path.write_text(f'base = "park-day"\n[flight]\nkind = "plan"\nfile = "a.plan"\norigin_m = {origin}\n')
    with pytest.raises(SceneError, match=message):
        load_scene(path)


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
