"""Defects of the samples of IMU and poses, and streams of another sequence, are named as the cause."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.imu.samples import InertialNoise
from fedora_qa.faults.motion import Teleport
from tests.support.checked import diagnoses_of
from tests.support.motion_world import EXACT, HOVER, NOISY, RESTLESS, MotionFile, sample_motion


def test_another_sequence_is_named(tmp_path: Path) -> None:
    """IMU samples of another flight leave residuals as smooth as a flight: no noise, and nothing that was fitted."""
    other = sample_motion(replace(RESTLESS, amplitudes=HOVER.amplitudes, frequencies_hz=(1.2, 0.7, 0.5, 0.9, 0.6, 0.8)))
    file = MotionFile().altered(
        angular_velocities_body_rad_s=other.angular_velocities_body_rad_s,
        specific_forces_body_m_s2=other.specific_forces_body_m_s2,
    )
    file.write(tmp_path / "motion.h5")
    assert diagnoses_of(tmp_path / "motion.h5", "imu")[0].cause == "other_sequence"


def test_another_sequence_never_passes_in_noise(tmp_path: Path) -> None:
    """Where pose noise hides each residual, and no set of parameters settles, the fit's own values fail and name it."""
    other = sample_motion(replace(RESTLESS, phases=(2.0, 0.1, 1.0, 3.0, 0.2, 1.0)), NOISY, seed=3)
    file = MotionFile(sample_motion(noise=NOISY), NOISY).altered(
        angular_velocities_body_rad_s=other.angular_velocities_body_rad_s,
        specific_forces_body_m_s2=other.specific_forces_body_m_s2,
    )
    file.write(tmp_path / "motion.h5")
    record = check_file(tmp_path / "motion.h5", CheckOptions(select=("imu",), evidence=None)).record
    outcomes = {result.check: result.outcome for result in record.results}
    assert outcomes["imu.rotation"] == outcomes["imu.translation"] == "failed"
    assert record.diagnoses[0].cause == "other_sequence"


@pytest.mark.parametrize("grid_s", [0.0007, 0.002, 0.0021])
def test_rounded_timestamps_of_the_poses_are_named(tmp_path: Path, grid_s: float) -> None:
    """Stamps on a coarse grid look like straight lines, noise and drift; one cause explains them all, with its size."""
    file = MotionFile().altered(pose_times_s=np.rint(sample_motion().pose_times_s / grid_s) * grid_s)
    file.write(tmp_path / "motion.h5")
    for subject in ("pose", "imu"):
        diagnosis = diagnoses_of(tmp_path / "motion.h5", subject)[0]
        assert (diagnosis.cause, diagnosis.stream) == ("quantised_time", "pose")
        assert diagnosis.magnitude == pytest.approx(1e3 * grid_s)


def test_noise_of_the_components_is_that_of_quaternions(tmp_path: Path) -> None:
    """Lengths scatter by half of what rotations do; noise of the rotations, whose lengths are exact, is noise."""
    exact, random = sample_motion(), np.random.default_rng(4)
    by_component = exact.orientations_xyzw + random.normal(0.0, 0.003, exact.orientations_xyzw.shape)
    of_rotation = sample_motion(noise=replace(NOISY, rotation_sigma_rad=0.006)).orientations_xyzw
    for orientations, cause in ((by_component, "quaternion_not_unit"), (of_rotation, "noise_misdeclared")):
        MotionFile().altered(orientations_xyzw=orientations).write(tmp_path / "motion.h5")
        record = check_file(tmp_path / "motion.h5", CheckOptions(select=("imu", "pose"), evidence=None)).record
        assert (record.diagnoses[0].cause, record.diagnoses[0].stream) == (cause, "pose")


@pytest.mark.parametrize("rows", [(120, 300), (120, 393), (120, None)], ids=["and back", "back at the end", "for good"])
@pytest.mark.parametrize("noise", [EXACT, NOISY], ids=["exact", "noisy"])
def test_displaced_positions_are_undone_where_they_are(
    tmp_path: Path, noise: InertialNoise, rows: tuple[int, int | None]
) -> None:
    """Both jumps state the displacement; one of the last poses, at which no filter estimates it, is found as well."""
    samples = sample_motion(noise=noise)
    positions_m = samples.positions_world_m.copy()
    positions_m[slice(*rows)] += (0.3, -0.2, 0.1)
    MotionFile(samples, noise).altered(positions_world_m=positions_m).write(tmp_path / "motion.h5")
    run = check_file(tmp_path / "motion.h5", CheckOptions(select=("imu", "pose"), evidence=None))
    diagnosis = run.record.diagnoses[0]
    # What noise adds to the displacement may leave a bias of the accelerometer.
    assert diagnosis.cause == "teleport"
    assert diagnosis.status in (("confirmed",) if noise is EXACT else ("confirmed", "supported"))
    fault = run.faults[diagnosis.id]
    assert isinstance(fault, Teleport)
    assert fault.rows == rows
    assert fault.displacement_m == pytest.approx((0.3, -0.2, 0.1), abs=1e-5 if noise is EXACT else 0.03)
