"""Noise of the IMU, on files of a motion in closed form."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.record.types import Measurement, Result
from tests.support.checked import diagnoses_of, rules, run_check
from tests.support.motion_world import (
    EXACT,
    GRAVITY_M_S2,
    HOVER,
    NOISY,
    MotionFile,
    sample_motion,
)

Change = Callable[[MotionFile], MotionFile]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def measured(result: Result, name: str) -> Measurement:
    return next(one for one in result.measurements if one.name == name)


def held(first: int, count: int) -> Change:
    def change(f: MotionFile) -> MotionFile:
        gyro, force = f.samples.angular_velocities_body_rad_s.copy(), f.samples.specific_forces_body_m_s2.copy()
        gyro[first : first + count], force[first : first + count] = gyro[first - 1], force[first - 1]
        return f.altered(angular_velocities_body_rad_s=gyro, specific_forces_body_m_s2=force)

    return change


def steady(file: MotionFile) -> MotionFile:
    """At rest, rounded: forces flicker by the last digit and rates by what differences of orientations have."""
    random = np.random.default_rng(5)
    count = len(file.samples.imu_times_s)
    repeats = np.repeat(random.integers(-1, 2, (count // 3 + 1, 3)), 3, axis=0)[:count]
    return file.altered(
        specific_forces_body_m_s2=[0.0, 0.0, GRAVITY_M_S2] + repeats * np.spacing(GRAVITY_M_S2),
        angular_velocities_body_rad_s=repeats * 1e-14,
    )


def test_held_samples_are_counted(path: Path) -> None:
    """IMU samples that are held while the body moves are counted and located."""
    result = run_check(held(700, 6)(MotionFile()).write(path), "imu.noise")
    assert "frozen" in rules(result)
    frozen = next(one for one in result.findings if one.code.endswith("frozen"))
    assert (frozen.where.index_start, measured(result, "frozen").value) == (700, 6)
    assert diagnoses_of(path, "imu")[0].cause == "frozen_frames"


def test_samples_that_repeat_in_steady_flight_are_not_held(path: Path) -> None:
    """Where nothing but rounding changes, samples repeat because they are the same."""
    assert run_check(steady(MotionFile()).write(path), "imu.noise").outcome == "passed"


def test_held_samples_are_counted_in_hover(path: Path) -> None:
    """The least of motions is far above rounding: held samples are counted there too."""
    result = run_check(held(700, 6)(MotionFile(sample_motion(HOVER))).write(path), "imu.noise")
    assert measured(result, "frozen").value == 6


@pytest.mark.parametrize("excess", [0.5, -0.3])
def test_imu_noise_that_is_declared_wrongly_is_found_to_size(path: Path, excess: float) -> None:
    """Densities that are declared too large or small by a share are found, with that share."""
    declared = replace(
        NOISY, gyro_density=NOISY.gyro_density * (1 + excess), accel_density=NOISY.accel_density * (1 + excess)
    )
    file = MotionFile(sample_motion(noise=NOISY), declared)
    assert rules(run_check(file.write(path), "imu.noise")) == ["gyro", "accelerometer"]
    (diagnosis,) = diagnoses_of(path, "imu.noise")
    assert (diagnosis.cause, diagnosis.stream) == ("noise_misdeclared", "imu")
    assert diagnosis.magnitude == pytest.approx(100 * excess, abs=4 * (diagnosis.standard_error or 0.0))


def test_noise_where_none_is_declared_is_found(path: Path) -> None:
    """Gyro noise in a file that declares none fails, with its size."""
    noise = replace(EXACT, gyro_density=1e-5)
    result = run_check(MotionFile(sample_motion(noise=noise)).write(path), "imu.noise")
    assert rules(result) == ["gyro"]
    assert measured(result, "gyro_noise").value == pytest.approx(1e-5 * np.sqrt(1000), rel=0.15)


def test_without_declarations_exact_samples_are_held_to_the_defaults(path: Path) -> None:
    """A file that declares nothing of IMU and pose is held to standard gravity, and the finding says so."""
    MotionFile().write(path)
    with h5py.File(path, "r+") as file:
        del file["metadata"]
    result = run_check(path, "imu.translation")
    assert rules(result) == ["gravity"]
    assert measured(result, "gravity").value == pytest.approx(GRAVITY_M_S2 - 9.80665, abs=1e-4)
    assert run_check(path, "imu.rotation").outcome == "passed"
