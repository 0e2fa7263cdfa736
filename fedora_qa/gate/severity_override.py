"""Change how findings count, as a policy's severity by check does, and let outcomes follow."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, Literal

from fedora_qa.record.types import FileRecord, Finding, Result, Severity

GRAVE: Final[frozenset[Severity]] = frozenset({"critical", "error"})
"""Severities of findings that fail a check."""

Mark = Callable[[Result, Finding], Finding]
"""Returns a finding as it is to count."""


def marked(file: FileRecord, mark: Mark) -> FileRecord:
    """Return the file with every finding marked; a check fails where one of its findings is grave, else it warns."""
    results = []
    for result in file.results:
        findings = tuple(mark(result, finding) for finding in result.findings)
        if findings == result.findings:
            results.append(result)
        # A check that crashed or could not measure stays so, whatever its findings count as.
        elif result.outcome not in {"failed", "warned"}:
            results.append(replace(result, findings=findings))
        else:
            grave = any(finding.severity in GRAVE for finding in findings)
            results.append(replace(result, findings=findings, outcome="failed" if grave else "warned"))
    return replace(file, results=tuple(results))


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
