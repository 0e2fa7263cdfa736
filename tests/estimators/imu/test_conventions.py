"""Odd readings of both streams are recognised, and clean ones are left alone."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, RotationSpline

from fedora_qa.diagnosis.imu import convention_hypotheses
from fedora_qa.estimators.imu.conventions import (
    InertialConvention,
    _turn,
    explain_forces,
    explain_rates,
    signed_permutations,
)
from fedora_qa.estimators.imu.samples import InertialNoise, InertialSamples
from fedora_qa.estimators.imu.specific_force import upright
from tests.support.motion_world import GRAVITY_M_S2, NOISY, RESTLESS, sample_motion

Plant = Callable[[InertialSamples], InertialSamples]

IMU_FIELDS = ("imu_times_s", "angular_velocities_body_rad_s", "specific_forces_body_m_s2")
IDENTITY = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
SWAP_XY = ((0, 1, 0), (1, 0, 0), (0, 0, 1))
Y_Z_REVERSED = ((1, 0, 0), (0, -1, 0), (0, 0, -1))
FRD = np.array([1.0, -1.0, -1.0])
NED_ENU = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])


def rates(change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    return lambda s: replace(s, angular_velocities_body_rad_s=change(s.angular_velocities_body_rad_s))


def quaternions(change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    return lambda s: replace(s, orientations_xyzw=change(s.orientations_xyzw))


def positions(change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    return lambda s: replace(s, positions_world_m=change(s.positions_world_m))


def gravity(share: float) -> Plant:
    return lambda s: replace(s, specific_forces_body_m_s2=RESTLESS.specific_forces(s.imu_times_s, share * GRAVITY_M_S2))


def both_sensors(change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    return lambda s: replace(
        s,
        angular_velocities_body_rad_s=change(s.angular_velocities_body_rad_s),
        specific_forces_body_m_s2=change(s.specific_forces_body_m_s2),
    )


def north_east_down(s: InertialSamples) -> InertialSamples:
    turned = NED_ENU * Rotation.from_quat(s.orientations_xyzw) * Rotation.from_matrix(np.diag(FRD))
    return replace(s, positions_world_m=NED_ENU.apply(s.positions_world_m), orientations_xyzw=turned.as_quat())


RATE_CASES = {
    "clean": (lambda s: s, InertialConvention()),
    "degrees": (rates(np.degrees), InertialConvention(rate_unit=float(np.degrees(1.0)))),
    "wxyz": (quaternions(lambda q: q[:, [3, 0, 1, 2]]), InertialConvention(quaternions="wxyz")),
    "inverse": (quaternions(lambda q: q * [-1, -1, -1, 1]), InertialConvention(quaternions="inverse")),
    "swapped": (both_sensors(lambda v: v[:, [1, 0, 2]]), InertialConvention(sensor_axes=SWAP_XY)),
    "right-down": (both_sensors(lambda v: v * FRD), InertialConvention(sensor_axes=Y_Z_REVERSED)),
    "ned": (north_east_down, InertialConvention(sensor_axes=Y_Z_REVERSED)),
}

FORCE_CASES = {
    "clean": (lambda s: s, InertialConvention()),
    "wxyz": (quaternions(lambda q: q[:, [3, 0, 1, 2]]), InertialConvention(quaternions="wxyz")),
    "inverse": (quaternions(lambda q: q * [-1, -1, -1, 1]), InertialConvention(quaternions="inverse")),
    "swapped sensor": (both_sensors(lambda v: v[:, [1, 0, 2]]), InertialConvention(sensor_axes=SWAP_XY)),
    "right-down": (both_sensors(lambda v: v * FRD), InertialConvention(sensor_axes=Y_Z_REVERSED)),
    "swapped world": (positions(lambda p: p[:, [1, 0, 2]]), InertialConvention(world_axes=SWAP_XY)),
    "millimetres": (positions(lambda p: 1000 * p), InertialConvention(length_unit=1000.0)),
    "ned": (north_east_down, InertialConvention(sensor_axes=Y_Z_REVERSED, gravity="reversed")),
    "no gravity": (gravity(0.0), InertialConvention(gravity="missing")),
    "gravity up": (gravity(-1.0), InertialConvention(gravity="reversed")),
}


def is_like(found: InertialConvention | None, expected: InertialConvention) -> bool:
    return found is not None and replace(found, residual=0.0, declared_residual=0.0, count=0) == expected


@pytest.mark.parametrize("noise", [None, NOISY], ids=["exact", "noisy"])
@pytest.mark.parametrize(("plant", "expected"), RATE_CASES.values(), ids=RATE_CASES)
def test_rates_tell_how_the_file_must_be_read(plant: Plant, expected: InertialConvention, noise: object) -> None:
    """Every odd reading of rotations is named, and none is invented, with and without noise."""
    samples = plant(sample_motion(noise=noise))  # type: ignore[arg-type]
    assert is_like(explain_rates(samples, NOISY.rotation_sigma_rad if noise else 1e-9), expected)


@pytest.mark.parametrize("noise", [None, NOISY], ids=["exact", "noisy"])
@pytest.mark.parametrize(("plant", "expected"), FORCE_CASES.values(), ids=FORCE_CASES)
def test_forces_tell_how_the_file_must_be_read(plant: Plant, expected: InertialConvention, noise: object) -> None:
    """Every odd reading of translations is named, and none is invented, with and without noise."""
    sigma_m = (NOISY.position_sigma_m if noise else 1e-9) * expected.length_unit
    samples = plant(sample_motion(noise=noise))  # type: ignore[arg-type]
    if noise and plant in (FORCE_CASES["no gravity"][0], FORCE_CASES["gravity up"][0]):
        sigma_m = NOISY.position_sigma_m
    assert is_like(explain_forces(samples, GRAVITY_M_S2, sigma_m), expected)


@pytest.mark.parametrize("case", ["clean", "degrees", "swapped", "right-down"])
def test_orientations_that_err_by_degrees_are_compared_over_longer_spans(case: str) -> None:
    """Noise of three degrees, which hides the motion between neighbouring poses, hides no reading."""
    noise = replace(NOISY, rotation_sigma_rad=0.05)
    plant, expected = RATE_CASES[case]
    assert is_like(explain_rates(plant(sample_motion(noise=noise)), 0.05), expected)


def test_noise_alone_leaves_a_residual_of_one() -> None:
    """Over many draws, with the right reading; the declared one, where it is another, leaves far more."""
    swap = FORCE_CASES["swapped world"][0]
    rate_residuals, force_residuals = [], []
    for seed in range(20):
        samples = sample_motion(noise=NOISY, seed=seed)
        by_rates = explain_rates(samples, NOISY.rotation_sigma_rad)
        by_forces = explain_forces(swap(samples), GRAVITY_M_S2, NOISY.position_sigma_m)
        assert by_rates is not None
        assert by_forces is not None
        assert by_rates.residual == by_rates.declared_residual
        assert by_forces.declared_residual > 25 * by_forces.residual
        rate_residuals.append(by_rates.residual)
        force_residuals.append(by_forces.residual)
    assert np.mean(rate_residuals) == pytest.approx(1.0, abs=0.25)
    assert np.mean(force_residuals) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("case", ["clean", "swapped sensor", "right-down", "no gravity", "gravity up"])
def test_a_quarter_of_a_second_of_exact_poses_tells_the_reading(case: str) -> None:
    """Exact poses need no long spans: a part of a short file is enough."""
    plant, expected = FORCE_CASES[case]
    assert is_like(explain_forces(plant(sample_motion(duration_s=0.25)), GRAVITY_M_S2, 1e-9), expected)


@pytest.mark.parametrize("case", ["clean", "degrees", "wxyz", "swapped", "right-down"])
def test_a_quarter_of_a_second_of_exact_orientations_tells_the_reading(case: str) -> None:
    """The same for rotations."""
    plant, expected = RATE_CASES[case]
    assert is_like(explain_rates(plant(sample_motion(duration_s=0.25)), 1e-9), expected)


def test_readings_by_axes_are_ordered_by_how_much_they_exchange() -> None:
    """Of 48, one is as declared, three exchange two axes (they undo themselves), one reverses Y and Z."""
    for axes in signed_permutations():
        matrix = np.array(axes)
        exchanges = bool(np.all(matrix >= 0) and np.array_equal(matrix @ matrix, np.eye(3)))
        due = 0.0 if axes == IDENTITY else 1.0 if exchanges or axes == Y_Z_REVERSED else 2.0
        assert InertialConvention(sensor_axes=axes).complexity == due
        assert InertialConvention(world_axes=axes, gravity="missing").complexity == due + 0.5
    assert len(set(signed_permutations())) == 48
    assert InertialConvention("inverse", rate_unit=2.0).complexity == 2.0
    assert InertialConvention("wxyz inverse", length_unit=2.0).complexity == 3.0


@pytest.mark.parametrize(
    ("residual", "declared", "share"),
    [(1.0, 101.0, 1.0), (51.0, 101.0, 0.5), (101.0, 101.0, 0.0), (0.5, 101.0, 1.0), (0.5, 0.9, 0.0), (9.0, 1.0, 0.0)],
)
def test_a_reading_explains_what_it_removes_beyond_noise(residual: float, declared: float, share: float) -> None:
    """Noise alone leaves 1 of either residual."""
    found = InertialConvention(residual=residual, declared_residual=declared, count=100)
    assert found.explained == pytest.approx(share)


def test_disagreement_of_noise_scatters_as_stated() -> None:
    """The rms of 20 comparisons of three axes, over many draws."""
    squares = np.mean(np.random.default_rng(0).standard_normal((4000, 60)) ** 2, axis=1)
    stated = [InertialConvention(declared_residual=float(square), count=20).disagreement for square in squares]
    assert np.std([rms for rms, _ in stated]) == pytest.approx(stated[0][1], rel=0.05)


def test_three_rates_are_no_curve() -> None:
    """A steady turn fits whatever curve is drawn through its rates; a cubic one needs four of them."""
    times_s, rate_rad_s = np.arange(101) / 200, np.array([0.3, -0.5, 0.9])
    for count, is_enough in ((3, False), (4, True)):
        zeros = np.zeros((count, 3))
        turning = InertialSamples(
            np.linspace(0, 0.5, count), zeros + rate_rad_s, zeros, times_s, np.zeros((101, 3)),
            Rotation.from_rotvec(np.outer(times_s, rate_rad_s)).as_quat(),
        )  # fmt: skip
        assert (explain_rates(turning, 1e-9) is not None) == is_enough


def test_streams_that_nothing_reconciles_are_left_unexplained() -> None:
    """Another flight's gyro fits no reading."""
    samples = sample_motion()
    other = sample_motion(replace(RESTLESS, frequencies_hz=(0.5, 0.7, 1.3, 0.5, 0.7, 0.9)))
    mixed = replace(samples, angular_velocities_body_rad_s=other.angular_velocities_body_rad_s)
    assert explain_rates(mixed, 1e-9) is None


