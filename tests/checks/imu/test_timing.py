"""Clocks of IMU and poses, on files of a motion in closed form."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import Measurement, Result
from tests.support.checked import measured_record, run_check
from tests.support.motion_world import (
    NOISY,
    MotionFile,
    sample_motion,
)

CHECKS = ("imu.rotation", "imu.translation", "imu.timing", "imu.noise")


Change = Callable[[MotionFile], MotionFile]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def measured(result: Result, name: str) -> Measurement:
    return next(one for one in result.measurements if one.name == name)


def outcomes(path: Path) -> dict[str, str]:
    """Run all four checks; one that crashed shows as that."""
    results = measured_record(path, *CHECKS).results
    return {result.check: result.outcome for result in results}


def rates(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(angular_velocities_body_rad_s=change(f.samples.angular_velocities_body_rad_s))


def forces(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(specific_forces_body_m_s2=change(f.samples.specific_forces_body_m_s2))


def imu_timestamps(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(imu_times_s=change(f.samples.imu_times_s))


def averaged(f: MotionFile) -> MotionFile:
    """Every sample the mean over the interval before its stamp."""
    times_s = f.samples.imu_times_s

    def mean(values: np.ndarray) -> np.ndarray:
        sums = CubicSpline(times_s, values).antiderivative()(times_s)
        return np.concatenate((values[:1], np.diff(sums, axis=0) / np.diff(times_s)[:, None]))

    return forces(mean)(rates(mean)(f))


def test_two_restless_seconds_show_timing_in_noise(path: Path) -> None:
    """In poses with 5 mm and 0.2 deg of noise, two seconds at 5 rad/s tell offsets of half a millisecond."""
    MotionFile(sample_motion(noise=NOISY), NOISY).write(path)
    assert outcomes(path) == dict.fromkeys(CHECKS, "passed")
    assert (measured(run_check(path, "imu.timing"), "time_offset").least_detectable or np.inf) < 0.5


def test_an_offset_is_told_no_more_surely_than_timestamps_are_rounded(path: Path) -> None:
    """An IMU that is 3.4 us late is stamped 3 us late: what is told is off by a part of a microsecond, and says so."""
    imu_timestamps(lambda t: t + 3.4e-6)(MotionFile()).write(path)
    diagnosis = check_file(path, CheckOptions(select=("imu.timing",), evidence=None)).record.diagnoses[0]
    assert (diagnosis.cause, diagnosis.stream) == ("time_offset", "imu")
    assert diagnosis.magnitude is not None
    assert diagnosis.standard_error is not None
    assert abs(diagnosis.magnitude - 3.4e-3) < 2 * diagnosis.standard_error < 1e-3


def test_averaged_samples_are_said_not_failed(path: Path) -> None:
    """Means over the preceding interval read as half of it late: a warning with the declaration that is missing."""
    result = run_check(averaged(MotionFile()).write(path), "imu.timing")
    assert result.outcome == "warned"
    assert measured(result, "time_offset").value == pytest.approx(0.5, abs=1e-3)
    assert "interval_mean" in result.reason


def test_averaged_samples_that_are_declared_pass(path: Path) -> None:
    """With the declaration they are put back in their place, and nothing is left to see."""
    file = replace(averaged(MotionFile()), sampling="interval_mean")
    assert outcomes(file.write(path)) == dict.fromkeys(CHECKS, "passed")
