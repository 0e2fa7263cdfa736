"""Severity by check: what the policy lets findings count as."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

from fedora_qa.gate.severity_override import marked
from fedora_qa.record.types import FileRecord, Finding, Result, Severity


def with_severity(
    file: FileRecord, severity: Mapping[str, Severity], fail_on: Literal["failed", "warned"]
) -> FileRecord:
    """Return the file with findings as grave as the policy says.

    Parameters
    ----------
    severity
        By subject or check. Where both are named, the check counts.
    fail_on
        ``warned``: what checks warn of is an error unless ``severity`` says otherwise.
    """

    def mark(result: Result, finding: Finding) -> Finding:
        subject = result.check.partition(".")[0]
        named = severity.get(result.check, severity.get(subject))
        unnamed: Severity = "error" if fail_on == "warned" and result.outcome == "warned" else finding.severity
        return replace(finding, severity=named or unnamed)

    return marked(file, mark)
