import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError
from scipy.spatial.transform import Rotation

from fedora_generator.flight import AXES, Flight, FlightOptions, HarmonicTerm, Turn
from fedora_generator.rotations import multiply_quaternions, quaternions_from_rotation_vectors

LIVELY = FlightOptions(
    position_m=(1.0, -2.0, 3.0),
    velocity_m_s=(4.0, 0.5, -0.1),
    attitude_deg=(30.0, -5.0, 8.0),
    yaw_rate_deg_s=20.0,
    terms=tuple(
        HarmonicTerm(axis=axis, amplitude=2.0 + i, frequency_hz=0.3 + 0.2 * i, phase_deg=25.0 * i)
        for i, axis in enumerate(AXES)
    ),
    turns=(Turn(angle_deg=70.0, time_s=1.2, sigma_s=0.15),),
)


def test_position_is_the_closed_form_to_fifty_digits() -> None:
    """Position, velocity and acceleration equal the sum of line and sine evaluated and differentiated by mpmath."""
    times_s = np.array([0.0, 0.37, 12.5, 3600.25])
    states = Flight(LIVELY).states_at(times_s)
    with mpmath.workdps(50):
        for column, axis in enumerate("xyz"):
            (term,) = [term for term in LIVELY.terms if term.axis == axis]

            def value(t: mpmath.mpf, column: int = column, term: HarmonicTerm = term) -> mpmath.mpf:
                phase = 2 * mpmath.pi * mpmath.mpf(term.frequency_hz) * t + mpmath.radians(term.phase_deg)
                line = mpmath.mpf(LIVELY.position_m[column]) + mpmath.mpf(LIVELY.velocity_m_s[column]) * t
                return line + term.amplitude * mpmath.sin(phase)

            for row, time_s in enumerate(times_s):
                assert states.positions_world_m[row, column] == pytest.approx(float(value(mpmath.mpf(time_s))))
                for order, derivative in ((1, states.velocities_world_m_s), (2, states.accelerations_world_m_s2)):
                    expected = float(mpmath.diff(value, mpmath.mpf(time_s), order))
                    assert derivative[row, column] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_attitude_is_yaw_pitch_roll() -> None:
    """R_world_body and the quaternion are scipy's intrinsic ZYX rotation of the three angles."""
    options = FlightOptions(position_m=(0, 0, 0), attitude_deg=(40.0, -20.0, 65.0))
    state = Flight(options).states_at(np.zeros(1))
    expected = Rotation.from_euler("ZYX", [40.0, -20.0, 65.0], degrees=True)
    np.testing.assert_allclose(state.R_world_body[0], expected.as_matrix(), atol=1e-15)
    np.testing.assert_allclose(state.orientations_xyzw[0], expected.as_quat(canonical=True), atol=1e-15)


def test_positive_pitch_lowers_the_nose() -> None:
    """With Y to the left, a positive pitch points the body's X axis below the horizon, positive yaw to the left."""
    forward = Flight(FlightOptions(position_m=(0, 0, 0), attitude_deg=(90.0, 10.0, 0.0))).states_at(np.zeros(1))
    nose_world = forward.R_world_body[0] @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(nose_world, [0.0, np.cos(np.radians(10)), -np.sin(np.radians(10))], atol=1e-15)


def test_body_rates_are_the_derivative_of_the_attitude() -> None:
    """The analytic angular velocity is Log(R(t-h)^T R(t+h)) / 2h to second order in h, through turn and sines."""
    times_s, half_step_s = np.linspace(0, 3, 301), 1e-5
    flight = Flight(LIVELY)
    before = Rotation.from_matrix(flight.states_at(times_s - half_step_s).R_world_body)
    after = Rotation.from_matrix(flight.states_at(times_s + half_step_s).R_world_body)
    numeric = (before.inv() * after).as_rotvec() / (2 * half_step_s)
    np.testing.assert_allclose(flight.states_at(times_s).angular_velocities_body_rad_s, numeric, atol=2e-8)


