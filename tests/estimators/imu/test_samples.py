"""Bookkeeping of samples, stretches and rows."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.samples import (
    ComparisonRows,
    InertialNoise,
    InertialSamples,
    covered,
    every_second,
    mean_rounding_bound,
    rounding_bias,
    segments_of,
    smoothed,
    timestamp_scatter,
)
from fedora_qa.estimators.imu.sequence_fit import ROTATION, TRANSLATION, InertialComparison, fit_inertial
from tests.support.motion_world import GRAVITY_M_S2, HOVER, RESTLESS, sample_motion


def rows_of(count: int) -> ComparisonRows:
    zeros = np.zeros((count, 3))
    bands = np.array([np.full(count, 1.0), np.full(count, -4.0), np.full(count, 6.0)])
    return ComparisonRows(np.arange(count), np.arange(count) * 0.005, np.full(count, 0.005), zeros, zeros,
                np.zeros((count, 3, 2)), np.zeros((count, 3, 3)), np.tile(bands, (3, 1, 1)))  # fmt: skip


def test_intervals_outside_or_across_a_gap_are_not_covered() -> None:
    """An interval counts only where IMU samples follow each other from its start to its stop."""
    imu_s = np.array([0.0, 1, 2, 3, 4, 8, 9, 10])
    starts = np.array([-0.5, 0.0, 2.5, 3.9, 5.0, 8.0, 9.5])
    stops = np.array([0.5, 4.0, 3.5, 8.5, 6.0, 10.0, 10.5])
    assert covered(imu_s, starts, stops).tolist() == [False, True, True, False, False, True, False]


@given(st.floats(0.05, 300.0), st.integers(2, 400), st.sampled_from([0.5, 2.0]))
def test_blocks_cut_rows_without_loss(span_s: float, count: int, shortest_s: float) -> None:
    """Every row lies in just one stretch; there are eight, or as many as the least and greatest length allow."""
    times_s = np.linspace(3.0, 3.0 + span_s, count)
    blocks = segments_of(times_s, shortest_s)
    assert [row for block in blocks for row in range(block.start, block.stop)] == list(range(count))
    wanted = max(1, round(span_s / min(max(span_s / 8, shortest_s), 5.0)))
    assert len(blocks) == wanted if count > 2 * wanted else len(blocks) <= wanted
    lengths = [block.stop - block.start for block in blocks]
    assert max(lengths) - min(lengths) <= 2  # one by what does not divide, one by rounding


def test_rows_left_out_tear_the_covariance() -> None:
    """Rows that become neighbours because one between them is left out share no noise."""
    keep = np.ones(6, dtype=bool)
    keep[3] = False
    (bands, *others) = rows_of(6).select(keep).covariance_bands
    assert all(np.array_equal(bands, other) for other in others)
    assert bands[2].tolist() == [6.0] * 5
    assert bands[1, 1:].tolist() == [-4.0, -4.0, 0.0, -4.0]  # 0-1, 1-2, 2-4, 4-5
    assert bands[0, 2:].tolist() == [1.0, 0.0, 0.0]  # 0-2, 1-4, 2-5


def test_samples_between_two_instants_include_both() -> None:
    """The cut keeps what lies on its ends, and the origin of time."""
    part = sample_motion().between(0.5, 0.6)
    assert (part.pose_times_s[0], part.pose_times_s[-1]) == (0.5, 0.6)
    assert len(part.imu_times_s) == 101
    assert len(part.specific_forces_body_m_s2) == 101


def test_a_sample_that_does_not_move_is_scattered_like_the_rest() -> None:
    """Rounded stamps scatter by 0.29 us times the speed, never less than at the rms speed."""
    scatter = timestamp_scatter(np.array([0.0, 3.0, 4.0, 0.0]))
    np.testing.assert_allclose(scatter * 1e6 * np.sqrt(12), [2.5, 3.0, 4.0, 2.5])


def test_averages_keep_lines_and_width_nought_keeps_all() -> None:
    """A straight line is its own average away from the ends; no width, no average."""
    times_s = np.arange(100) * 0.001
    line = np.outer(times_s, [1.0, -2.0, 0.5])
    np.testing.assert_allclose(smoothed(times_s, line, 0.021)[20:-20], line[20:-20], atol=1e-12)
    np.testing.assert_array_equal(smoothed(times_s, line**2, 0.0), line**2)


@given(st.integers(1, 50))
def test_every_second_keeps_both_ends(count: int) -> None:
    """Both ends are kept, and no two neighbours but the last two."""
    chosen = every_second(count)
    assert chosen[0] == 0
    assert chosen[-1] == count - 1
    assert np.all(np.diff(chosen)[:-1] == 2)


def test_no_more_stretches_than_rows_however_far_a_timestamp_lies() -> None:
    """One absurd stamp would ask for billions of stretches of five seconds."""
    segments = segments_of(np.array([0.0, 0.1, 1e12]), 0.5)
    assert [index for one in segments for index in range(one.start, one.stop)] == [0, 1, 2]


def test_a_lever_is_carried_by_the_body() -> None:
    """Points of the body move as SciPy's rotations move them; no lever changes nothing."""
    samples = sample_motion(duration_s=0.1)
    arm = np.array([0.3, -0.2, 0.1])
    carried = Rotation.from_quat(samples.orientations_xyzw).apply(arm)
    np.testing.assert_allclose(samples.at_lever(arm).positions_world_m, samples.positions_world_m + carried)
    assert samples.at_lever(np.zeros(3)) is samples


