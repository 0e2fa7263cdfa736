"""Second differences of position against specific force, on motions in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.samples import InertialNoise
from fedora_qa.estimators.imu.specific_force import (
    TRANSLATION_PARAMETERS,
    integrated_twice,
    translation_rows,
    upright,
    without_translation_faults,
)
from tests.support.motion_world import EXACT, GRAVITY_M_S2, HOVER, NOISY, sample_motion


def test_exact_samples_leave_no_residual() -> None:
    """The residual of exact streams is below 1e-9 m/s, and below twice the error that the estimator states."""
    rows = translation_rows(sample_motion(), EXACT)
    inner = slice(5, -5)
    size = np.abs(rows.residuals[inner]).max()
    assert size < 1e-9
    assert size < 2 * np.abs(rows.model_errors[inner]).max()


@pytest.mark.parametrize(
    ("noise", "duration_s", "tilt_rad"), [(EXACT, 1.0, 1e-6), (NOISY, 20.0, 2e-3)], ids=["exact", "noisy"]
)
def test_a_world_without_a_vertical_is_set_upright(noise: InertialNoise, duration_s: float, tilt_rad: float) -> None:
    """However the world lies, also upside down, Z points up afterwards; what happens in it stays."""
    level = sample_motion(noise=noise, duration_s=duration_s)
    for vector in ([1.1, -0.7, 0.4], [np.pi, 0.0, 0.0], [0.0, 0.0, 0.0]):
        turn = Rotation.from_rotvec(vector)
        tilted = replace(
            level,
            positions_world_m=turn.apply(level.positions_world_m),
            orientations_xyzw=(turn * Rotation.from_quat(level.orientations_xyzw)).as_quat(),
        )
        again = upright(tilted)
        left = Rotation.from_quat(again.orientations_xyzw[0]) * Rotation.from_quat(level.orientations_xyzw[0]).inv()
        up = left.apply([0.0, 0.0, 1.0])
        assert np.hypot(*up[:2]) < tilt_rad
        assert up[2] > 0
        np.testing.assert_allclose(again.positions_world_m, left.apply(level.positions_world_m), atol=1e-9)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_too_few_samples_set_no_world_upright(stream: str, count: int) -> None:
    """Of either stream three or fewer are no cubic curve: the world stays as it is."""
    samples = sample_motion(duration_s=1.0)
    times_s = samples.imu_times_s if stream == "imu" else samples.pose_times_s
    few = samples.between(0.5, times_s[np.searchsorted(times_s, 0.5) + count] - 1e-9)
    imu = {name: getattr(few, name) for name in
           ("imu_times_s", "angular_velocities_body_rad_s", "specific_forces_body_m_s2")}  # fmt: skip
    pose = {name: getattr(few, name) for name in ("pose_times_s", "positions_world_m", "orientations_xyzw")}
    few = replace(samples, **(imu if stream == "imu" else pose))
    assert len(getattr(few, f"{stream}_times_s")) == count
    assert upright(few) is few


def test_another_gravity_shows_as_that_times_the_time() -> None:
    """Declared gravity that is too small by 0.1 leaves -0.1 m/s^2 times the span of each row along Z."""
    declared = InertialNoise(gravity_m_s2=GRAVITY_M_S2 - 0.1)
    rows = translation_rows(sample_motion(), declared)
    np.testing.assert_allclose(rows.residuals[:, 2], -0.1 * rows.spans_s, rtol=1e-6)
    column = TRANSLATION_PARAMETERS.names.index("gravity")
    np.testing.assert_allclose(rows.jacobians[:, 2, column], -rows.spans_s, rtol=1e-9)


@pytest.mark.parametrize("name", ["time_offset", "clock_rate", "pose_clock_rate"])
def test_derivatives_by_the_clocks_are_those_of_the_residuals(name: str) -> None:
    """The columns of the clocks are the differences that small faults make, by taking them out of the stamps."""
    samples, step = sample_motion(), 1e-6
    column = TRANSLATION_PARAMETERS.names.index(name)
    faults = np.zeros(len(TRANSLATION_PARAMETERS.names))
    faults[column] = step
    rows = translation_rows(samples, EXACT)
    altered = translation_rows(without_translation_faults(samples, faults), EXACT)
    left, right = np.intersect1d(rows.poses, altered.poses, return_indices=True)[1:]
    change = -(altered.residuals[right] - rows.residuals[left]) / step
    expected = rows.jacobians[left, :, column]
    np.testing.assert_allclose(change[5:-5], expected[5:-5], atol=5e-3 * np.abs(expected).max())


def test_covariance_of_position_noise_is_that_of_second_differences() -> None:
    """For even stamps the bands are sigma^2 / T^2 times 6, -4 and 1, the autocorrelation of 1, -2, 1."""
    noise = InertialNoise(position_sigma_m=0.01, gravity_m_s2=GRAVITY_M_S2)
    bands = translation_rows(sample_motion(), noise).covariance_bands / (0.01 / 0.005) ** 2
    np.testing.assert_allclose(bands[:, :, 10], np.tile([1.0, -4.0, 6.0], (3, 1)), rtol=1e-6)


def test_an_interval_counts_both_steps_beside_its_pose() -> None:
    """Noise of the accelerometer adds a third of the base of the triangle, where a pose is missing, too.

    Two triangles, one of which falls while the other rises, share a sixth of the step between them.
    """
    noise = InertialNoise(accel_density=0.05, gravity_m_s2=GRAVITY_M_S2)
    samples = sample_motion(duration_s=0.5)
    kept = np.delete(np.arange(len(samples.pose_times_s)), 40)
    poses = {name: getattr(samples, name)[kept] for name in ("pose_times_s", "positions_world_m", "orientations_xyzw")}
    rows = translation_rows(replace(samples, **poses), noise)
    base_s = 2 * rows.spans_s
    assert np.ptp(base_s) == pytest.approx(0.005)
    np.testing.assert_allclose(rows.covariance_bands[0, 2], 0.05**2 * base_s / 3, rtol=0.03)
    shared_s = np.diff(samples.pose_times_s[kept])[rows.poses[:-1]]
    np.testing.assert_allclose(rows.covariance_bands[0, 1, 1:], 0.05**2 * shared_s / 6, rtol=0.05)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_second_differences_need_three_poses(count: int) -> None:
    """Fewer poses are no row, and no error."""
    samples = sample_motion(duration_s=0.1)
    few = {name: getattr(samples, name)[5 : 5 + count]
           for name in ("pose_times_s", "positions_world_m", "orientations_xyzw")}  # fmt: skip
    assert len(translation_rows(replace(samples, **few), EXACT)) == max(count - 2, 0)


def test_coarse_samples_err_as_stated() -> None:
    """Of an IMU at a fifth of its rate, the integral errs by no more than is stated, and not by far less."""
    samples = sample_motion()
    every = slice(None, None, 5)
    imu = {name: getattr(samples, name)[every] for name in
           ("imu_times_s", "angular_velocities_body_rad_s", "specific_forces_body_m_s2")}  # fmt: skip
    rows = translation_rows(replace(samples, **imu), EXACT)
    size, stated = (np.sqrt(np.mean(values[5:-5] ** 2)) for values in (rows.residuals, rows.model_errors))
    assert 0.1 * stated < size < 2 * stated


def test_covariance_is_that_of_the_residuals() -> None:
    """Over many draws, variances and covariances match the stated ones, with the accelerometer's noise too."""
    noise = InertialNoise(accel_density=0.05, position_sigma_m=1e-5, gravity_m_s2=GRAVITY_M_S2)
    draws = [translation_rows(sample_motion(noise=noise, duration_s=1.0, seed=seed), noise) for seed in range(40)]
    residuals = np.array([rows.residuals for rows in draws])
    bands = draws[0].covariance_bands[0]
    for lag in range(3):
        found = np.mean(residuals[:, lag:] * residuals[:, : residuals.shape[1] - lag])
        assert found == pytest.approx(bands[2 - lag, lag:].mean(), rel=0.06, abs=0.03 * bands[2].mean())


