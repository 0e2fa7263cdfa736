"""Continuity of poses, and clean poses under every check, on files of a motion in closed form."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from fedora_qa.record.types import Measurement, Result
from tests.support.checked import diagnoses_of, measured_record, rules, run_check
from tests.support.motion_world import EXACT, HOVER, NOISY, RESTLESS, MotionFile, sample_motion

CHECKS = ("pose.orientation", "pose.continuity", "pose.noise")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def measured(result: Result, name: str) -> Measurement:
    return next(one for one in result.measurements if one.name == name)


CLEAN = {
    "restless": MotionFile(),
    "hover": MotionFile(sample_motion(HOVER)),
    "one second": MotionFile(sample_motion(duration_s=1.0)),
    "50 Hz": MotionFile(sample_motion(pose_rate_hz=50.0)),
    "300 Hz": MotionFile(sample_motion(pose_rate_hz=300.0)),
    "noisy": MotionFile(sample_motion(noise=NOISY), NOISY),
    "noisy hover": MotionFile(sample_motion(HOVER, NOISY), NOISY),
    "at rest": MotionFile(sample_motion(replace(RESTLESS, amplitudes=(0.0,) * 6))),
}


def outcomes(path: Path) -> dict[str, str]:
    """Run all three checks; one that crashed shows as that."""
    results = measured_record(path, *CHECKS).results
    return {result.check: result.outcome for result in results}


@pytest.mark.parametrize("clean", CLEAN.values(), ids=CLEAN)
def test_clean_poses_pass(path: Path, clean: MotionFile) -> None:
    """Fast, slow, sparse, noisy and motionless poses all pass every check."""
    assert outcomes(clean.write(path)) == dict.fromkeys(CHECKS, "passed")


def test_single_precision_is_no_fault(path: Path) -> None:
    """Poses stored as float32, a kilometre out, are held to what float32 can hold."""
    samples = sample_motion(HOVER)
    coarse = MotionFile(samples).altered(
        positions_world_m=(samples.positions_world_m + 1000).astype(np.float32),
        orientations_xyzw=samples.orientations_xyzw.astype(np.float32),
    )
    assert outcomes(coarse.write(path)) == dict.fromkeys(CHECKS, "passed")


@pytest.mark.parametrize(
    ("noise", "jump_m"), [(EXACT, 1e-4), (EXACT, -0.5), (NOISY, 0.06)], ids=["small", "large", "in noise"]
)
def test_a_jump_is_found_to_size_and_place(path: Path, noise: object, jump_m: float) -> None:
    """Positions that jump and stay are found between the two poses, with the size of the jump."""
    file = MotionFile(sample_motion(noise=noise), noise)  # type: ignore[arg-type]
    positions = file.samples.positions_world_m.copy()
    positions[200:, 1] += jump_m
    result = run_check(file.altered(positions_world_m=positions).write(path), "pose.continuity")
    assert rules(result) == ["position"]
    where = result.findings[0].where
    assert abs((where.index_start or 0) - 199) <= (2 if noise is NOISY else 0)
    diagnosis = diagnoses_of(path, "pose.continuity")[0]
    assert (diagnosis.cause, diagnosis.stream) == ("teleport", "pose")
    assert diagnosis.magnitude == pytest.approx(jump_m, rel=0.25 if noise is NOISY else 1e-3)


def jump_cause(file: MotionFile, orientations_xyzw: np.ndarray, path: Path) -> str:
    """Return the cause of the only jump, which is one of the orientation."""
    file.altered(orientations_xyzw=orientations_xyzw).write(path)
    assert rules(run_check(path, "pose.continuity")) == ["rotation"]
    return diagnoses_of(path, "pose.continuity")[0].cause


def test_a_wrong_component_of_one_quaternion_is_no_teleport(path: Path) -> None:
    """It turns the pose and changes the length. A length that all poses share turns none."""
    file = MotionFile(sample_motion())
    q = file.samples.orientations_xyzw.copy()
    q[200, np.argmin(np.abs(q[200]))] += 0.2
    assert jump_cause(file, q, path) == "quaternion_not_unit"
    turned = (Rotation.from_quat(file.samples.orientations_xyzw) * Rotation.from_euler("x", 2, degrees=True)).as_quat()
    q = 1.01 * np.concatenate([file.samples.orientations_xyzw[:200], turned[200:]])
    assert jump_cause(file, q, path) == "teleport"


def test_what_is_below_the_noise_is_not_seen_and_said(path: Path) -> None:
    """A jump of 2 mm in 5 mm of noise passes, and the least detectable jump says why."""
    file = MotionFile(sample_motion(noise=NOISY), NOISY)
    positions = file.samples.positions_world_m.copy()
    positions[200:] += 0.002
    result = run_check(file.altered(positions_world_m=positions).write(path), "pose.continuity")
    assert result.outcome == "passed"
    least = measured(result, "position_jump").least_detectable
    assert least is not None
    assert 0.01 < least < 0.06


def test_frozen_poses_are_counted_and_the_diagnosis_is_one(path: Path) -> None:
    """Poses held for four samples are counted; the jumps beside them are explained by the same cause."""
    samples = sample_motion()
    positions, q = samples.positions_world_m.copy(), samples.orientations_xyzw.copy()
    positions[200:204], q[200:204] = positions[199], q[199]
    file = MotionFile().altered(positions_world_m=positions, orientations_xyzw=q)
    result = run_check(file.write(path), "pose.continuity")
    assert "frozen" in rules(result)
    frozen = next(one for one in result.findings if one.code.endswith("frozen"))
    assert frozen.where.index_start == 200
    assert measured(result, "frozen").value == 4
    (diagnosis,) = diagnoses_of(path, "pose.continuity")
    assert (diagnosis.cause, diagnosis.stream, diagnosis.magnitude) == ("frozen_frames", "pose", 4)


@pytest.mark.parametrize("rate_hz", [100, 50, 20])
def test_interpolated_poses_are_named_with_their_rate(path: Path, rate_hz: int) -> None:
    """Positions on straight lines between poses of a lower rate are found, and explain what else is odd of them."""
    samples, stride = sample_motion(), 200 // rate_hz
    knots = samples.pose_times_s[::stride]
    lines = [np.interp(samples.pose_times_s, knots, column[::stride]) for column in samples.positions_world_m.T]
    file = MotionFile().altered(positions_world_m=np.stack(lines, axis=-1))
    assert "interpolated" in rules(run_check(file.write(path), "pose.continuity"))
    diagnosis = diagnoses_of(path, "pose")[0]
    assert (diagnosis.cause, diagnosis.magnitude) == ("interpolated_pose", pytest.approx(rate_hz))


@pytest.mark.parametrize("rate_hz", [100, 50, 20, 8])
def test_interpolated_orientations_are_named_beside_positions_that_are_right(path: Path, rate_hz: int) -> None:
    """Slerp between poses of a lower rate turns evenly about one axis up to the next one, as no body does."""
    samples, stride = sample_motion(), 200 // rate_hz
    knots = np.unique([*range(0, len(samples.pose_times_s), stride), len(samples.pose_times_s) - 1])
    slerp = Slerp(samples.pose_times_s[knots], Rotation.from_quat(samples.orientations_xyzw[knots]))
    file = MotionFile().altered(orientations_xyzw=slerp(samples.pose_times_s).as_quat())
    assert "interpolated" in rules(run_check(file.write(path), "pose.continuity"))
    diagnosis = diagnoses_of(path, "pose")[0]
    assert (diagnosis.cause, diagnosis.magnitude) == ("interpolated_pose", pytest.approx(rate_hz))


@pytest.mark.parametrize("step_m", [0.002, 0.02])
def test_positions_in_coarse_steps_are_not_interpolated(path: Path, step_m: float) -> None:
    """They stand still and move on by a step, at distances that are even where the body flies evenly."""
    samples = sample_motion()
    file = MotionFile().altered(positions_world_m=np.rint(samples.positions_world_m / step_m) * step_m)
    assert "interpolated" not in rules(run_check(file.write(path), "pose.continuity"))


@pytest.mark.parametrize("count", [0, 1, 2, 10])
def test_a_handful_of_poses_shows_nothing_and_breaks_nothing(path: Path, count: int) -> None:
    """With few poses continuity and noise cannot be observed; orientation still can where there is one."""
    samples = sample_motion()
    few = MotionFile().altered(
        pose_times_s=samples.pose_times_s[:count],
        positions_world_m=samples.positions_world_m[:count],
        orientations_xyzw=samples.orientations_xyzw[:count],
    )
    few.write(path)
    # An empty stream is absent, which integrity.layout reports.
    nothing_shown = "not_observable" if count else "not_applicable"
    assert run_check(path, "pose.continuity").outcome == nothing_shown
    assert run_check(path, "pose.noise").outcome == nothing_shown
    assert run_check(path, "pose.orientation").outcome == ("passed" if count else "not_applicable")


def test_timestamps_that_do_not_advance_are_said(path: Path) -> None:
    """Without a usable clock there is no motion to judge."""
    file = MotionFile().altered(pose_times_s=np.zeros(401))
    result = run_check(file.write(path), "pose.continuity")
    assert result.outcome == "not_observable"
    assert "do not increase" in result.reason
