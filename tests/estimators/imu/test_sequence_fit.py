"""The fit of IMU against poses: planted faults come out to size, clean streams give nothing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.samples import InertialNoise, InertialSamples
from fedora_qa.estimators.imu.sequence_fit import ROTATION, TRANSLATION, InertialComparison, fit_inertial
from fedora_qa.estimators.imu.summary import InertialFit
from tests.support.motion_world import EXACT, GRAVITY_M_S2, HOVER, NOISY, RESTLESS, Motion, sample_motion

Plant = Callable[[InertialSamples], InertialSamples]


def late(offset_s: float) -> Plant:
    return lambda s: replace(s, imu_times_s=s.imu_times_s + offset_s)


def fast_imu(rate: float) -> Plant:
    return lambda s: replace(s, imu_times_s=s.imu_times_s * (1 + rate))


def fast_poses(rate: float) -> Plant:
    return lambda s: replace(s, pose_times_s=s.pose_times_s * (1 + rate))


def gyro_bias(bias: float) -> Plant:
    return lambda s: replace(
        s, angular_velocities_body_rad_s=s.angular_velocities_body_rad_s + np.array([0.0, bias, 0.0])
    )


def turned_gyro(angle_rad: float) -> Plant:
    turn = Rotation.from_rotvec([0.0, 0.0, angle_rad])
    return lambda s: replace(s, angular_velocities_body_rad_s=turn.apply(s.angular_velocities_body_rad_s))


def gain(excess: float) -> Plant:
    return lambda s: replace(s, angular_velocities_body_rad_s=s.angular_velocities_body_rad_s * (1 + excess))


def accel_bias(bias: float) -> Plant:
    return lambda s: replace(s, specific_forces_body_m_s2=s.specific_forces_body_m_s2 + np.array([bias, 0.0, 0.0]))


def heavier(excess: float) -> Plant:
    def plant(s: InertialSamples) -> InertialSamples:
        forces = RESTLESS.specific_forces(s.imu_times_s, GRAVITY_M_S2 + excess)
        return replace(s, specific_forces_body_m_s2=forces)

    return plant


def off_origin(arm_m: float) -> Plant:
    """Poses of a point backward of the IMU: the IMU sits forward of their origin."""

    def plant(s: InertialSamples) -> InertialSamples:
        arm = Rotation.from_quat(s.orientations_xyzw).apply([arm_m, 0.0, 0.0])
        return replace(s, positions_world_m=s.positions_world_m - arm)

    return plant


def fitted(comparison: InertialComparison, samples: InertialSamples, noise: InertialNoise) -> InertialFit:
    walk = noise.gyro_walk if comparison is ROTATION else noise.accel_walk
    fit = fit_inertial(samples, noise, comparison, bias_walk=walk)
    assert fit is not None
    return fit


@pytest.mark.parametrize("comparison", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
@pytest.mark.parametrize("motion", [RESTLESS, HOVER], ids=["restless", "hover"])
def test_exact_streams_agree(comparison: InertialComparison, motion: object) -> None:
    """Nothing is freed, and every parameter is 0 within a thousandth of its error."""
    fit = fitted(comparison, sample_motion(motion), EXACT)  # type: ignore[arg-type]
    assert fit.settled
    assert not any(one.free for one in fit.parameters.values())
    assert all(abs(one.value) < 1e-3 * one.standard_error for one in fit.parameters.values())


@pytest.mark.parametrize(
    ("comparison", "plant", "name", "size"),
    [
        (ROTATION, late(0.02), "time_offset", 0.02),
        (ROTATION, fast_imu(-4e-4), "clock_rate", -4e-4),
        (ROTATION, fast_poses(5e-4), "pose_clock_rate", 5e-4),
        (ROTATION, gyro_bias(0.003), "bias_y", 0.003),
        (ROTATION, turned_gyro(0.05), "tilt_z", 0.05),
        (ROTATION, gain(-0.03), "scale", -0.03),
        (TRANSLATION, late(-0.003), "time_offset", -0.003),
        (TRANSLATION, fast_imu(4e-4), "clock_rate", 4e-4),
        (TRANSLATION, fast_poses(-5e-4), "pose_clock_rate", -5e-4),
        (TRANSLATION, accel_bias(0.05), "bias_x", 0.05),
        (TRANSLATION, heavier(0.01), "gravity", 0.01),
        (TRANSLATION, off_origin(0.08), "lever_x", 0.08),
    ],
)
def test_a_fault_moves_its_own_group_alone_and_to_size(
    comparison: InertialComparison, plant: Plant, name: str, size: float
) -> None:
    """In exact streams the fault's group is freed, nothing else is off, and the size is right to six errors."""
    fit = fitted(comparison, plant(sample_motion()), EXACT)
    assert fit.settled
    group = name.removesuffix("_x").removesuffix("_y").removesuffix("_z")
    assert {one for one, f in fit.parameters.items() if f.free} == {
        one for one in fit.parameters if one.startswith(group)
    }
    for one, parameter in fit.parameters.items():
        expected = size if one == name else 0.0
        assert abs(parameter.value - expected) < 6 * parameter.standard_error + parameter.model_error, one
    assert fit.parameters[name].value == pytest.approx(size, rel=2e-3)
    assert fit.rms < fit.expected_rms


