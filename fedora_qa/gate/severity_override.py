"""Change how findings count, and let outcomes follow."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from fedora_qa.record.types import FileRecord, Finding, Result, Severity

GRAVE: Final[frozenset[Severity]] = frozenset({"critical", "error"})
"""Severities of findings that fail a check."""

Mark = Callable[[Result, Finding], Finding]
"""Returns a finding as it is to count."""


def marked(file: FileRecord, mark: Mark) -> FileRecord:
    """Return the file with every finding marked; a check fails where one of its findings is grave, else it warns."""
    return replace(file, results=tuple(_marked(result, mark) for result in file.results))


def _marked(result: Result, mark: Mark) -> Result:
    findings = tuple(mark(result, finding) for finding in result.findings)
    if findings == result.findings:
        return result
    # A check that crashed or could not measure stays so, whatever its findings count as.
    if result.outcome not in {"failed", "warned"}:
        return replace(result, findings=findings)
    grave = any(finding.severity in GRAVE for finding in findings)
    return replace(result, findings=findings, outcome="failed" if grave else "warned")