def test_turn_reaches_its_angle_at_its_peak_rate() -> None:
    """A turn changes the yaw by its angle and peaks at angle / (sigma sqrt(2 pi)) in the middle."""
    turn = Turn(angle_deg=90.0, time_s=1.0, sigma_s=0.1)
    states = Flight(FlightOptions(position_m=(0, 0, 1), turns=(turn,))).states_at(np.array([0.0, 1.0, 2.0]))
    yaws_deg = Rotation.from_matrix(states.R_world_body).as_euler("ZYX", degrees=True)[:, 0]
    np.testing.assert_allclose(yaws_deg, [0.0, 45.0, 90.0], atol=1e-10)
    peak_rad_s = np.radians(90.0) / (0.1 * np.sqrt(2 * np.pi))
    np.testing.assert_allclose(states.angular_velocities_body_rad_s[1], [0, 0, peak_rad_s], atol=1e-12)


def test_quaternion_sign_never_jumps() -> None:
    """Over many whole turns neighbouring quaternions keep a positive scalar product."""
    options = FlightOptions(position_m=(0, 0, 0), yaw_rate_deg_s=500.0, attitude_deg=(0, 20.0, 170.0))
    q = Flight(options).states_at(np.arange(0, 10, 0.005)).orientations_xyzw
    assert np.all(np.sum(q[1:] * q[:-1], axis=1) > 0.99)


@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3), st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_quaternion_product_and_exponential_agree_with_scipy(left: list[float], right: list[float]) -> None:
    """Exp(a) * Exp(b) is scipy's product of the same rotation vectors, also at and next to zero."""
    product = multiply_quaternions(
        quaternions_from_rotation_vectors(np.array([left])), quaternions_from_rotation_vectors(np.array([right]))
    )
    expected = (Rotation.from_rotvec(left) * Rotation.from_rotvec(right)).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(product[0]).as_matrix(), expected, atol=1e-14)


@pytest.mark.parametrize("angle_rad", [0.0, 1e-300, 1e-12, 1e-8])
def test_exponential_of_a_tiny_rotation_is_exact(angle_rad: float) -> None:
    """The vector part is half the angle to the last digit down to zero: no 0 / 0, no cancellation."""
    (q,) = quaternions_from_rotation_vectors(np.array([[0.0, angle_rad, 0.0]]))
    np.testing.assert_allclose(q, [0.0, angle_rad / 2, 0.0, 1.0], rtol=1e-15, atol=0)


def test_options_are_read_from_a_table() -> None:
    """A plain table with lists and whole numbers becomes options; its terms too."""
    table = {
        "position_m": [0, 0, 2],
        "terms": [{"axis": "roll", "amplitude": 3, "frequency_hz": 1}],
        "turns": [{"angle_deg": 90, "time_s": 1, "sigma_s": 0.2}],
    }
    options = TypeAdapter(FlightOptions).validate_python(table)
    assert options == FlightOptions(
        position_m=(0, 0, 2),
        terms=(HarmonicTerm(axis="roll", amplitude=3, frequency_hz=1),),
        turns=(Turn(angle_deg=90, time_s=1, sigma_s=0.2),),
    )


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ({"position_m": [0, 0, 2], "speed": 3}, "speed"),
        ({"position_m": [0, 0, float("nan")]}, "position_m"),
        ({"position_m": [0, 0, 2], "terms": [{"axis": "w", "amplitude": 1, "frequency_hz": 1}]}, "axis"),
        ({"position_m": [0, 0, 2], "turns": [{"angle_deg": 90, "time_s": 1, "sigma_s": 0}]}, "sigma_s"),
    ],
)
def test_bad_options_are_refused_by_name(table: dict[str, object], named: str) -> None:
    """An unknown key, a NaN, an unknown axis and a turn without duration are refused, and the message names them."""
    with pytest.raises(ValidationError, match=named):
        TypeAdapter(FlightOptions).validate_python(table)


def test_times_must_be_a_finite_vector() -> None:
    """A scalar or a NaN among the times is an error, not a broken state."""
    for times_s in (np.array(1.0), np.array([0.0, np.nan])):
        with pytest.raises(ValueError, match="finite and of shape"):
            Flight(LIVELY).states_at(times_s)
