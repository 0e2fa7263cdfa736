"""Values that were rounded to a few decimals before they were stored as float64."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.checked import measured_record, rules, run_check
from tests.support.motion_world import MotionFile, sample_motion

ROUNDED = {
    "positions to a millimetre": ("positions_world_m", 3),
    "positions to a micrometre": ("positions_world_m", 6),
    "gyro to a milliradian a second": ("angular_velocities_body_rad_s", 3),
    "forces to a millimetre per second squared": ("specific_forces_body_m_s2", 3),
}


@pytest.mark.parametrize(("name", "decimals"), ROUNDED.values(), ids=ROUNDED)
def test_decimals_are_rounding_not_noise(tmp_path: Path, name: str, decimals: int) -> None:
    """Every check of pose and IMU passes: what rounding leaves is allowed for, in a file that declares no noise."""
    values = np.round(getattr(sample_motion(), name), decimals)
    path = MotionFile().altered(**{name: values}).write(tmp_path / "motion.h5")
    results = measured_record(path, "pose", "imu").results
    assert {result.outcome for result in results} <= {"passed", "not_observable"}


def test_noise_of_the_same_size_is_noise(tmp_path: Path) -> None:
    """What no grid explains stays undeclared noise."""
    positions = sample_motion().positions_world_m
    noise_m = np.random.default_rng(1).uniform(-5e-4, 5e-4, positions.shape)
    path = MotionFile().altered(positions_world_m=positions + noise_m).write(tmp_path / "motion.h5")
    assert rules(run_check(path, "pose.noise")) == ["position"]


def test_even_steps_are_not_taken_for_rounding(tmp_path: Path) -> None:
    """A body that flies a centimetre a sample, to the digit, is held to the digits of its numbers: a jump is seen."""
    samples = sample_motion()
    positions = np.zeros_like(samples.positions_world_m)
    positions[:, 0] = np.round(0.01 * np.arange(len(positions)), 2)
    positions[200:, 1] += 0.003
    path = MotionFile().altered(positions_world_m=positions).write(tmp_path / "motion.h5")
    assert "position" in rules(run_check(path, "pose.continuity"))
