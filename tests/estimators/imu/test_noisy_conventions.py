"""Conventions under noise of the poses, by the whitened squares of all residuals."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.conventions import FRD_FROM_FLU
from fedora_qa.estimators.imu.conventions import InertialConvention
from fedora_qa.estimators.imu.noisy_conventions import explain_in_noise
from fedora_qa.estimators.imu.sequence_fit import ROTATION, TRANSLATION, InertialComparison
from tests.estimators.imu.test_conventions import FORCE_CASES, RATE_CASES, is_like, north_east_down
from tests.support.motion_world import NOISY, sample_motion

NAMED_BY_RATES = ("clean", "degrees", "wxyz", "inverse", "swapped", "right-down")
NAMED_BY_FORCES = ("clean", "swapped sensor", "right-down", "swapped world", "no gravity", "gravity up")


@pytest.mark.parametrize("case", NAMED_BY_RATES)
def test_rates_state_the_convention(case: str) -> None:
    """Every convention of rotations is named, and none where the file follows its declaration."""
    plant, expected = RATE_CASES[case]
    assert is_like(explain_in_noise(plant(sample_motion(noise=NOISY)), NOISY, ROTATION), expected)


@pytest.mark.parametrize("case", NAMED_BY_FORCES)
def test_forces_state_the_convention(case: str) -> None:
    plant, expected = FORCE_CASES[case]
    assert is_like(explain_in_noise(plant(sample_motion(noise=NOISY)), NOISY, TRANSLATION), expected)


def test_poses_of_a_body_with_z_down_in_such_a_world_are_named() -> None:
    """Forces without these axes are those of a sensor and of a world with Z up."""
    down = north_east_down(sample_motion(noise=NOISY))
    expected = InertialConvention(sensor_axes=FRD_FROM_FLU, up=(0, 0, -1))
    assert is_like(explain_in_noise(down, NOISY, TRANSLATION), expected)


@pytest.mark.parametrize("comparison", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
def test_noise_alone_leaves_its_own_squares(comparison: object) -> None:
    """Over many draws the mean square residual is that of noise, and the declared convention is kept."""
    residuals = []
    for seed in range(10):
        samples = sample_motion(noise=NOISY, seed=seed)
        convention = explain_in_noise(samples, NOISY, comparison)  # type: ignore[arg-type]
        assert is_like(convention, InertialConvention())
        residuals.append(convention.residual if convention is not None else np.inf)
    assert np.mean(residuals) == pytest.approx(1.0, abs=0.1)


def test_streams_of_two_flights_have_no_convention() -> None:
    """No convention brings the rates of one flight to the attitudes of its reverse."""
    samples = sample_motion(noise=NOISY)
    other = replace(samples, angular_velocities_body_rad_s=2.5 * samples.angular_velocities_body_rad_s[::-1] + 1.0)
    assert explain_in_noise(other, NOISY, ROTATION) is None


@pytest.mark.parametrize("comparison", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
def test_residuals_alone_are_those_of_the_rows(comparison: InertialComparison) -> None:
    """To the bit, with their covariance; of too few samples there are none."""
    samples = comparison.prepared(sample_motion(noise=NOISY))
    rows = comparison.rows_of(samples, NOISY)
    residuals, covariance_bands = comparison.residuals_of(samples, NOISY)
    np.testing.assert_array_equal(residuals, rows.residuals)
    np.testing.assert_array_equal(covariance_bands, rows.covariance_bands)
    nowhere = comparison.prepared(replace(samples, imu_times_s=samples.imu_times_s + 100.0, R_world_imu=None))
    assert len(comparison.residuals_of(nowhere, NOISY)[0]) == 0
