"""Kinds of flights: where they lead, how fast, and what about them is refused."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight, FlightOptions
from fedora_generator.flights.kinds import BurstOptions, LoopOptions, SurveyOptions, WaypointsOptions
from fedora_generator.flights.route import Waypoint
from fedora_generator.scene import load_scene

SQUARE = tuple(Waypoint(position_m=(x, y, 4.0)) for x, y in ((0, 0), (12, 0), (12, 12), (0, 12)))


def speeds_m_s(flight: Flight, times_s: np.ndarray) -> np.ndarray:
    return np.linalg.norm(flight.states_at(times_s).velocities_world_m_s, axis=1)


def yaws_deg(flight: Flight, times_s: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(flight.states_at(times_s).R_world_body).as_euler("ZYX", degrees=True)[:, 0]


def test_rest_is_where_it_was_ordered() -> None:
    """With rests of 18 sigma the flight stands exactly at its waypoints; it rests before the first, after the last."""
    waypoints = tuple(Waypoint(position_m=(4.0 * i, i, 2.0 + i), hold_s=9.0) for i in range(3))
    flight = Flight(WaypointsOptions(waypoints=waypoints, speed_m_s=3.0))
    leg_s = np.sqrt(18.0) / 3.0
    middles_s = np.array([-50.0, 4.5, 13.5 + leg_s, 22.5 + 2 * leg_s, 500.0])
    expected = np.array([waypoints[i].position_m for i in (0, 0, 1, 2, 2)])
    np.testing.assert_allclose(flight.states_at(middles_s).positions_world_m, expected, atol=1e-12)
    np.testing.assert_allclose(speeds_m_s(flight, middles_s), 0.0, atol=1e-12)


def test_the_ordered_speed_is_reached_and_never_exceeded() -> None:
    """A new speed holds from its waypoint on; in the middle of each long leg it is flown to rounding."""
    waypoints = (
        Waypoint(position_m=(0, 0, 9)),
        Waypoint(position_m=(60, 0, 9), speed_m_s=6.0),
        Waypoint(position_m=(60, 90, 9)),
    )
    flight = Flight(WaypointsOptions(waypoints=waypoints, speed_m_s=4.0))
    np.testing.assert_allclose(speeds_m_s(flight, np.array([7.5, 22.5])), [4.0, 6.0], rtol=1e-12)
    assert speeds_m_s(flight, np.linspace(-3, 35, 2000)).max() <= 6.0 * (1 + 1e-12)


def test_a_corner_is_cut_by_as_much_as_is_said() -> None:
    """At its own time a corner lies corner_s |dv| / sqrt(2 pi) off the waypoint."""
    options = LoopOptions(waypoints=SQUARE, laps=2, speed_m_s=2.0, corner_s=0.3)
    offset_m = Flight(options).states_at(np.array([6.0])).positions_world_m[0] - SQUARE[1].position_m
    assert np.linalg.norm(offset_m) == pytest.approx(0.3 * np.hypot(2, 2) / np.sqrt(2 * np.pi), rel=1e-12)


def test_a_loop_repeats_and_its_yaw_winds_up() -> None:
    """A lap later position and acceleration are the same, the nose along the leg, without a jump over 180 degrees."""
    flight = Flight(LoopOptions(waypoints=SQUARE, laps=3, speed_m_s=2.0, corner_s=0.3, turn_s=0.3))
    lap_s, times_s = 24.0, np.linspace(5, 40, 301)
    first, second = flight.states_at(times_s), flight.states_at(times_s + lap_s)
    np.testing.assert_allclose(first.positions_world_m, second.positions_world_m, atol=1e-11)
    np.testing.assert_allclose(first.R_world_body, second.R_world_body, atol=1e-11)
    np.testing.assert_allclose(
        yaws_deg(flight, np.array([3.0, 9.0, 15.0, 21.0, 27.0])), [0, 90, 180, -90, 0], atol=1e-9
    )


def test_a_survey_flies_every_lane() -> None:
    """Lanes lie spacing apart to the left of the course; the middle of each is flown along it, to and fro."""
    options = SurveyOptions(start_m=(1, 2, 10), lane_m=40, lanes=3, spacing_m=8, course_deg=90, speed_m_s=4)
    middles_s = np.array([5.0, 17.0, 29.0])
    states = Flight(options).states_at(middles_s)
    np.testing.assert_allclose(states.positions_world_m, [[1, 22, 10], [-7, 22, 10], [-15, 22, 10]], atol=1e-9)
    np.testing.assert_allclose(states.velocities_world_m_s, [[0, 4, 0], [0, -4, 0], [0, 4, 0]], atol=1e-9)


def test_a_climb_is_flown_with_the_nose_where_it_goes() -> None:
    """Legs straight up have no course: before the first it is the next one's, later the last one's; orders stay."""
    climb = [Waypoint(position_m=(0, 0, z)) for z in (0, 10)]
    along = [Waypoint(position_m=(0, -20, 10)), Waypoint(position_m=(0, -20, 20), yaw_deg=45.0)]
    flight = Flight(WaypointsOptions(waypoints=(*climb, *along, Waypoint(position_m=(9, 9, 20))), speed_m_s=2.0))
    np.testing.assert_allclose(
        yaws_deg(flight, np.array([0.0, 10.0, 15.0, 26.0, 99.0])), [-90, -90, -90, 45, 45], atol=1e-9
    )


@pytest.mark.parametrize("axis", ["yaw", "roll"])
@pytest.mark.parametrize("angle_deg", [10.0, 45.0, 75.0])
@pytest.mark.parametrize("angular_speed_rad_s", [2.5, 10.718])
def test_a_burst_reaches_its_angular_speed(axis: str, angle_deg: float, angular_speed_rad_s: float) -> None:
    """The peak over time is the speed that was ordered, about the ordered axis; nothing else turns."""
    options = BurstOptions(
        position_m=(0, 0, 3), yaw_deg=50, axis=axis, angle_deg=angle_deg,
        angular_speed_rad_s=angular_speed_rad_s, period_s=3.0, count=4,
    )  # fmt: skip
    rates = Flight(options).states_at(np.arange(-0.5, 11.0, 2e-4)).angular_velocities_body_rad_s
    column = {"roll": 0, "yaw": 2}[axis]
    assert np.abs(rates[:, column]).max() == pytest.approx(angular_speed_rad_s, rel=1e-4)
    assert np.abs(np.delete(rates, column, axis=1)).max() < 1e-9


def test_four_bursts_of_roll_come_home() -> None:
    """Left and right in turn: after four the position is the first one again, at rest, level."""
    options = BurstOptions(position_m=(1, 2, 3), axis="roll", angular_speed_rad_s=6, angle_deg=45, count=4)
    state = Flight(options).states_at(np.array([60.0]))
    np.testing.assert_allclose(state.positions_world_m[0], [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(state.R_world_body[0], np.eye(3), atol=1e-12)


SURVEY = 'base = "park-day"\n[flight]\nkind = "survey"\nstart_m = [0, 0, 9]\nlane_m = 9\nlanes = 2\nspacing_m = 3\n'


def loaded(folder: Path, text: str) -> object:
    path = folder / "scene.toml"
    path.write_text(text)
    return load_scene(path).flight


def test_a_scene_says_its_kind(tmp_path: Path) -> None:
    """A flight of another kind replaces that of the base; one of the same kind, or of none, changes it."""
    assert loaded(tmp_path, SURVEY) == SurveyOptions(start_m=(0, 0, 9), lane_m=9, lanes=2, spacing_m=3)
    (tmp_path / "survey.toml").write_text(SURVEY)
    path = tmp_path / "survey.toml"
    changed = loaded(tmp_path, f'base = "{path}"\n[flight]\nlanes = 4\n')
    assert changed == SurveyOptions(start_m=(0, 0, 9), lane_m=9, lanes=4, spacing_m=3)
    assert isinstance(loaded(tmp_path, 'base = "park-day"\n'), FlightOptions)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"survey"', '"circus"', r"Expected kind to be one of waypoints, .* got 'circus', at flight"),
        ("lanes = 2\n", "", r"Expected a value for flight.lanes, got none"),
        ("lanes = 2", "lanes = 2\nloops = 3", r"Expected only known keys, got flight.loops"),
        ("lanes = 2", "lanes = 0", r"Expected lanes >= 1, spacing_m not 0, got 0 and 3.0, at flight"),
        ("lane_m = 9", "lane_m = nan", r"Expected lane_m > 0, got nan"),
        ("lanes = 2", "lanes = 2\nspeed_m_s = 0", r"Expected speed_m_s > 0, got 0"),
        ("lanes = 2", "lanes = 2\ndrag_per_s = -1", r"Expected drag_per_s >= 0, got -1"),
    ],
)  # fmt: skip
def test_what_cannot_be_flown_is_refused_by_name(tmp_path: Path, old: str, new: str, message: str) -> None:
    """The key lies at ``flight``, however its kind was chosen."""
    assert old in SURVEY
    with pytest.raises(SceneError, match=message):
        loaded(tmp_path, SURVEY.replace(old, new))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: WaypointsOptions(waypoints=()), "at least one waypoint"),
        (lambda: WaypointsOptions(waypoints=(SQUARE[0], SQUARE[0])), "use hold_s"),
        (lambda: LoopOptions(waypoints=SQUARE, laps=0), "one lap"),
        (lambda: Waypoint(position_m=(0, 0, float("inf"))), "finite waypoint"),
        (lambda: Waypoint(position_m=(0, 0, 0), hold_s=-1.0), "hold_s >= 0"),
        (lambda: Waypoint(position_m=(0, 0, 0), speed_m_s=0.0), "speed_m_s > 0"),
        (lambda: BurstOptions(position_m=(0, 0, 0), angular_speed_rad_s=0), "angular_speed_rad_s > 0"),
        (lambda: BurstOptions(position_m=(0, 0, 0), angular_speed_rad_s=0.1), "period_s >= 22.*run together"),
        (lambda: BurstOptions(position_m=(0, 0, 0), angular_speed_rad_s=9, axis="roll", angle_deg=90), "below 90"),
    ],
)
def test_impossible_options_are_refused(make: object, message: str) -> None:
    """No place to go, no way between two places, no speed: each says what it expected."""
    with pytest.raises(ValueError, match=message):
        make()
