"""Quaternions of poses, on files of a motion in closed form."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.checked import diagnoses_of, measured_record, rules, run_check
from tests.support.motion_world import MotionFile, sample_motion

CHECKS = ("pose.orientation", "pose.continuity", "pose.noise")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def outcomes(path: Path) -> dict[str, str]:
    """Run all three checks; one that crashed shows as that."""
    results = measured_record(path, *CHECKS).results
    return {result.check: result.outcome for result in results}


def test_signs_of_quaternions_mean_nothing(path: Path) -> None:
    """Signs that flip at random change no outcome."""
    signs = np.where(np.random.default_rng(2).random(401) < 0.5, -1.0, 1.0)
    q = sample_motion().orientations_xyzw * signs[:, None]
    assert outcomes(MotionFile().altered(orientations_xyzw=q).write(path)) == dict.fromkeys(CHECKS, "passed")


@pytest.mark.parametrize("excess", [1e-3, -1e-3, 1e-9, 3e-15])
def test_quaternions_that_are_too_long_are_found_to_size(path: Path, excess: float) -> None:
    """One quaternion whose length is off by far more than rounding, or by little more, is named with row and size."""
    q = sample_motion().orientations_xyzw.copy()
    q[123] *= 1 + excess
    result = run_check(MotionFile().altered(orientations_xyzw=q).write(path), "pose.orientation")
    assert rules(result) == ["length"]
    assert result.findings[0].where.index_start == 123
    (diagnosis,) = diagnoses_of(path, "pose")
    assert (diagnosis.cause, diagnosis.stream) == ("quaternion_not_unit", "pose")
    assert diagnosis.magnitude == pytest.approx(excess, rel=0.2)


def test_orientations_that_are_no_numbers_are_counted(path: Path) -> None:
    """NaN is counted and located, and the other checks go on without these rows."""
    q = sample_motion().orientations_xyzw.copy()
    q[40:43] = np.nan
    result = run_check(MotionFile().altered(orientations_xyzw=q).write(path), "pose.orientation")
    assert rules(result) == ["finite"]
    assert result.findings[0].where.index_start == 40
    assert run_check(path, "pose.continuity").outcome == "passed"


@pytest.mark.parametrize(("step", "outcome"), [(1e-5, "passed"), (4e-3, "failed")])
def test_rounding_is_noise_unless_it_is_a_fault(path: Path, step: float, outcome: str) -> None:
    """Lengths that err by a small step are correct; by a step that is material they are not, and it is the cause."""
    q = np.rint(sample_motion().orientations_xyzw / step) * step
    MotionFile().altered(orientations_xyzw=q).write(path)
    assert run_check(path, "pose.orientation").outcome == outcome
    if outcome == "failed":
        assert "quantised_values" in {diagnosis.cause for diagnosis in diagnoses_of(path, "pose")}
