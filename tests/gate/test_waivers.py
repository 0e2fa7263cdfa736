"""A waiver accepts what it names and nothing else, until its day; then it is a finding itself."""

from dataclasses import replace
from datetime import date

import pytest

from fedora_qa.gating.acceptance import Waiver, rule_on_waivers, waive
from fedora_qa.gating.release import with_release_results
from fedora_qa.record.types import Waived
from tests.support.records import crashed, failed, file_record, late_events, passed

TODAY = date(2026, 6, 1)
FILE = file_record(failed(), passed(), diagnoses=(late_events(),))
CODE = "event_response.timing.offset"
WAIVER = Waiver("a.h5", "event_response.timing", "known latency", "anna", TODAY, code=CODE)
BY_CAUSE = replace(WAIVER, code=None, cause="events:time_offset")


@pytest.mark.parametrize("waiver", [WAIVER, BY_CAUSE], ids=["code", "cause"])
def test_a_waived_finding_is_information(waiver: Waiver) -> None:
    """On its last day a waiver still holds: the check only warns, and the finding says who, why and until when."""
    result = waive("a.h5", FILE, [waiver], TODAY).results[0]
    assert result.outcome == "warned"
    finding, warning = result.findings
    assert finding.severity == "info"
    assert finding.message.endswith("Waived until 2026-06-01 by anna: known latency")
    assert finding.waived == Waived("anna", "known latency", "2026-06-01")
    assert warning == FILE.results[0].findings[1]


NARROW = {
    "another file": replace(WAIVER, file="b.h5"),
    "another check": replace(WAIVER, check="event_response"),
    "another code": replace(WAIVER, code="event_response.timing"),
    "another cause": replace(BY_CAUSE, cause="imu:time_offset"),
    "the day before": replace(WAIVER, expires=date(2026, 5, 31)),
}


@pytest.mark.parametrize("waiver", NARROW.values(), ids=NARROW.keys())
def test_nothing_else_is_waived(waiver: Waiver) -> None:
    """A waiver that differs in one thing changes nothing, and is a finding: unused, or expired."""
    assert waive("a.h5", FILE, [waiver], TODAY) == FILE
    (violation,) = rule_on_waivers([("a.h5", FILE)], [waiver], TODAY).violations
    assert violation.code == ("expired" if waiver.expires < TODAY else "unused")
    assert "anna" in violation.message


def test_a_cause_waives_only_what_it_explains() -> None:
    """A second finding of the check that the diagnosis does not explain stays."""
    other = replace(FILE.results[0].findings[0], id="F9", code="event_response.timing.jitter")
    file = replace(FILE, results=(replace(FILE.results[0], findings=(*FILE.results[0].findings, other)),))
    result = waive("a.h5", file, [BY_CAUSE], TODAY).results[0]
    assert result.outcome == "failed"
    assert [finding.severity for finding in result.findings] == ["info", "warning", "error"]


def test_a_crash_is_not_waived() -> None:
    """A check that crashed has no finding to waive."""
    file = file_record(crashed())
    assert waive("a.h5", file, [replace(WAIVER, check="imu.noise")], TODAY) == file


def test_a_needed_waiver_is_in_order() -> None:
    """A waiver that covers a finding breaks no rule."""
    assert not rule_on_waivers([("a.h5", FILE)], [WAIVER, BY_CAUSE], TODAY).violations


def test_without_waivers_nothing_passes() -> None:
    """Where there is no waiver the rule does not apply, and says so."""
    (result,) = with_release_results(".", file_record(), [rule_on_waivers([("a.h5", FILE)], [], TODAY)]).results
    assert (result.outcome, result.reason) == ("not_applicable", "the policy has no waivers")
