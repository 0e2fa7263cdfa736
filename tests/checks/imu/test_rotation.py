"""Gyro against orientations, on files of a motion in closed form."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.checked import run_check
from tests.support.motion_world import (
    MotionFile,
)

Change = Callable[[MotionFile], MotionFile]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def imu_timestamps(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(imu_times_s=change(f.samples.imu_times_s))


def test_streams_that_do_not_overlap_are_not_compared(path: Path) -> None:
    """An IMU stamped minutes later shares no instant with the poses."""
    result = run_check(imu_timestamps(lambda t: t + 300.0)(MotionFile()).write(path), "imu.rotation")
    assert result.outcome == "not_observable"
    assert "overlap" in result.reason