def test_too_few_samples_explain_nothing() -> None:
    """A twentieth of a second is not enough to choose among hundreds of readings."""
    samples = sample_motion(duration_s=0.05)
    whole = sample_motion(duration_s=0.5)
    still = whole.between(0.1, 0.1)
    few_poses = replace(still, **{name: getattr(whole, name) for name in IMU_FIELDS})
    few_rates = replace(whole, **{name: getattr(whole, name)[::250] for name in IMU_FIELDS})
    for few in (samples, few_poses, few_rates):
        assert explain_rates(few, 1e-9) is None
        assert explain_forces(few, GRAVITY_M_S2, 1e-9) is None


def unity(s: InertialSamples) -> InertialSamples:
    """World X east, Y up, Z north; body X right, Y up, Z forward: both left-handed."""
    world = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    body = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    turned = Rotation.from_matrix(world @ Rotation.from_quat(s.orientations_xyzw).as_matrix() @ body.T)
    return replace(s, positions_world_m=s.positions_world_m @ world.T, orientations_xyzw=turned.as_quat())


def unreal(s: InertialSamples) -> InertialSamples:
    """Left-handed by the Y axis, in centimetres."""
    q = s.orientations_xyzw * [-1.0, 1.0, -1.0, 1.0]
    return replace(s, positions_world_m=s.positions_world_m * [100.0, -100.0, 100.0], orientations_xyzw=q)


