"""Which of two streams a deviation belongs to: what the stamps of all streams and the declarations tell."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fedora_qa.sequence.facts import Facts
from fedora_qa.views.timing_cues import TimingCues, timing_cues_of
from tests.support.checked import diagnoses_of, run_check
from tests.support.facts import MS, clock, exact_facts, with_clock
from tests.support.motion_world import HOVER, NOISY, RESTLESS, MotionFile, sample_motion

US = 1000


def moved(stream: str, offset_ns: int, facts: Facts | None = None) -> Facts:
    facts = facts or exact_facts()
    return with_clock(facts, stream, clock(facts.clocks[stream].times_ns + offset_ns))


def later_of(timing_cues: TimingCues) -> str:
    """The stream that the clues blame, or neither."""
    if timing_cues.imu_late == timing_cues.pose_late:
        return "neither"
    return "imu" if timing_cues.imu_late > timing_cues.pose_late else "pose"


@pytest.mark.parametrize("offset_ns", [3 * US, -7 * US, 1 * MS, 10 * MS, 40 * MS])
@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_the_clock_that_left_the_frames_is_the_late_one(stream: str, offset_ns: int) -> None:
    """Frames fall on the stamps of the stream that stayed, or begin with it where the offset is a whole period."""
    assert later_of(timing_cues_of(moved(stream, offset_ns))) == stream


@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_without_frames_the_grid_of_timestamps_tells(stream: str) -> None:
    """With IMU and pose alone, the stream whose stamps are multiples of its period stayed."""
    facts = exact_facts()
    alone = replace(facts, clocks={name: facts.clocks[name] for name in ("imu", "pose")})
    assert later_of(timing_cues_of(moved(stream, 3 * US, alone))) == stream


def test_clocks_that_all_stay_or_all_left_tell_nothing() -> None:
    """Equal treatment leaves both alike: a synchronous file, and one whose every clock has its own phase."""
    assert later_of(timing_cues_of(exact_facts())) == "neither"
    assert later_of(timing_cues_of(moved("imu", 3 * US, moved("pose", 17 * US)))) == "neither"


@pytest.mark.parametrize(("declared", "excess", "error", "blamed"), [
    (9.80665, 5e-5, 2e-6, "imu"),
    (9.80670, -5e-5, 2e-6, "metadata"),
    (9.80665, 0.3, 0.03, "imu"),
    (10.1, -0.3, 0.03, "metadata"),
])  # fmt: skip
def test_an_unusual_gravity_is_the_wrong_one(declared: float, excess: float, error: float, blamed: str) -> None:
    """Of measured and declared gravity the one that nobody uses is blamed; an uncertain one gets the benefit."""
    sensor, declaration = TimingCues(gravity_m_s2=declared).of_gravity(excess, error)
    assert ("imu" if sensor >= declaration else "metadata") == blamed


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
    for check in ("imu.rotation", "imu.translation"):
        assert run_check(tmp_path / "motion.h5", check).outcome == "failed"
    assert diagnoses_of(tmp_path / "motion.h5", "imu")[0].cause == "other_sequence"


@pytest.mark.parametrize("grid_s", [0.0007, 0.002, 0.0021])
def test_rounded_timestamps_of_the_poses_are_named(tmp_path: Path, grid_s: float) -> None:
    """Stamps on a coarse grid look like straight lines, noise and drift; one cause explains them all, with its size."""
    file = MotionFile().altered(pose_times_s=np.rint(sample_motion().pose_times_s / grid_s) * grid_s)
    file.write(tmp_path / "motion.h5")
    for subject in ("pose", "imu"):
        diagnosis = diagnoses_of(tmp_path / "motion.h5", subject)[0]
        assert (diagnosis.cause, diagnosis.stream) == ("quantised_time", "pose")
        assert diagnosis.magnitude == pytest.approx(1e3 * grid_s)
