import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight
from fedora_generator.flights.kinds import BurstOptions, HoverOptions, LoopOptions
from fedora_generator.flights.quadrotor import attitude_of_thrust
from fedora_generator.flights.route import Waypoint
from fedora_generator.imu import Imu, ImuOptions
from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

LIVELY = LoopOptions(
    waypoints=(
        Waypoint(position_m=(0, 0, 5), yaw_deg=170.0),
        Waypoint(position_m=(6, 1, 8), hold_s=0.4, speed_m_s=7.0),
        Waypoint(position_m=(4, 7, 3), yaw_deg=-150.0),
        Waypoint(position_m=(-5, 6, 6), yaw_deg=20.0),
    ),
    laps=2,
    speed_m_s=5.0,
    corner_s=0.4,
    turn_s=0.25,
    drag_per_s=0.3,
)
TIMES_S = np.linspace(-1, 18, 1901)


def test_position_differentiates_to_velocity_and_acceleration() -> None:
    """Central differences of the position give both, to second order in the step."""
    flight, h = Flight(LIVELY), 1e-4
    before, now, after = (flight.states_at(TIMES_S + shift) for shift in (-h, 0.0, h))
    velocities = (after.positions_world_m - before.positions_world_m) / (2 * h)
    accelerations = (after.velocities_world_m_s - before.velocities_world_m_s) / (2 * h)
    np.testing.assert_allclose(now.velocities_world_m_s, velocities, atol=1e-6)
    np.testing.assert_allclose(now.accelerations_world_m_s2, accelerations, atol=2e-6)


def test_body_rates_are_the_derivative_of_the_attitude() -> None:
    """The angular velocity is Log(R(t-h)^T R(t+h)) / 2h by scipy, with drag, climbs and turns of yaw."""
    flight, h = Flight(LIVELY), 1e-5
    before, after = (Rotation.from_matrix(flight.states_at(TIMES_S + shift).R_world_body) for shift in (-h, h))
    numeric = (before.inv() * after).as_rotvec() / (2 * h)
    found = flight.states_at(TIMES_S).angular_velocities_body_rad_s
    assert np.abs(found).max() > 1.0
    np.testing.assert_allclose(found, numeric, atol=2e-7)


def test_the_quaternion_is_the_matrix_and_never_jumps() -> None:
    """Both say the same rotation by scipy; neighbours keep a positive scalar product."""
    states = Flight(LIVELY).states_at(TIMES_S)
    matrices = Rotation.from_quat(states.orientations_xyzw).as_matrix()
    np.testing.assert_allclose(states.R_world_body, matrices, atol=1e-14)
    q = states.orientations_xyzw
    assert np.all(np.sum(q[1:] * q[:-1], axis=1) > 0.99)


def test_an_accelerometer_without_drag_feels_thrust_only() -> None:
    """Thrust lies along body Z: the specific force has no X or Y, which is what differential flatness means."""
    options = BurstOptions(position_m=(0, 0, 2), yaw_deg=30, axis="roll", angular_speed_rad_s=8.0)
    imu = Imu(ImuOptions(), np.random.default_rng(0)).sample(Flight(options), np.arange(0, 5_000_000, 1000))
    specific_forces = imu.specific_forces_body_m_s2
    np.testing.assert_allclose(specific_forces[:, :2], 0.0, atol=1e-13)
    assert np.all(specific_forces[:, 2] >= STANDARD_GRAVITY_M_S2 - 1e-12)


def test_drag_is_felt_against_the_motion() -> None:
    """At constant speed the accelerometer reads R^T (g - d v): the tilt is atan(d v / g), nose down."""
    options = LoopOptions(
        waypoints=(Waypoint(position_m=(0, 0, 5)), Waypoint(position_m=(100, 0, 5))), speed_m_s=8.0, drag_per_s=0.25
    )
    state = Flight(options).states_at(np.array([6.0]))
    _, pitch_rad, roll_rad = Rotation.from_matrix(state.R_world_body[0]).as_euler("ZYX")
    assert pitch_rad == pytest.approx(np.arctan(0.25 * 8.0 / STANDARD_GRAVITY_M_S2), abs=1e-12)
    assert roll_rad == pytest.approx(0.0, abs=1e-12)


def test_hover_is_level_and_still() -> None:
    """Nothing moves; the accelerometer reads gravity on Z, at any time."""
    flight = Flight(HoverOptions(position_m=(1, 2, 3), yaw_deg=90))
    times_us = np.array([0, 7_000_000, 3_600_000_000])
    states = flight.states_at(times_us / 1e6)
    np.testing.assert_array_equal(states.positions_world_m, np.tile([1, 2, 3], (3, 1)))
    np.testing.assert_allclose(states.R_world_body[2], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    imu = Imu(ImuOptions(), np.random.default_rng(0)).sample(flight, times_us)
    assert not imu.angular_velocities_body_rad_s.any()
    np.testing.assert_allclose(imu.specific_forces_body_m_s2, np.tile([0, 0, STANDARD_GRAVITY_M_S2], (3, 1)))


@given(
    st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(0.5, 30)),
    st.floats(-10, 10),
)
def test_body_z_is_the_thrust_and_the_yaw_is_kept(thrust: tuple[float, float, float], yaw_rad: float) -> None:
    """For any thrust above the horizon and any yaw: both are found again in the rotation, by scipy."""
    vector = np.array([thrust])
    attitude = attitude_of_thrust(vector, np.zeros((1, 3)), np.array([yaw_rad]), np.zeros(1))
    rotation = Rotation.from_euler("ZYX", attitude.yaw_pitch_roll_rad[0])
    np.testing.assert_allclose(rotation.apply([0, 0, 1]), vector[0] / np.linalg.norm(vector), atol=1e-12)
    nose = rotation.apply([1, 0, 0])
    np.testing.assert_allclose(nose[0] * np.sin(yaw_rad) - nose[1] * np.cos(yaw_rad), 0.0, atol=1e-12)
    assert nose[0] * np.cos(yaw_rad) + nose[1] * np.sin(yaw_rad) > 0


def test_a_dive_faster_than_falling_is_refused() -> None:
    """The quadrotor would have to turn over: one sentence, with the thrust that was asked for."""
    dive = LoopOptions(
        waypoints=(Waypoint(position_m=(0, 0, 90)), Waypoint(position_m=(0, 0, 10))), speed_m_s=30, corner_s=0.5
    )
    with pytest.raises(SceneError, match=r"Expected a thrust that points up, got -14\.\d+ m/s\^2; fly slower"):
        Flight(dive).states_at(np.array([0.0]))
