"""The mean error of rounded samples stays within its bound, which half a step and a Gaussian's closed form limit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.imu.samples import InertialNoise, InertialSamples, mean_rounding_bound, rounding_bias
from fedora_qa.estimators.imu.sequence_fit import ROTATION, TRANSLATION, InertialComparison, fit_inertial
from tests.support.motion_world import GRAVITY_M_S2, HOVER, RESTLESS, sample_motion

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
