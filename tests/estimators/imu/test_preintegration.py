"""Integration of the gyro against motions whose rotation is known in closed form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.preintegration import (
    ROTATION_PARAMETERS,
    rotation_increments,
    rotation_rows,
    without_rotation_faults,
)
from fedora_qa.estimators.imu.samples import InertialNoise
from fedora_qa.geometry import so3
from tests.support.motion_world import EXACT, NOISY, sample_motion

FIRST_RAD_S, SECOND_RAD_S = np.array([0.0, 6.0, 4.0]), np.array([5.0, 0.0, 0.0])


def coning(times_s: NDArray[np.float64]) -> tuple[Rotation, NDArray[np.float64]]:
    """Two steady turns one after the other: R = Exp(a t) Exp(b t), whose body rate is Exp(-b t) a + b."""
    first, second = (
        Rotation.from_rotvec(np.outer(times_s, FIRST_RAD_S)),
        Rotation.from_rotvec(np.outer(times_s, SECOND_RAD_S)),
    )
    return first * second, second.inv().apply(FIRST_RAD_S) + SECOND_RAD_S


def coning_error_rad(rate_hz: float, duration_s: float = 0.5) -> float:
    times_s = np.arange(round(duration_s * rate_hz) + 1) / rate_hz
    truth, rates = coning(times_s)
    increment = rotation_increments(times_s, rates, times_s[:1], times_s[-1:], substeps=len(times_s) - 1)[0]
    return float((truth[0].inv() * truth[-1] * Rotation.from_quat(increment).inv()).magnitude())


def test_coning_at_a_kilohertz() -> None:
    """Half a second at up to 12 rad/s about turning axes is right to 1e-9 rad; without coning 1e-5 would be left."""
    assert coning_error_rad(1000.0) < 1e-9


@pytest.mark.parametrize("rate_hz", [100.0, 200.0, 400.0])
def test_fourth_order(rate_hz: float) -> None:
    """Each halving of the step leaves a sixteenth of the error."""
    assert coning_error_rad(rate_hz) / coning_error_rad(2 * rate_hz) == pytest.approx(16, rel=0.25)


@given(st.tuples(*[st.floats(-8, 8)] * 3).map(np.array), st.integers(1, 7))
def test_steady_turns_are_exact(rate_rad_s: Any, substeps: int) -> None:
    """A constant rate integrates to rate times time, over any interval, however it is cut."""
    times_s = np.arange(21) / 200
    starts_s, stops_s = np.array([0.0, 0.0123]), np.array([0.1, 0.0701])
    rates = np.tile(rate_rad_s, (21, 1))
    found = so3.log_quaternion(rotation_increments(times_s, rates, starts_s, stops_s, substeps=substeps))
    np.testing.assert_allclose(found, np.outer(stops_s - starts_s, rate_rad_s), atol=1e-13)


@pytest.mark.parametrize(("imu_rate_hz", "pose_rate_hz"), [(1000.0, 200.0), (400.0, 30.0), (200.0, 200.0)])
def test_exact_samples_leave_no_residual(imu_rate_hz: float, pose_rate_hz: float) -> None:
    """The residual of exact streams is below twice the error that the estimator itself states."""
    samples = sample_motion(imu_rate_hz=imu_rate_hz, pose_rate_hz=pose_rate_hz)
    rows = rotation_rows(samples, EXACT)
    inner = slice(3, -3)
    size, stated = np.abs(rows.residuals[inner]).max(), np.abs(rows.model_errors[inner]).max()
    assert size < 2 * stated + 1e-14


def test_derivatives_are_those_of_the_residuals() -> None:
    """Each column of the Jacobian is the difference that a small fault makes, by taking it out of the samples."""
    samples = sample_motion()
    rows = rotation_rows(samples, EXACT)
    step = 1e-6
    for column, name in enumerate(ROTATION_PARAMETERS.names):
        if name.startswith("bias"):
            continue  # linear: never taken out of the samples
        faults = np.zeros(len(ROTATION_PARAMETERS.names))
        faults[column] = step
        altered = rotation_rows(without_rotation_faults(samples, faults), EXACT)
        shared = np.intersect1d(rows.poses, altered.poses, return_indices=True)[1:]
        change = -(altered.residuals[shared[1]] - rows.residuals[shared[0]]) / step
        expected = rows.jacobians[shared[0], :, column]
        np.testing.assert_allclose(change, expected, atol=2e-3 * np.abs(expected).max(), err_msg=name)


def test_covariance_is_that_of_the_residuals() -> None:
    """Over many draws, variances and covariances of neighbours match the stated ones, with all noise on."""
    noise = InertialNoise(gyro_density=0.01, rotation_sigma_rad=0.001, gravity_m_s2=9.81)
    draws = [rotation_rows(sample_motion(noise=noise, duration_s=1.0, seed=seed), noise) for seed in range(40)]
    residuals = np.array([rows.residuals for rows in draws])
    bands = draws[0].covariance_bands[0]
    own = np.mean(residuals**2)
    shared = np.mean(residuals[:, 1:] * residuals[:, :-1])
    # The gyro's share is stated for a spline through free samples; knots that intervals share take up to a tenth.
    assert own == pytest.approx(bands[1].mean(), rel=0.06)
    assert shared == pytest.approx(bands[0, 1:].mean(), rel=0.15)


def test_noise_of_the_poses_alone_is_met_exactly() -> None:
    """Pose noise couples neighbours by minus half the variance."""
    rows = rotation_rows(sample_motion(noise=NOISY), NOISY)
    assert rows.covariance_bands[0, 0, 5] / rows.covariance_bands[0, 1, 5] == pytest.approx(-0.5, abs=1e-2)


@pytest.mark.parametrize("noise", [InertialNoise(), InertialNoise(gyro_density=1e-4, rotation_rounding_rad=1e-9)])
def test_errors_at_rest_are_those_of_what_is_stored(noise: InertialNoise) -> None:
    """Without motion no stamp matters: an interval holds both poses' rounding and the gyro's noise, nothing else."""
    moving = sample_motion(duration_s=0.1)
    still = replace(
        moving,
        orientations_xyzw=np.tile([0.0, 0.0, 0.0, 1.0], (len(moving.pose_times_s), 1)),
        angular_velocities_body_rad_s=np.zeros_like(moving.angular_velocities_body_rad_s),
    )
    shared, own = rotation_rows(still, noise).covariance_bands[0]
    pose_variance = noise.rotation_rounding_rad**2 + 1e-30
    np.testing.assert_allclose(own, 2 * pose_variance + noise.gyro_density**2 / 200, rtol=1e-9)
    np.testing.assert_allclose(shared[1:], -pose_variance, rtol=1e-9)


def test_a_pose_errs_by_the_faster_step_beside_it() -> None:
    """Of a body that turns during one step alone, both poses of this step have errors of their timestamps, no other."""
    moving = sample_motion(duration_s=0.1)
    orientations = np.tile([0.0, 0.0, 0.0, 1.0], (len(moving.pose_times_s), 1))
    orientations[1:] = Rotation.from_rotvec([0.0, 0.0, 0.05]).as_quat()
    still = replace(
        moving,
        orientations_xyzw=orientations,
        angular_velocities_body_rad_s=np.zeros_like(moving.angular_velocities_body_rad_s),
    )
    shared = -rotation_rows(still, InertialNoise()).covariance_bands[0, 0]
    # Intervals 0 and 1 share pose 1, whose step before it turns; 1 and 2 share pose 2, beside steps at rest.
    assert shared[1] > 10 * shared[2]
    np.testing.assert_allclose(shared[3:], shared[2])


def test_no_interval_spans_a_gap_of_the_poses() -> None:
    """Where poses are missing, the intervals on either side are compared, and none across."""
    samples = sample_motion(duration_s=0.5)
    kept = np.r_[0:40, 60:101]
    poses = {name: getattr(samples, name)[kept] for name in ("pose_times_s", "positions_world_m", "orientations_xyzw")}
    rows = rotation_rows(replace(samples, **poses), EXACT)
    assert rows.poses.tolist() == [*range(39), *range(40, 80)]
    assert rows.covariance_bands[0, 0, 39] == 0.0
    np.testing.assert_allclose(rows.spans_s, 0.005)