def compass(s: InertialSamples) -> InertialSamples:
    """Yaw is counted clockwise from north."""
    yaw, pitch, roll = Rotation.from_quat(s.orientations_xyzw).as_euler("ZYX").T
    q = Rotation.from_euler("ZYX", np.stack((np.pi / 2 - yaw, pitch, roll), axis=1)).as_quat()
    return replace(s, orientations_xyzw=q)


def subtracted_along_body(s: InertialSamples) -> InertialSamples:
    return replace(s, specific_forces_body_m_s2=s.specific_forces_body_m_s2 - [0.0, 0.0, GRAVITY_M_S2])


@pytest.mark.parametrize("noise", [None, NOISY], ids=["exact", "noisy"])
def test_pose_in_frames_of_other_engines_is_recognised_from_forces(noise: InertialNoise | None) -> None:
    """A frame of world and body, left-handed ones included, is the sensor's axes and the axis that points upwards."""

    def found(plant: Plant, unit: float = 1.0, yaw: int = 1) -> InertialConvention:
        sigma_m = NOISY.position_sigma_m if noise else 1e-9
        convention = explain_forces(plant(sample_motion(noise=noise)), GRAVITY_M_S2, unit * sigma_m, (yaw, 1, 1))
        assert convention is not None
        return convention

    of_unity, of_unreal, of_compass = found(unity), found(unreal, 100.0), found(compass, yaw=-1)
    assert (of_unity.up, of_unity.world_axes, of_unity.gravity) == ((0, 1, 0), IDENTITY, "declared")
    assert np.array_equal(of_unity.sensor_axes, [[0, 0, 1], [-1, 0, 0], [0, 1, 0]])
    assert of_unreal.sensor_axes == ((1, 0, 0), (0, -1, 0), (0, 0, 1))
    assert (of_unreal.up, of_unreal.length_unit) == ((0, 0, 1), 100.0)
    assert of_compass.angle_signs == (-1, 1, 1)
    assert found(subtracted_along_body).gravity == "subtracted along z"


