"""A sensor that is turned by some degrees is the sensor's fault: gyro and accelerometer are turned alike."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from fedora_qa.checks.imu.imu_suspects import suspects_for
from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.estimators.fitting.grouped_fit import Fitted
from fedora_qa.views.timing_cues import TimingCues
from tests.support.motion_world import NOISY, MotionFile, sample_motion

TURN = Rotation.from_rotvec(np.radians([8.0, -6.0, 3.0]))


def test_a_turned_imu_beside_noisy_poses_is_blamed_and_not_the_poses(tmp_path: Path) -> None:
    """What the gyro shows as a turn, and forces as a slope of gravity, is one convention of the IMU."""
    samples = sample_motion(noise=NOISY)
    turned = replace(
        samples,
        angular_velocities_body_rad_s=TURN.apply(samples.angular_velocities_body_rad_s),
        specific_forces_body_m_s2=TURN.apply(samples.specific_forces_body_m_s2),
    )
    path = MotionFile(samples=turned, declared=NOISY).write(tmp_path / "motion.h5")
    first = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record.diagnoses[0]
    assert (first.cause, first.stream) == ("frame_convention", "imu")


def test_a_slope_of_gravity_alone_is_the_world_of_the_poses() -> None:
    """A sensor would be turned in its rates as well."""
    slope = Fitted(0.3, 0.01, 0.0, True, {"slope": 1.0})
    first, second = suspects_for("translation", "slope_x", slope, 1.0, TimingCues())
    assert (first.stream, second.stream) == ("pose", "imu")
    assert first.weight > second.weight
