"""What a rule about the release found, and how it becomes results of the record like those of any check."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from fedora_qa.gate.release import FOLDER
from fedora_qa.record.types import FileRecord, Finding, Result, Where


@dataclass(frozen=True, slots=True)
class Violation:
    """A rule that is broken, by the file of this name; ``code`` is the last part of the finding's."""

    name: str
    code: str
    message: str
    stream: str | None = None


@dataclass(frozen=True, slots=True)
class ReleaseResult:
    """What one rule found.

    Attributes
    ----------
    rule
        Its name among checks, ``release.<rule>``.
    question
        What it asks.
    about
        ``each``: of every sequence; ``FOLDER``: of the release. The release may break either.
    violations
        Empty where all is in order.
    unasked
        Why there was nothing to hold to the rule; empty where there was.
    """

    rule: str
    question: str
    about: Literal["each", "."]
    violations: tuple[Violation, ...] = ()
    unasked: str = ""


def with_release_results(name: str, file: FileRecord, release_results: Iterable[ReleaseResult]) -> FileRecord:
    """Return the file with a result for every rule that asks of it; ``name`` is the file's in the release."""
    count = sum(len(result.findings) for result in file.results if result.check.startswith("release."))
    results = list(file.results)
    for release_result in release_results:
        broken = [violation for violation in release_result.violations if violation.name == name]
        if broken or (release_result.about == FOLDER) == (name == FOLDER):
            findings = tuple(_finding(release_result, violation, count + i + 1) for i, violation in enumerate(broken))
            count += len(findings)
            results.append(_result(release_result, findings))
    return replace(file, results=tuple(results))


def _result(release_result: ReleaseResult, findings: tuple[Finding, ...]) -> Result:
    if release_result.unasked:
        return Result(release_result.rule, "not_applicable", release_result.question, reason=release_result.unasked)
    return Result(release_result.rule, "failed" if findings else "passed", release_result.question, findings=findings)


def _finding(release_result: ReleaseResult, violation: Violation, number: int) -> Finding:
    where = Where(stream=violation.stream)
    return Finding(f"R{number}", f"{release_result.rule}.{violation.code}", "error", violation.message, where)
