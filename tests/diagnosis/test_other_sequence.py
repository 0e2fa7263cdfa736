"""An IMU of another flight is named so, and not by the small piece of the misfit that some fault resembles."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.diagnosis.vetoes import contradicts
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
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


def test_an_imu_whose_counter_restarts_is_of_this_flight(tmp_path: Path) -> None:
    """Behind a step back of the clock nothing fits the poses; that says nothing of the sequence."""
    samples = sample_motion(duration_s=1.0)
    times_s = samples.imu_times_s
    restarted = np.where(times_s < 0.4, times_s, times_s - 0.4)
    path = MotionFile(samples=samples).altered(imu_times_s=restarted).write(tmp_path / "motion.h5")
    record = check_file(path, CheckOptions(evidence=None)).record
    results = {result.check: result for result in record.results if result.check == "clocks.order"}
    assert contradicts("other_sequence", "imu", None, results, {})
    assert not contradicts("other_sequence", "pose", None, results, {})
    assert "other_sequence" not in {diagnosis.cause for diagnosis in record.diagnoses}


def test_poses_of_the_world_in_the_body_are_of_this_flight(tmp_path: Path) -> None:
    """With quaternions and positions inverted nothing fits, until both are inverted again."""
    samples = sample_motion(duration_s=2.0)
    R_body_world = Rotation.from_quat(samples.orientations_xyzw).inv()
    inverted = MotionFile(samples=samples).altered(
        positions_world_m=-R_body_world.apply(samples.positions_world_m), orientations_xyzw=R_body_world.as_quat()
    )
    path = inverted.write(tmp_path / "motion.h5")
    first = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record.diagnoses[0]
    assert (first.cause, first.stream) == ("quaternion_inverted", "pose")
    assert first.tried == ("poses are inverted",)