def test_noisy_orientations_disturb_across_gravity_only() -> None:
    """Errors of the attitude turn specific force: near hover that is met level, and nothing upright."""
    noise = InertialNoise(rotation_sigma_rad=0.001, gravity_m_s2=GRAVITY_M_S2)
    draws = [translation_rows(sample_motion(HOVER, noise, duration_s=1.0, seed=seed), noise) for seed in range(30)]
    # Sums of neighbours hold what averages do not take away: the density, which is all that a fit sees.
    sums = np.array([rows.residuals[10:-10].sum(axis=0) for rows in draws])
    bands = draws[0].covariance_bands[:, :, 10:-10]
    expected = bands[:, 2].sum(axis=-1) + 2 * bands[:, 1].sum(axis=-1)
    assert np.mean(sums[:, :2] ** 2) == pytest.approx(expected[:2].mean(), rel=0.4)
    assert np.sqrt(np.mean(sums[:, 2] ** 2)) < 0.05 * np.sqrt(expected[0])
    assert expected[2] < 0.01 * expected[0]


@pytest.mark.parametrize("knots", [2, 3, 4, 5, 9, 400])
def test_integrals_are_those_of_scipy(knots: int) -> None:
    """Between uneven knots, at them, and beyond the first and last, for any number of knots."""
    random = np.random.default_rng(knots)
    times_s = np.cumsum(random.uniform(0.5, 1.5, knots)) * 1e-3
    values = random.normal(size=(5, knots))
    at_s = np.concatenate((times_s, random.uniform(times_s[0] - 4e-4, times_s[-1] + 4e-4, 200)))
    expected = CubicSpline(times_s, values, axis=1).antiderivative(2)(at_s)
    np.testing.assert_allclose(integrated_twice(times_s, values, at_s), expected, atol=1e-13 * np.abs(expected).max())


def test_a_cubic_is_integrated_exactly() -> None:
    """The double integral of t^3 from 0 is t^5 / 20."""
    times_s = np.array([0.0, 0.3, 0.4, 1.1, 1.9, 2.0])
    at_s = np.linspace(0.0, 2.0, 33)
    np.testing.assert_allclose(integrated_twice(times_s, times_s[None] ** 3, at_s)[0], at_s**5 / 20, atol=1e-14)
