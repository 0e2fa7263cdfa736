"""Hypotheses for alarms of the IMU: rivals of a cause, turned axes, the gravity that deviates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.checks.imu.agreement import InertialParameter
from fedora_qa.diagnosis.imu import TimingCues, parameter_hypotheses
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.views.sample_defects import clipped_samples
from tests.support.motion_world import GRAVITY_M_S2, NOISY, MotionFile, sample_motion

TURN = Rotation.from_rotvec(np.radians([8.0, -6.0, 3.0]))


def support_of_bias(delay_explains: float, bias_explains: float) -> float:
    """Support of a gyro's bias behind a delay of 8 ms, by how much either explains."""
    explained = {"time_offset": delay_explains, "bias": bias_explains}
    delay = InertialParameter("rotation", "time_offset", 0.008, 1e-6, 1.0, explained)
    hypotheses = parameter_hypotheses(delay, TimingCues(), GRAVITY_M_S2)
    return next(hypothesis.support for hypothesis in hypotheses if hypothesis.cause == "gyro_bias")


def test_a_rival_that_leaves_what_the_cause_explains_is_contradicted() -> None:
    """Of 90% that a bias explains nothing counts where a delay explains everything to a millionth."""
    assert support_of_bias(1.0 - 1e-6, 0.9) < 0.01
    assert support_of_bias(1.0, 0.9) == 0.0


@pytest.mark.parametrize("rival", [0.9, 0.95, 1.0])
def test_a_rival_that_leaves_no_more_counts_in_full(rival: float) -> None:
    """It is then as good an explanation as the cause itself."""
    assert support_of_bias(0.9, rival) == pytest.approx(0.9 * rival)


def test_a_rival_that_leaves_little_more_stays_likely() -> None:
    """Twice as much is left: by one sample's likelihood, a factor of the square root of two."""
    assert support_of_bias(0.9, 0.8) == pytest.approx(0.9 * 0.8 / 2**0.5)


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


@pytest.mark.parametrize("limit", [0.97, 0.995])
def test_forces_at_a_limit_are_no_bias(tmp_path: Path, limit: float) -> None:
    """A clip leaves samples below it as they were; a bias moves all. No cause names a limit."""
    samples = sample_motion()
    largest = limit * np.abs(samples.specific_forces_body_m_s2).max()
    clipped = replace(samples, specific_forces_body_m_s2=samples.specific_forces_body_m_s2.clip(-largest, largest))
    path = MotionFile(samples=clipped).write(tmp_path / "motion.h5")
    record = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record
    assert {diagnosis.cause for diagnosis in record.diagnoses} == {"unknown"}


def test_an_imu_without_weight_is_of_no_other_flight(tmp_path: Path) -> None:
    """Every vehicle has its weight: angles and velocities gained in a millisecond are another unit."""
    samples = sample_motion(duration_s=1.0)
    gained = replace(
        samples,
        angular_velocities_body_rad_s=samples.angular_velocities_body_rad_s / 1000,
        specific_forces_body_m_s2=samples.specific_forces_body_m_s2 / 1000,
    )
    path = MotionFile(samples=gained).write(tmp_path / "motion.h5")
    record = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record
    assert {diagnosis.cause for diagnosis in record.diagnoses} == {"unknown"}


def test_samples_end_at_a_limit_where_they_repeat_it_alone() -> None:
    """Rounded samples repeat other values as well; a motion repeats none, and a level flight has one value alone."""
    motion = np.random.default_rng(0).normal(size=(400, 3))
    assert clipped_samples(motion) == ()
    assert clipped_samples(np.rint(motion * 4) / 4) == ()
    assert clipped_samples(motion.clip(None, 1.5)) != ()
    assert clipped_samples(motion.clip(-1.5, None)) != ()
    assert clipped_samples(motion * [1, 1, 0]) == ()


def test_a_slope_of_gravity_alone_is_the_world_of_the_poses() -> None:
    """A sensor would be turned in its rates as well."""
    slope = InertialParameter("translation", "slope_x", 0.3, 0.01, 1.0, {"slope": 1.0})
    first, second = parameter_hypotheses(slope, TimingCues(), GRAVITY_M_S2)
    assert (first.stream, second.stream) == ("pose", "imu")
    assert first.support > second.support


@pytest.mark.parametrize(("name", "lesser"), [("bias_x", 1.0), ("bias_y", 0.5)])
def test_a_smaller_component_of_a_vector_supports_its_cause_less(name: str, lesser: float) -> None:
    """The largest component shows the size of the fault."""
    ratio = 2 * lesser - 1.0
    bias = InertialParameter("rotation", name, 0.01 * ratio, 1e-6, ratio, {"bias": 1.0})
    (hypothesis,) = parameter_hypotheses(bias, TimingCues(), GRAVITY_M_S2)
    assert hypothesis.support == pytest.approx(lesser)
