"""Noise in the regressors: halves of the samples measure what it does to a fit, and the fit takes it off."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.estimators.imu.samples import InertialNoise, InertialSamples
from fedora_qa.estimators.imu.sequence_fit import (
    ROTATION,
    TRANSLATION,
    InertialComparison,
    fit_inertial,
    halves,
    with_scatter,
)
from fedora_qa.estimators.imu.summary import InertialFit
from tests.support.motion_world import EXACT, Motion, sample_motion

IMU_NOISE = replace(EXACT, gyro_density=1.7e-4, accel_density=2e-3)
"""Noise of the IMU, poses exact: as in simulated flights."""

STILL = Motion(amplitudes=(1e-6,) * 6)
"""All that the gyro tells is its own noise."""

QUIET = Motion(amplitudes=(1.5e-3, 8e-4, 8e-4, 0.02, 0.02, 0.01))
"""A few mrad/s: noise, averaged over 20 ms, makes a tenth of the gyro's energy."""


def fitted(
    samples: InertialSamples, noise: InertialNoise = IMU_NOISE, comparison: InertialComparison = ROTATION
) -> InertialFit:
    found = fit_inertial(samples, noise, comparison, bias_walk=0.0)
    assert found is not None
    return found


def test_exact_samples_scatter_by_nothing_but_integration() -> None:
    """Without noise the halves differ by their integration's error of fourth order: a millionth of the motion."""
    samples = sample_motion()
    for comparison in (ROTATION, TRANSLATION):
        rows = comparison.rows_of(samples, IMU_NOISE)
        scatter = with_scatter(rows, samples, IMU_NOISE, comparison.rows_of).scatter
        assert scatter is not None
        inner = slice(10, -10)
        assert np.abs(scatter.residuals[inner]).max() < 1e-6 * np.abs(rows.jacobians[inner]).max()


def test_scatter_has_the_noise_of_all_samples() -> None:
    """Where nothing moves, residuals and regressors of the scatter are as large as those of the rows themselves."""
    samples = sample_motion(STILL, IMU_NOISE, duration_s=4.0)
    rows = with_scatter(ROTATION.rows_of(samples, IMU_NOISE), samples, IMU_NOISE, ROTATION.rows_of)
    assert rows.scatter is not None
    assert np.std(rows.scatter.residuals) == pytest.approx(np.std(rows.residuals), rel=0.1)
    for name in ("time_offset", "scale"):
        column = ROTATION.parameters.names.index(name)
        ours, whole = (np.std(each.jacobians[..., column]) for each in (rows.scatter, rows))
        assert ours == pytest.approx(whole, rel=0.15), name


def test_halves_part_the_samples_and_keep_the_span() -> None:
    """Every sample is in one half, none but the first and the last in both."""
    times_s = sample_motion(duration_s=0.1).imu_times_s
    even, odd = (half.imu_times_s for half in halves(sample_motion(duration_s=0.1)))
    np.testing.assert_array_equal(np.union1d(even, odd), times_s)
    np.testing.assert_array_equal(np.intersect1d(even, odd), times_s[[0, -1]])


@pytest.mark.parametrize("comparison", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
def test_noise_alone_is_no_gain(comparison: InertialComparison) -> None:
    """Where nothing moves, nothing is freed, the fit settles, and values lie within their errors, draw by draw."""
    scores = []
    for seed in range(10):
        found = fitted(sample_motion(STILL, IMU_NOISE, seed=seed), comparison=comparison)
        assert found.settled
        assert not any(one.free for one in found.parameters.values())
        scores += [one.value / one.standard_error for one in found.parameters.values()]
    assert np.max(np.abs(scores)) < 4.5
    assert abs(np.mean(scores)) < 0.3


def test_what_noise_feigns_is_not_counted_as_knowledge() -> None:
    """Where nothing moves, gain and timing are uncertain beyond use, however well the gyro's noise fits itself."""
    parameters = fitted(sample_motion(STILL, IMU_NOISE)).parameters
    assert parameters["scale"].standard_error > 0.15
    assert parameters["time_offset"].standard_error > 0.005


@pytest.mark.parametrize("excess", [0.0, 0.2])
def test_a_gain_is_right_in_quiet_flight(excess: float) -> None:
    """Over many draws the gain has neither the bias upward that shared noise gives nor attenuation."""
    values, errors = [], []
    for seed in range(10):
        samples = sample_motion(QUIET, IMU_NOISE, seed=seed)
        turned = QUIET.angular_velocities(samples.imu_times_s) * excess
        rates = samples.angular_velocities_body_rad_s + turned
        gain = fitted(replace(samples, angular_velocities_body_rad_s=rates)).parameters["scale"]
        assert gain.free == (excess > 0)
        values.append(gain.value)
        errors.append(gain.standard_error)
    assert np.mean(values) == pytest.approx(excess, abs=3 * float(np.mean(errors)) / np.sqrt(10))