def turned_sensor(s: InertialSamples, turn: Rotation) -> InertialSamples:
    return both_sensors(turn.apply)(s)


def turned_world(s: InertialSamples, turn: Rotation, *, with_attitudes: bool = True) -> InertialSamples:
    q = (turn * Rotation.from_quat(s.orientations_xyzw)).as_quat() if with_attitudes else s.orientations_xyzw
    return replace(s, positions_world_m=turn.apply(s.positions_world_m), orientations_xyzw=q)


TURN = Rotation.from_euler("zyx", [45, 10, -70], degrees=True)


@pytest.mark.parametrize("noise", [None, NOISY], ids=["exact", "noisy"])
@pytest.mark.parametrize("case", ["clean", "wxyz", "inverse"])
def test_quaternions_of_a_world_without_a_vertical_are_read_as_they_are_stored(
    case: str, noise: InertialNoise | None
) -> None:
    """The turn that sets such a world upright mixes components, and is left aside."""
    plant, expected = RATE_CASES[case]
    samples = upright(plant(turned_world(sample_motion(noise=noise), TURN)))
    assert np.abs(samples.turn_xyzw[3]) < 0.99
    assert is_like(explain_rates(samples, NOISY.rotation_sigma_rad if noise else 1e-9), expected)


@pytest.mark.parametrize("noise", [None, NOISY], ids=["exact", "noisy"])
def test_turns_by_any_angle_follow_from_the_motion(noise: InertialNoise | None) -> None:
    """Those of the sensor, of the world, and of positions alone, within the noise of 20 comparisons."""
    sigmas = (NOISY.rotation_sigma_rad, NOISY.position_sigma_m) if noise else (1e-9, 1e-9)
    samples = sample_motion(noise=noise)
    mounted = turned_sensor(samples, TURN)
    by_rates = explain_rates(mounted, sigmas[0])
    assert by_rates is not None
    by_forces = explain_forces(mounted, GRAVITY_M_S2, sigmas[1], sensor_axes=by_rates.sensor_axes)
    tilted = explain_forces(turned_world(samples, TURN), GRAVITY_M_S2, sigmas[1])
    headed = explain_forces(turned_world(samples, TURN, with_attitudes=False), GRAVITY_M_S2, sigmas[1])
    assert by_forces is not None
    assert tilted is not None
    assert headed is not None
    tolerance = 0.02 if noise else 1e-3
    np.testing.assert_allclose(by_rates.sensor_axes, TURN.as_matrix(), atol=tolerance)
    assert by_forces.sensor_axes == by_rates.sensor_axes
    np.testing.assert_allclose(tilted.up, TURN.apply([0, 0, 1]), atol=tolerance)
    assert tilted.sensor_axes == IDENTITY
    np.testing.assert_allclose(headed.world_axes, TURN.as_matrix(), atol=0.1 if noise else tolerance)
    assert headed.up == (0, 0, 1)


def test_a_turn_is_not_fitted_where_one_axis_has_all_motion_or_where_noise_is_left() -> None:
    motion = np.random.default_rng(0).normal(size=(200, 3))
    of_one_axis = motion * [1.0, 0.0, 0.0]
    assert len(_turn(motion, TURN.apply(motion), 1e-4)) == 1
    assert _turn(of_one_axis, TURN.apply(of_one_axis), 1e-4) == []
    assert _turn(motion, TURN.apply(motion) * [1.0, 1.0, 0.0], 1e-4) == []


