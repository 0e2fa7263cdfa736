"""Accelerometer against positions, on files of a motion in closed form."""

from pathlib import Path

import pytest

from tests.support.checked import diagnoses_of, rules, run_check
from tests.support.motion_world import (
    MotionFile,
    sample_motion,
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def test_a_jump_of_the_poses_is_the_worst_translation(path: Path) -> None:
    """A jump of 1 mm moves no parameter; the place and the probable cause are named."""
    s = sample_motion()
    jumped = s.positions_world_m.copy()
    jumped[250:, 2] += 0.001
    result = run_check(MotionFile().altered(positions_world_m=jumped).write(path), "imu.translation")
    assert rules(result) == ["worst"]
    assert result.findings[0].where.start_us == pytest.approx(1_250_000, abs=5_000)
    assert diagnoses_of(path, "imu")[0].cause == "teleport"
