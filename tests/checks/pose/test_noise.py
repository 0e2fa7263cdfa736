"""Noise of poses, on files of a motion in closed form."""

from dataclasses import replace
from pathlib import Path

import h5py
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.record.types import Measurement, Result
from tests.support.checked import diagnoses_of, measured_record, rules, run_check
from tests.support.motion_world import EXACT, NOISY, MotionFile, sample_motion


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def measured(result: Result, name: str) -> Measurement:
    return next(one for one in result.measurements if one.name == name)


def test_noise_that_is_not_declared_is_found(path: Path) -> None:
    """A tenth of a millimetre of noise where none is declared fails; the value is the noise."""
    samples = sample_motion(noise=replace(EXACT, position_sigma_m=1e-4))
    result = run_check(MotionFile(samples).write(path), "pose.noise")
    assert rules(result) == ["position"]
    assert measured(result, "position_noise").value == pytest.approx(1e-4, rel=0.2)


@pytest.mark.parametrize("excess", [0.5, -0.3])
def test_noise_that_is_declared_wrongly_is_found_to_size(path: Path, excess: float) -> None:
    """Declared sigmas that are too large or small by a share are found, with that share."""
    declared = replace(
        NOISY,
        position_sigma_m=NOISY.position_sigma_m * (1 + excess),
        rotation_sigma_rad=NOISY.rotation_sigma_rad * (1 + excess),
    )
    file = MotionFile(sample_motion(noise=NOISY, duration_s=4.0), declared)
    assert rules(run_check(file.write(path), "pose.noise")) == ["position", "rotation"]
    (diagnosis,) = diagnoses_of(path, "pose")
    assert (diagnosis.cause, diagnosis.stream) == ("noise_misdeclared", "pose")
    assert diagnosis.magnitude is not None
    assert diagnosis.standard_error is not None
    assert abs(diagnosis.magnitude - 100 * excess) < 4 * diagnosis.standard_error


def test_noise_that_an_arm_swings_is_the_arm(path: Path) -> None:
    """A point 5 m from the origin for most of the time jumps there and back, and shakes with the body's orientation."""
    samples = sample_motion(noise=NOISY)
    part = (samples.pose_times_s >= 0.2) & (samples.pose_times_s < 1.8)
    arm_world_m = Rotation.from_quat(samples.orientations_xyzw).apply([0.0, 5.0, 0.0]) * part[:, None]
    file = MotionFile(samples, NOISY).altered(positions_world_m=samples.positions_world_m + arm_world_m)
    assert rules(run_check(file.write(path), "pose.noise")) == ["position"]
    of_noise, whole = diagnoses_of(path, "pose.noise")[0], diagnoses_of(path, "pose")
    assert of_noise.cause == "noise_misdeclared"
    assert (whole[0].cause, whole[0].magnitude) == ("lever_arm", pytest.approx(5.0, rel=0.05))
    assert len(whole[0].explains) == 2


def test_noise_a_thousandfold_is_a_unit(path: Path) -> None:
    """Noisy positions in millimetres are named as that, not as noise."""
    samples = sample_motion(noise=NOISY)
    file = MotionFile(samples, NOISY).altered(positions_world_m=1000 * samples.positions_world_m)
    run_check(file.write(path), "pose.noise")
    assert diagnoses_of(path, "pose.noise")[0].cause == "unit_mm_m"


def test_noise_of_which_nobody_says_anything_is_stated_and_not_judged(path: Path) -> None:
    """Noisy poses and IMU without declarations are not at fault; both noises stand in the record, and agree."""
    file = MotionFile(sample_motion(noise=NOISY, duration_s=4.0)).write(path)
    with h5py.File(file, "a") as written:
        del written["metadata/pose"], written["metadata/imu"]
    record = measured_record(file, "pose", "imu")
    outcomes = {result.check: result.outcome for result in record.results}
    assert outcomes.pop("pose.noise") == outcomes.pop("imu.noise") == "warned"
    assert set(outcomes.values()) == {"passed"}
    expected = {
        "pose.position_noise_m": NOISY.position_sigma_m,
        "pose.rotation_noise_rad": NOISY.rotation_sigma_rad,
        "imu.gyro_noise_rad_s": NOISY.gyro_density * 1000**0.5,
        "imu.accelerometer_noise_m_s2": NOISY.accel_density * 1000**0.5,
    }
    assert {name: record.inferred[name] for name in expected} == pytest.approx(expected, rel=0.1)


def test_a_late_imu_is_found_without_declared_noise(path: Path) -> None:
    """The measured noise of each stream takes the place of the declared one: ten milliseconds are beyond it."""
    samples = sample_motion(noise=NOISY, duration_s=4.0)
    file = MotionFile(samples).altered(imu_times_s=samples.imu_times_s + 0.01).write(path)
    with h5py.File(file, "a") as written:
        del written["metadata/pose"], written["metadata/imu"]
    result = run_check(file, "imu.timing")
    assert rules(result) == ["time_offset"]
    assert measured(result, "time_offset").value == pytest.approx(10.0, abs=1.0)
