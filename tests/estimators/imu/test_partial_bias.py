"""A bias that begins and ends is placed and sized by the residuals of IMU and poses."""

import numpy as np
import pytest

from fedora_qa.estimators.imu.preintegration import ROTATION_PARAMETERS, rotation_rows
from fedora_qa.estimators.imu.sequence_fit import ROTATION, fit_inertial
from fedora_qa.estimators.imu.specific_force import translation_rows
from fedora_qa.estimators.imu.summary import PartialBias, bias_drift, partial_bias, partial_gain
from tests.support.motion_world import EXACT, NOISY, sample_motion

BIAS = np.array([0.02, -0.05, 0.03])


def bias_of(start_s: float, stop_s: float, *, of_forces: bool = False) -> PartialBias | None:
    samples = sample_motion()
    part = (samples.imu_times_s >= start_s) & (samples.imu_times_s < stop_s)
    if of_forces:
        samples.specific_forces_body_m_s2[part] += 10 * BIAS
        return partial_bias([translation_rows(samples, EXACT)], centre=0.0)
    samples.angular_velocities_body_rad_s[part] += BIAS
    return partial_bias([rotation_rows(samples, EXACT)], centre=0.5)


@pytest.mark.parametrize("of_forces", [False, True], ids=["gyro", "accelerometer"])
@pytest.mark.parametrize(("start_s", "stop_s"), [(0.6, 1.4), (0.6025, 0.7265), (1.234, 1.9)])
def test_ends_are_known_between_the_poses(start_s: float, stop_s: float, of_forces: bool) -> None:
    """Poses come every 5 ms; a sample of the IMU, every ms, is on the right side of either end."""
    part = bias_of(start_s, stop_s, of_forces=of_forces)
    assert part is not None
    assert part.bias == pytest.approx(tuple((10 if of_forces else 1) * BIAS), rel=1e-3)
    # Half-way between the last sample without and the first sample with the bias.
    steps_s = np.ceil(np.round(1e3 * np.array([start_s, stop_s]), 6)) / 1e3 - 0.0005
    assert (part.start_s, part.stop_s) == pytest.approx(tuple(steps_s), abs=4e-4)
    assert part.explained > 0.98


def test_an_end_of_the_sequence_is_infinite() -> None:
    """No row shows where a bias begins that is there from the first."""
    part = bias_of(0.0, 0.8)
    assert part is not None
    assert part.start_s == -np.inf
    assert part.stop_s == pytest.approx(0.8, abs=1e-3)


def test_a_bias_of_the_whole_sequence_is_none_of_a_part() -> None:
    """Nor is one of nearly all of it, nor is there a part without any rows of a bias."""
    assert bias_of(0.0, 3.0) is None
    assert bias_of(0.0, 1.95) is None


def test_in_noise_a_bias_explains_what_lies_beyond_noise() -> None:
    """A large bias explains all of a little beyond noise, is sized, and its ends are known to a few poses."""
    samples = sample_motion(noise=NOISY)
    samples.angular_velocities_body_rad_s[800:1400] += 16 * BIAS
    part = partial_bias([rotation_rows(samples, NOISY)], centre=0.5)
    assert part is not None
    assert part.explained > 0.95
    assert part.bias == pytest.approx(tuple(16 * BIAS), abs=0.05)
    assert (part.start_s, part.stop_s) == pytest.approx((0.8, 1.4), abs=0.05)


def test_a_bias_that_drifts_is_known_at_both_ends() -> None:
    """A bias that grows evenly is sized at the first and at the last sample; a constant one does not drift."""
    samples = sample_motion()
    share = (samples.imu_times_s - samples.imu_times_s[0]) / np.ptp(samples.imu_times_s)
    samples.angular_velocities_body_rad_s[:] += np.outer(share, BIAS)
    drift = bias_drift([rotation_rows(samples, EXACT)])
    assert drift is not None
    assert drift.first == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    assert drift.last == pytest.approx(tuple(BIAS), abs=1e-3)
    assert drift.explained > 0.98


@pytest.mark.parametrize("bias", [0.0, 1.0], ids=["none", "constant"])
def test_a_bias_that_does_not_drift_is_none_that_drifts(bias: float) -> None:
    """Nor do correct samples have one."""
    samples = sample_motion()
    samples.angular_velocities_body_rad_s[:] += bias * BIAS
    assert bias_drift([rotation_rows(samples, EXACT)]) is None


SCALE = ROTATION_PARAMETERS.names.index("scale")


@pytest.mark.parametrize("gain", [0.25, 0.9, 2.0, 4.0])
def test_a_gain_of_a_part_is_sized_and_removes_more_than_a_bias(gain: float) -> None:
    """A gyro whose range changes for a while measures a multiple of the rates."""
    samples = sample_motion()
    samples.angular_velocities_body_rad_s[600:1400] *= gain
    rows = [rotation_rows(samples, EXACT)]
    part, bias = partial_gain(rows, column=SCALE, centre=0.5), partial_bias(rows, centre=0.5)
    assert part is not None
    assert part.gain == pytest.approx(gain, rel=1e-2)
    assert (part.start_s, part.stop_s) == pytest.approx((0.6, 1.4), abs=2e-3)
    assert part.explained > 0.9
    assert bias is None or part.left_within < 0.1 * bias.left_within


def test_a_bias_of_a_part_removes_more_than_a_gain() -> None:
    """Its rows follow the bias, and not the rates."""
    samples = sample_motion()
    samples.angular_velocities_body_rad_s[600:1400] += BIAS
    rows = [rotation_rows(samples, EXACT)]
    part, bias = partial_gain(rows, column=SCALE, centre=0.5), partial_bias(rows, centre=0.5)
    assert bias is not None
    assert part is None or part.left_within > 10 * bias.left_within


def test_a_gain_of_the_whole_sequence_is_none_of_a_part() -> None:
    """It has no part outside."""
    samples = sample_motion()
    samples.angular_velocities_body_rad_s[:] *= 2.0
    assert partial_gain([rotation_rows(samples, EXACT)], column=SCALE, centre=0.5) is None


@pytest.mark.parametrize("bias_rad_s", np.geomspace(1e-9, 1e-5, 9).tolist())
def test_a_bias_of_the_whole_sequence_is_no_gain_of_a_part_however_small(bias_rad_s: float) -> None:
    """Below the noise a gain of some part removes all that exceeds it, which is nothing; the whole leaves less."""
    samples = sample_motion()
    samples.angular_velocities_body_rad_s[:] += bias_rad_s * np.array([1.0, 0.0, 0.0])
    fit = fit_inertial(samples, EXACT, ROTATION, bias_walk=0.0)
    assert fit is not None
    assert fit.partial_gain is None