def test_errors_hold_under_noise() -> None:
    """Over many noisy draws nothing is freed, and values scatter about as their errors say."""
    deviations: dict[str, list[float]] = {}
    for seed in range(12):
        samples = sample_motion(noise=NOISY, seed=seed)
        for kind, comparison in (("rotation", ROTATION), ("translation", TRANSLATION)):
            fit = fitted(comparison, samples, NOISY)
            for name, one in fit.parameters.items():
                assert not one.free
                deviations.setdefault(f"{kind} {name}", []).append(one.value / one.standard_error)
            deviations.setdefault(kind, []).append((fit.rms - fit.expected_rms) / fit.rms_error)
    everything = np.concatenate(list(deviations.values()))
    assert np.max(np.abs(everything)) < 4.7
    assert 0.7 < np.std(everything) < 1.15
    assert all(np.std(one) < 1.7 for one in deviations.values())


def test_a_walking_bias_is_no_fault() -> None:
    """A bias that walks as declared is inside its error after half a minute, where it would be far outside without."""
    noise = replace(EXACT, accel_density=2e-3, accel_walk=0.02)
    samples = sample_motion(noise=noise, duration_s=30.0, pose_rate_hz=100.0, imu_rate_hz=500.0, seed=4)
    names = ("bias_x", "bias_y", "bias_z")
    allowed = fitted(TRANSLATION, samples, noise).parameters
    assert all(abs(allowed[name].value) < 4 * allowed[name].standard_error for name in names)
    forbidden = fitted(TRANSLATION, samples, replace(noise, accel_walk=0.0)).parameters
    assert any(abs(forbidden[name].value) > 6 * forbidden[name].standard_error for name in names)


@pytest.mark.parametrize("white", [EXACT, NOISY], ids=["no white noise", "white noise"])
@pytest.mark.parametrize("motion", [RESTLESS, HOVER], ids=["restless", "hover"])
def test_a_walk_far_above_white_noise_is_no_fault(white: InertialNoise, motion: Motion) -> None:
    """What a bias does within a segment is noise of its rows: all statistics scatter as their errors say.

    A gain acts on the walk as well, which is most of what the gyro of a hovering body measures.
    """
    noise = replace(white, gyro_walk=5e-3, accel_walk=5e-2)
    deviations: dict[str, list[float]] = {}
    for seed in range(6):
        samples = sample_motion(motion, noise, seed=seed)
        for comparison in (ROTATION, TRANSLATION):
            fit = fitted(comparison, samples, noise)
            assert fit.settled
            assert not any(one.free for one in fit.parameters.values())
            assert fit.rms < fit.expected_rms + 4 * fit.rms_error
            assert abs(fit.worst.value) < 5 * fit.worst.sigma
            for name, one in fit.parameters.items():
                deviations.setdefault(name, []).append(one.value / one.standard_error)
    assert np.max(np.abs(np.concatenate(list(deviations.values())))) < 4.7


