"""What findings count as is what the policy says, and outcomes follow."""

from dataclasses import replace

import pytest

from fedora_qa.gating.acceptance import with_severity
from fedora_qa.record.types import Severity
from tests.support.records import crashed, failed, file_record, passed

WARNED = replace(failed(), outcome="warned", findings=failed().findings[1:])

CASES = {
    "unnamed": ({}, "failed", "failed"),
    "check down": ({"event_response.timing": "warning"}, "failed", "warned"),
    "subject down": ({"event_response": "info"}, "failed", "warned"),
    "check before subject": ({"event_response": "info", "event_response.timing": "critical"}, "failed", "failed"),
    "another check": ({"imu": "info"}, "failed", "failed"),
}


@pytest.mark.parametrize(("severity", "fail_on", "outcome"), CASES.values(), ids=CASES.keys())
def test_failures(severity: dict[str, Severity], fail_on: str, outcome: str) -> None:
    """A failed check fails as long as one of its findings is grave."""
    assert with_severity(file_record(failed()), severity, fail_on).results[0].outcome == outcome


def test_warnings_can_be_raised() -> None:
    """A warning becomes a failure by name, or with ``fail_on = "warned"`` unless named."""
    file = file_record(WARNED)
    assert with_severity(file, {"event_response": "error"}, "failed").results[0].outcome == "failed"
    assert with_severity(file, {}, "warned").results[0].outcome == "failed"
    assert with_severity(file, {"event_response": "warning"}, "warned").results[0].outcome == "warned"


def test_what_has_no_findings_stays() -> None:
    """Passed and crashed checks are what they were."""
    file = file_record(passed(), crashed())
    assert with_severity(file, {"clocks": "critical", "imu": "info"}, "warned") == file
