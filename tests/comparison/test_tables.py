"""Conclusions in words follow what was measured: a direction only beyond its error, and every file counted."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.comparison.compare import compare
from fedora_qa.comparison.tables import comparison_to_markdown, conclusions_of
from fedora_qa.comparison.types import (
    COMPARISON_VERSION,
    Comparison,
    Difference,
    FindingChange,
    Pair,
    StatisticChange,
    Subject,
    Versions,
)
from fedora_qa.record.types import Tool
from fedora_reports.comparison import page_of
from tests.comparison.imaginary import given, given_file

DARKER = Difference("a.h5", "luma_dn", "DN", 84.0, 28.0, 0.5, 56.0, 0.5, 2.0, 1e-5, (20, 20), "differs")
VERSIONS = Versions(2, 2, (), (), (), 0, (), (), ())


def comparison(*differences: Difference, versions: Versions = VERSIONS) -> Comparison:
    """A comparison of two versions at the level 0.001."""
    pair = Pair(0, 1, "versions", differences, versions)
    subjects = (Subject("v1", ()), Subject("v2", ()))
    return Comparison(COMPARISON_VERSION, Tool("fedora-qa", "0"), 0.01, 10, 1e-3, subjects, (), (pair,), (), ())


def test_a_shift_beyond_its_error_has_a_direction() -> None:
    """The name of the subject, what it does, and both means with the error of their difference."""
    expected = "v2 is darker: mean luma 28 against 84 DN in v1, a shift of -56.0 ± 0.5 DN."
    assert conclusions_of(comparison(DARKER)) == (expected,)
    (brighter,) = conclusions_of(comparison(replace(DARKER, mean_before=28.0, mean_after=84.0)))
    assert brighter.startswith("v2 is brighter: mean luma 84 against 28 DN in v1, a shift of 56.0 ± 0.5 DN")


# At the level 0.001, a normal shift is significant from 3.29 standard errors on.
@pytest.mark.parametrize(("error", "has_direction"), [(56 / 3.4, True), (56 / 3.2, False), (None, False), (0.0, True)])
def test_the_level_decides(error: float | None, has_direction: bool) -> None:
    """Within its error a shift names no direction, and the distance is stated instead."""
    (sentence,) = conclusions_of(comparison(replace(DARKER, shift_standard_error=error)))
    assert ("is darker" in sentence) == has_direction
    assert ("another distribution of luma: the distance is 56.0 ± 0.5 DN," in sentence) == (not has_direction)


def test_files_are_counted_in_each_direction() -> None:
    """Of several files the largest difference is named, and one file is brighter while two are darker."""
    others = [
        replace(DARKER, file="b.h5", mean_after=60.0, distance=24.0),
        replace(DARKER, file="c.h5", mean_after=99.0, distance=15.0),
        replace(DARKER, file="d.h5", told="no_difference_seen"),
    ]
    brighter, darker = conclusions_of(comparison(DARKER, *others))
    assert brighter.startswith("v2 is brighter in 1 of 4 files, c.h5: mean luma 99")
    assert darker.startswith("v2 is darker in 2 of 4 files, most in a.h5: mean luma 28")


def test_findings_and_statistics_are_said_too() -> None:
    """New findings come first; statistics only where they moved beyond their error."""
    finding = FindingChange("a.h5", "new", "imu.bias", "imu.bias.gyro", "imu", None, "error", "", "biased")
    moved = StatisticChange("a.h5", "motion.distance_m", 10.0, 12.0, 0.5, 1e-5, "moved")
    within = replace(moved, statistic="motion.speed_max_m_s", moved="within_error")
    versions = replace(VERSIONS, findings=(finding,), statistics=(moved, within))
    assert conclusions_of(comparison(DARKER, versions=versions)) == (
        "v2 has 1 new finding: imu.bias.gyro.",
        *conclusions_of(comparison(DARKER)),
        "v2, a.h5: motion.distance_m is 12 against 10, a difference of 2.0 ± 0.5.",
    )


@pytest.mark.parametrize(
    ("answers", "sentence"),
    [
        (["identical", "identical"], "v2 and v1 have identical distributions."),
        (["identical", "no_difference_seen"], "No difference is detected between v2 and v1."),
        (
            ["not_told", "no_difference_seen"],
            "No difference is detected between v2 and v1; 1 of 2 distributions have too few",
        ),
        (["not_told", "identical"], "Differences between v2 and v1 cannot be detected"),
    ],
)
def test_nothing_differs(answers: list[str], sentence: str) -> None:
    """The three ways in which nothing differs are told apart."""
    differences = (replace(DARKER, told=answer) for answer in answers)  # type: ignore[arg-type]
    (only,) = conclusions_of(comparison(*differences))
    assert only.startswith(sentence)


def test_measured_and_written_first() -> None:
    """Depths that are halved are nearer, in markdown before any table and on the page."""
    far = given_file("a/x.h5", np.full(20, 2.0).tolist())
    near = given_file("b/x.h5", np.full(20, 2.0 - np.log(2)).tolist())
    measured = compare((given("a", far), given("b", near)), None, 0.01)
    (sentence,) = conclusions_of(measured)
    assert sentence.startswith("b has smaller depths: mean depth 3.8")
    text = comparison_to_markdown(measured)
    assert text.index("has smaller depths") < text.index("| --- |")
    assert page_of(measured).conclusions == (sentence,)