def test_what_a_walk_does_within_a_segment_is_in_the_expected_residual() -> None:
    """w sqrt(L/6) h rad of a row that spans h, in a segment of length L, beside hardly any white noise."""
    walk, segment_s, step_s = 5e-3, 0.5, 0.005
    noise = replace(EXACT, gyro_walk=walk)
    fit = fitted(ROTATION, sample_motion(HOVER, noise), noise)
    assert fit.expected_rms == pytest.approx(walk * np.sqrt(segment_s / 6) * step_s, rel=0.02)
    assert fit.rms == pytest.approx(fit.expected_rms, rel=0.3)


def test_a_jump_is_left_out_of_the_fit_and_named_as_its_worst_row() -> None:
    """A jump of 5 mm moves no parameter; it is the worst row, at its time, and two rows are left out."""
    samples = sample_motion()
    positions = samples.positions_world_m.copy()
    positions[200:] += [0.005, 0.0, 0.0]
    fit = fitted(TRANSLATION, replace(samples, positions_world_m=positions), EXACT)
    assert not any(one.free for one in fit.parameters.values())
    assert fit.outliers == 2
    assert fit.worst.time_s == pytest.approx(0.9975, abs=0.003)
    assert abs(fit.worst.value) == pytest.approx(0.005 / 0.005, rel=0.01)
    assert fit.rms < fit.expected_rms


def test_hovering_cannot_show_a_lever_arm_under_noise() -> None:
    """The error of what the motion does not show is far larger than where the body turns."""
    still = fitted(TRANSLATION, sample_motion(HOVER, NOISY), NOISY).parameters["lever_x"]
    moving = fitted(TRANSLATION, sample_motion(RESTLESS, NOISY), NOISY).parameters["lever_x"]
    assert still.standard_error > 0.07
    assert moving.standard_error < 0.1 * still.standard_error


def test_streams_of_different_motions_do_not_settle_or_leave_residuals() -> None:
    """The IMU of another flight is told by its residuals, not explained away."""
    samples, other = sample_motion(), sample_motion(replace(RESTLESS, phases=(2.0, 0.1, 1.0, 3.0, 0.2, 1.0)))
    mixed = replace(
        samples,
        angular_velocities_body_rad_s=other.angular_velocities_body_rad_s,
        specific_forces_body_m_s2=other.specific_forces_body_m_s2,
    )
    for comparison in (ROTATION, TRANSLATION):
        fit = fitted(comparison, mixed, EXACT)
        assert fit.rms > 100 * fit.expected_rms


@pytest.mark.parametrize("comparison", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
@pytest.mark.parametrize("late_s", [0.49, 0.597, 0.7])
def test_too_little_in_common_is_said(comparison: InertialComparison, late_s: float) -> None:
    """Streams that hardly overlap, or do not at all, give None."""
    samples = sample_motion(duration_s=0.5)
    apart = replace(samples, imu_times_s=samples.imu_times_s + late_s)
    assert fit_inertial(apart, EXACT, comparison, bias_walk=0.0) is None


@pytest.mark.parametrize("comparison", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 8])
def test_few_poses_have_no_fit(comparison: InertialComparison, count: int) -> None:
    samples = sample_motion(duration_s=0.5)
    names = ("pose_times_s", "positions_world_m", "orientations_xyzw")
    few = replace(samples, **{name: getattr(samples, name)[20 : 20 + count] for name in names})
    assert fit_inertial(few, EXACT, comparison, bias_walk=0.0) is None
