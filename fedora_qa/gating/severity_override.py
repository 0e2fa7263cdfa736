"""Change the severity of findings, as a policy does by check, and the outcomes with it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, Literal

from fedora_qa.record.types import IMMATERIAL, FileRecord, Finding, Result, Severity

GRAVE: Final[frozenset[Severity]] = frozenset({"critical", "error"})
"""Severities of findings that fail a check."""

Mark = Callable[[Result, Finding], Finding]
"""Returns a finding with the severity and message that it is to have."""


def mark_findings(file: FileRecord, mark: Mark) -> FileRecord:
    """Return the file with all findings changed by ``mark``; a check fails where a finding is grave, and else warns."""
    results = []
    for result in file.results:
        findings = tuple(mark(result, finding) for finding in result.findings)
        if findings == result.findings:
            results.append(result)
        # A check that crashed or could not measure keeps its outcome, whatever the severity of its findings.
        elif result.outcome not in {"failed", "warned"}:
            results.append(replace(result, findings=findings))
        else:
            grave = any(finding.severity in GRAVE for finding in findings)
            results.append(replace(result, findings=findings, outcome="failed" if grave else "warned"))
    return replace(file, results=tuple(results))


def with_severity(
    file: FileRecord, severity: Mapping[str, Severity], fail_on: Literal["failed", "warned"]
) -> FileRecord:
    """Return the file with the severities of the policy.

    Parameters
    ----------
    severity
        By subject or check. Where both are named, the check counts.
    fail_on
        ``warned``: a warning of a check is an error unless ``severity`` sets another severity.

    Returns
    -------
    FileRecord
        Deviations that are not material stay information: the profile of the policy decides about them.
    """

    def mark(result: Result, finding: Finding) -> Finding:
        if finding.code == f"{result.check}.{IMMATERIAL}":
            return finding
        subject = result.check.partition(".")[0]
        named = severity.get(result.check, severity.get(subject))
        unnamed: Severity = "error" if fail_on == "warned" and result.outcome == "warned" else finding.severity
        return replace(finding, severity=named or unnamed)

    return mark_findings(file, mark)