def test_bounds_of_rows_add_the_bias_of_rounding() -> None:
    """A bias of any sign on each axis adds the absolute derivative by it times its size."""
    rows = replace(
        rows_of(2),
        model_errors=np.array([[0.1, -0.2, 0.0]] * 2),
        bias_jacobians=np.array([np.diag([1.0, -2.0, 0.0]), np.full((3, 3), -1.0)]),
        rounding_bias=np.array([0.01, 0.02, 0.04]),
    )
    np.testing.assert_allclose(rows.error_bounds, [[0.11, 0.24, 0.0], [0.17, 0.27, 0.07]])
    np.testing.assert_allclose(rows.sigmas, np.sqrt(6.0))


TIMES_S = np.arange(1000) / 1000


@settings(max_examples=200, deadline=None)
@given(
    step=st.floats(1e-4, 1.0),
    amplitude=st.floats(0.0, 20.0),
    offset=st.floats(-5.0, 5.0),
    frequency_hz=st.floats(0.1, 3.0),
)
def test_the_mean_error_of_a_course_stays_within_the_bound(
    step: float, amplitude: float, offset: float, frequency_hz: float
) -> None:
    """Of sinusoids of any size in steps; terms that are not summed are white, and give three of their sigmas."""
    course = step * (offset + amplitude * np.sin(2 * np.pi * frequency_hz * TIMES_S))
    error = float(np.mean(step * np.rint(course / step) - course))
    white = step * np.sqrt(0.07 / 12)
    bound = min(step / 2, mean_rounding_bound(course, step, 0.0) + 3 * white)
    assert abs(error) <= bound * (1 + 1e-9)


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.3, 0.5])
def test_noise_averages_the_error_of_a_constant(noise: float) -> None:
    """The worst constant errs by ``s/pi exp(-2 pi^2 sigma^2 / s^2)`` and little more (Widrow), for a step of 1."""
    samples = np.random.default_rng(3).normal(size=200_000) * noise
    errors = [abs(float(np.mean(np.rint(c + samples) - c - samples))) for c in np.linspace(0, 0.5, 26)]
    bound = mean_rounding_bound(np.zeros(10), 1.0, noise)
    assert max(errors) <= bound + 5e-3
    assert bound <= max(max(errors) * 1.7, 5e-3)
    assert bound >= np.exp(-2 * (np.pi * noise) ** 2) / np.pi


def test_a_constant_errs_by_half_a_step_and_an_unrounded_one_not_at_all() -> None:
    """The two ends."""
    assert mean_rounding_bound(np.full(10, 0.3), 1e-3, 0.0) == 5e-4
    assert mean_rounding_bound(np.full(10, 0.3), 0.0, 0.0) == 0.0
    assert mean_rounding_bound(np.empty(0), 1.0, 0.0) == 0.0


def rounded(samples: InertialSamples, gyro: float, accelerometer: float) -> InertialSamples:
    """The same samples in whole steps."""
    return InertialSamples(
        samples.imu_times_s,
        gyro * np.rint(samples.angular_velocities_body_rad_s / gyro),
        accelerometer * np.rint(samples.specific_forces_body_m_s2 / accelerometer),
        samples.pose_times_s,
        samples.positions_world_m,
        samples.orientations_xyzw,
    )


@pytest.mark.parametrize("comparison", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
@pytest.mark.parametrize("motion", [RESTLESS, HOVER], ids=["restless", "hover"])
@pytest.mark.parametrize("bits", [16, 12])
def test_parameters_of_a_rounded_imu_stay_within_their_bounds(
    comparison: InertialComparison, motion: object, bits: int
) -> None:
    """A sensor of 2000 deg/s and 16 g: every parameter, and its worst segment, is within four errors and its bound."""
    steps = np.radians(2000.0) / 2 ** (bits - 1), 16 * 9.80665 / 2 ** (bits - 1)
    samples = rounded(sample_motion(motion), *steps)  # type: ignore[arg-type]
    sample_s = float(np.median(np.diff(samples.imu_times_s)))
    gyro, accelerometer = (step * np.sqrt(sample_s / 12) for step in steps)
    noise = InertialNoise(
        gyro_density=gyro, accel_density=accelerometer, gravity_m_s2=GRAVITY_M_S2,
        gyro_steps=(steps[0],) * 3, accel_steps=(steps[1],) * 3,
    )  # fmt: skip
    fit = fit_inertial(samples, noise, comparison, bias_walk=0.0)
    assert fit is not None
    for parameter in fit.parameters.values():
        assert abs(parameter.value) <= 4 * parameter.standard_error + parameter.model_error
    for local in fit.local_deviations.values():
        assert abs(local.deviation) <= 5 * local.standard_error + local.model_error
    assert fit.rms <= fit.expected_rms + 4 * fit.rms_error + fit.model_rms


def test_each_axis_has_the_bound_of_its_own_step() -> None:
    """Steps of 0, 1 and 2 on constant axes."""
    samples = sample_motion()
    bounds = rounding_bias(samples, np.zeros_like(samples.specific_forces_body_m_s2), (0.0, 1.0, 2.0), 0.0)
    assert bounds.tolist() == [0.0, 0.5, 1.0]
