"""What became of findings, outcomes, measured values and statistics from one version to the other."""

from dataclasses import replace

import pytest
from scipy.stats import norm

from fedora_qa.comparison.compare import allowed_shift, count_with_errors, record_changes, statistic_changes
from fedora_qa.record.types import Finding, Measurement, Result, Where
from tests.support.records import failed, file_record, not_observable, passed

CLEAN = replace(failed(), outcome="passed", findings=(), measurements=(failed().measurements[0],))
NAME = "seq.h5"


def moved(by: float) -> Result:
    """The failed check, whose offset of 2.0634 +/- 0.031 ms with a limit of 0.16 ms has moved."""
    threshold, offset = failed().measurements
    assert offset.value is not None
    return replace(failed(), measurements=(threshold, replace(offset, value=offset.value + by)))


def test_new_and_gone() -> None:
    """What only the later version has is new, what only the earlier one has is gone, with severity and message."""
    clean, faulty = file_record(CLEAN), file_record(failed())
    forth, back = record_changes(NAME, clean, faulty), record_changes(NAME, faulty, clean)
    assert [(one.change, one.severity_before, one.severity_after) for one in forth.findings] == [
        ("new", None, "error"),
        ("new", None, "warning"),
    ]
    assert [one.change for one in back.findings] == ["gone", "gone"]
    assert back.findings[0].message_before == forth.findings[0].message_after == failed().findings[0].message
    assert [(one.before, one.after) for one in forth.outcomes] == [("passed", "failed")]


def test_findings_stay_while_their_check_measures_the_same() -> None:
    """Within the limits of both it is unchanged; beyond them it has changed, and so has the value."""
    limit = allowed_shift(failed().measurements[1], failed().measurements[1])
    assert limit == pytest.approx(0.16 * 2**0.5)
    still = record_changes(NAME, file_record(failed()), file_record(moved(0.99 * limit)))
    assert (still.findings, still.unchanged, still.measurements) == ((), 2, ())
    other = record_changes(NAME, file_record(failed()), file_record(moved(1.01 * limit)))
    assert [one.change for one in other.findings] == ["changed", "changed"]
    assert [(one.name, one.allowed) for one in other.measurements] == [("offset", pytest.approx(limit))]


def test_a_second_finding_of_one_rule_is_new() -> None:
    """Findings of one rule and stream are told apart by their order; another stream is another finding."""
    one = failed()
    more = replace(
        one,
        findings=(
            *one.findings,
            Finding("F3", one.findings[0].code, "error", "Again.", Where(stream="events")),
            Finding("F4", one.findings[0].code, "error", "Elsewhere.", Where(stream="rgb")),
        ),
    )
    found = record_changes(NAME, file_record(one), file_record(more))
    assert [(change.change, change.stream) for change in found.findings] == [("new", "events"), ("new", "rgb")]
    assert found.unchanged == 2


def test_only_the_side_that_counts_moves() -> None:
    """A value far below what is expected is as good as any other where only greater ones count."""
    quiet = Measurement("noise", 0.1, "DN", 0.1, 1.0, 0.5, 0.6, side="upper")
    results = [replace(passed(), measurements=(replace(quiet, value=value),)) for value in (0.1, 0.9, 3.0)]
    records = [file_record(result) for result in results]
    assert not record_changes(NAME, records[0], records[1]).measurements
    assert len(record_changes(NAME, records[0], records[2]).measurements) == 1


def test_what_could_not_be_told_does_not_move() -> None:
    """A check that sees nothing has an outcome of its own, and no values to compare."""
    found = record_changes(NAME, file_record(passed("imu.timing")), file_record(not_observable()))
    assert [(one.before, one.after) for one in found.outcomes] == [("passed", "not_observable")]
    assert not found.measurements


def test_statistics_move_beyond_their_error() -> None:
    """Their chance is that of a normal deviate; without an error on both sides nobody can tell."""
    before = {
        "motion": {"distance_m": 10.0, "distance_standard_error_m": 0.3, "poses_seen": 100, "speed_max_m_s": 2.0},
        "sequence": {"duration_of": "pose", "duration_s": 2.0},
    }
    after = {
        "motion": {"distance_m": 11.0, "distance_standard_error_m": 0.4, "poses_seen": 99, "speed_max_m_s": None},
        "sequence": {"duration_of": "rgb", "duration_s": 2.0},
    }
    found = {one.statistic: one for one in statistic_changes(NAME, before, after, 0.05)}
    assert set(found) == {"motion.distance_m", "motion.poses_seen", "motion.speed_max_m_s"}
    distance = found["motion.distance_m"]
    assert (distance.moved, distance.standard_error) == ("moved", pytest.approx(0.5))
    assert distance.chance == pytest.approx(2 * norm.sf(2.0))
    assert next(iter(statistic_changes(NAME, before, after, 0.01))).moved == "within_error"
    assert {found[name].moved for name in set(found) - {"motion.distance_m"}} == {"changed"}
    assert count_with_errors(before, after) == 1
