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
class Ruling:
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


def with_rulings(name: str, file: FileRecord, rulings: Iterable[Ruling]) -> FileRecord:
    """Return the file with a result for every rule that asks of it; ``name`` is the file's in the release."""
    count = sum(len(result.findings) for result in file.results if result.check.startswith("release."))
    results = list(file.results)
    for ruling in rulings:
        broken = [violation for violation in ruling.violations if violation.name == name]
        if broken or (ruling.about == FOLDER) == (name == FOLDER):
            findings = tuple(_finding(ruling, violation, count + i + 1) for i, violation in enumerate(broken))
            count += len(findings)
            results.append(_result(ruling, findings))
    return replace(file, results=tuple(results))


def _result(ruling: Ruling, findings: tuple[Finding, ...]) -> Result:
    if ruling.unasked:
        return Result(ruling.rule, "not_applicable", ruling.question, reason=ruling.unasked)
    return Result(ruling.rule, "failed" if findings else "passed", ruling.question, findings=findings)


def _finding(ruling: Ruling, violation: Violation, number: int) -> Finding:
    where = Where(stream=violation.stream)
    return Finding(f"R{number}", f"{ruling.rule}.{violation.code}", "error", violation.message, where)
