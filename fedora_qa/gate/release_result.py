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
        if not broken and (release_result.about == FOLDER) != (name == FOLDER):
            continue
        rule, question = release_result.rule, release_result.question
        # Numbers go on over all rules, so that the findings of a file have different ids.
        findings = tuple(
            Finding(
                f"R{number}", f"{rule}.{violation.code}", "error", violation.message, Where(stream=violation.stream)
            )
            for number, violation in enumerate(broken, start=count + 1)
        )
        count += len(findings)
        if release_result.unasked:
            results.append(Result(rule, "not_applicable", question, reason=release_result.unasked))
        else:
            results.append(Result(rule, "failed" if findings else "passed", question, findings=findings))
    return replace(file, results=tuple(results))
