"""The result of a rule about the release, and its place in the record beside the results of checks."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from fedora_qa.record.several_files import FOLDER
from fedora_qa.record.types import FileRecord, Finding, Result, Where


@dataclass(frozen=True, slots=True)
class Violation:
    """A rule that the file of this name breaks, and when; ``code`` is the last part of the finding's code."""

    name: str
    code: str
    message: str
    stream: str | None = None
    start_us: float | None = None
    stop_us: float | None = None


@dataclass(frozen=True, slots=True)
class ReleaseResult:
    """The result of one rule.

    Attributes
    ----------
    rule
        The name of the rule among checks, ``release.<rule>``.
    question
        The question that the rule answers.
    about
        ``each``: every sequence has a result; ``FOLDER``: the release has one. The release may break either.
    violations
        Empty where the rule is kept.
    not_applicable
        Why the rule does not apply; empty where it does.
    """

    rule: str
    question: str
    about: Literal["each", "."]
    violations: tuple[Violation, ...] = ()
    not_applicable: str = ""


def with_release_results(name: str, file: FileRecord, release_results: Iterable[ReleaseResult]) -> FileRecord:
    """Return the file with the result of every rule about it; ``name`` is the name of the file in the release."""
    count = sum(len(result.findings) for result in file.results if result.check.startswith("release."))
    results = list(file.results)
    for release_result in release_results:
        broken = [violation for violation in release_result.violations if violation.name == name]
        if not broken and (release_result.about == FOLDER) != (name == FOLDER):
            continue
        rule, question = release_result.rule, release_result.question
        # Numbering continues over all rules, so that the findings of a file have different identifiers.
        findings = tuple(
            Finding(
                f"R{number}",
                f"{rule}.{violation.code}",
                "error",
                violation.message,
                Where(violation.stream, violation.start_us, violation.stop_us),
            )
            for number, violation in enumerate(broken, start=count + 1)
        )
        count += len(findings)
        if release_result.not_applicable:
            results.append(Result(rule, "not_applicable", question, reason=release_result.not_applicable))
        else:
            results.append(Result(rule, "failed" if findings else "passed", question, findings=findings))
    return replace(file, results=tuple(results))
