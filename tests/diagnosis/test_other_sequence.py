"""An IMU of another flight is named so, and not by the small piece of the misfit that some fault resembles."""

from dataclasses import replace
from pathlib import Path

import pytest

from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.estimators.imu.samples import InertialNoise
from tests.support.motion_world import EXACT, NOISY, RESTLESS, MotionFile, sample_motion

ANOTHER_FLIGHT = replace(RESTLESS, frequencies_hz=(0.5, 0.7, 1.3, 0.5, 0.7, 0.9))


@pytest.mark.parametrize("declared", [EXACT, NOISY], ids=["exact", "noisy"])
@pytest.mark.parametrize("duration_s", [0.6, 2.0])
def test_an_imu_of_another_flight_is_named(tmp_path: Path, declared: InertialNoise, duration_s: float) -> None:
    """Exact samples beside poses of another motion: neither their noise nor a bias is what is wrong."""
    poses = sample_motion(noise=None if declared is EXACT else declared, duration_s=duration_s)
    other = sample_motion(ANOTHER_FLIGHT, duration_s=duration_s)
    mixed = replace(
        poses,
        angular_velocities_body_rad_s=other.angular_velocities_body_rad_s,
        specific_forces_body_m_s2=other.specific_forces_body_m_s2,
    )
    path = MotionFile(samples=mixed, declared=declared).write(tmp_path / "motion.h5")
    first = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record.diagnoses[0]
    assert (first.cause, first.stream) == ("other_sequence", "imu")