@pytest.mark.parametrize("order", ["yxzw", "zyxw", "wzyx", "zwxy", "yzxw", "xywz"])
@pytest.mark.parametrize("noise", [None, NOISY], ids=["exact", "noisy"])
def test_any_order_of_components_is_recognised_from_forces(order: str, noise: InertialNoise | None) -> None:
    """Rates alone take some orders for the axes of another body; forces do not, as positions keep their axes."""
    places = ["xyzw".index(name) for name in order]
    samples = quaternions(lambda q: q[:, places])(sample_motion(noise=noise))
    convention = explain_forces(samples, GRAVITY_M_S2, NOISY.position_sigma_m if noise else 1e-9)
    assert is_like(convention, InertialConvention(quaternions=order))
    assert convention is not None
    assert convention.component_order == tuple(places)


@pytest.mark.parametrize("noise", [None, NOISY], ids=["exact", "noisy"])
def test_vectors_in_the_world_and_an_upside_down_world_are_recognised(noise: InertialNoise | None) -> None:
    """A body that flies upside down in its world has a world that points down, not a sensor with another sign."""
    sigma_m, samples = NOISY.position_sigma_m if noise else 1e-9, sample_motion(noise=noise)
    attitudes = RotationSpline(samples.pose_times_s, Rotation.from_quat(samples.orientations_xyzw))(samples.imu_times_s)
    forces_in_world = replace(samples, specific_forces_body_m_s2=attitudes.apply(samples.specific_forces_body_m_s2))
    by_forces = explain_forces(forces_in_world, GRAVITY_M_S2, sigma_m)
    assert by_forces is not None
    assert (by_forces.sensor_frame, by_forces.gravity) == ("world", "declared")
    ned_world = explain_forces(turned_world(samples, NED_ENU), GRAVITY_M_S2, sigma_m)
    assert ned_world is not None
    assert (ned_world.up, ned_world.gravity) == ((0, 0, -1), "declared")


def test_attitudes_near_none_leave_the_axes_of_the_sensor() -> None:
    """The inverse of an attitude without rotation turns as a sensor does whose axes are reversed."""
    pose_s, imu_s = np.arange(0, 1, 0.005), np.arange(0, 1, 0.001)
    frequencies = np.array([3.0, 2.0, 5.0])
    # Angles within 0.02 rad, of which angular velocities are the derivatives to 2%.
    attitudes = Rotation.from_rotvec(0.02 * np.sin(frequencies * pose_s[:, None]))
    velocities = 0.02 * frequencies * np.cos(frequencies * imu_s[:, None])
    reversed_gyro = replace(
        sample_motion(),
        imu_times_s=imu_s,
        angular_velocities_body_rad_s=-velocities,
        specific_forces_body_m_s2=np.zeros_like(velocities),
        pose_times_s=pose_s,
        orientations_xyzw=attitudes.as_quat(),
        positions_world_m=np.zeros((len(pose_s), 3)),
    )
    convention = explain_rates(reversed_gyro, 1e-4)
    assert convention is not None
    assert convention.quaternions == "inverse"
    assert convention.axes_of_sensor_alone == ((-1, 0, 0), (0, -1, 0), (0, 0, -1))
    causes = [(h.cause, h.stream) for h in convention_hypotheses("rotation", convention)]
    assert causes == [("quaternion_inverted", "pose"), ("frame_convention", "imu")]


@pytest.mark.parametrize("unit", [1e3, 30.0 / np.pi, 0.5 / np.pi], ids=["mrad/s", "turns a minute", "turns a second"])
def test_units_of_angular_velocity(unit: float) -> None:
    samples = rates(lambda v: v * unit)(sample_motion())
    assert is_like(explain_rates(samples, 1e-9), InertialConvention(rate_unit=unit))


def test_angle_counted_the_other_way_is_recognised_from_rates() -> None:
    """One reversed angle is the frame of no other body, so that signs of angles explain it alone."""
    for place in range(3):
        signs = [-1 if axis == place else 1 for axis in range(3)]

        def reverse(s: InertialSamples, signs: list[int] = signs) -> InertialSamples:
            angles = Rotation.from_quat(s.orientations_xyzw).as_euler("ZYX") * signs
            return replace(s, orientations_xyzw=Rotation.from_euler("ZYX", angles).as_quat())

        convention = explain_rates(reverse(sample_motion()), 1e-9)
        assert convention is not None
        assert list(convention.angle_signs) == signs
        assert convention.sensor_axes == IDENTITY
