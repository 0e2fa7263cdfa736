"""The record as CI systems show it: a flat list of problems, JUnit XML, commands of GitHub, and a badge.

The levels of problems give the same verdict in every format; ``sarif`` is another.

JUnit has one suite for each file, one case for each check. The form is the common ground of what CI systems read
(Jenkins, GitLab, Azure): failures are findings, errors are reasons why a file is incomplete, and skipped are checks
that were not applicable or not observable. Escapes of GitHub are those of its own toolkit (actions/toolkit,
command.ts). The badge is the JSON that shields.io reads from an address (shields.io, "Endpoint Badge").
"""

import json
import secrets
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from fedora_qa.record.types import FileRecord, Record, Result, Severity, Verdict, Waived, Where, gravest_verdict
from fedora_qa.record.wording import OUTCOME_WORDS, cause_sentence, check_cells, place, printable, why_incomplete

Level = Literal["error", "warning", "note"]

INCOMPLETE: Final = "incomplete"
"""Code of the problem of an incomplete file: it is no finding, but too little of the file was measured."""

# GitHub has three kinds of annotations, the record four severities.
_LEVELS: Final[dict[Severity, Level]] = {"critical": "error", "error": "error", "warning": "warning", "info": "note"}

_JUNIT_ENDS = {"failures": "failure", "errors": "error", "skipped": "skipped"}

_GITHUB_COMMANDS: Final[dict[Level, str]] = {"error": "error", "warning": "warning", "note": "notice"}

_BADGE_COLOURS: Final[dict[Verdict, str]] = {"clean": "brightgreen", "findings": "red", "incomplete": "orange"}


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing to show about a file.

    A file with a problem of level ``error`` is not clean: incomplete where one has the code ``INCOMPLETE``, else with
    findings. ``code`` is the rule, ``check`` its check (empty for ``INCOMPLETE``), ``waived`` who accepts it.
    """

    path: str
    check: str
    code: str
    level: Level
    message: str
    where: Where
    waived: Waived | None = None


def problems_of(file: FileRecord) -> tuple[Problem, ...]:
    """Return the problems of a file, in the order of its checks, and last whether it is incomplete."""
    problems: list[Problem] = []
    for result in file.results:
        failed, has_error = result.outcome == "failed", False
        for finding in result.findings:
            level = _LEVELS[finding.severity]
            # `critical` and `error` of a check that did not fail would contradict the verdict of the file.
            level = "warning" if level == "error" and not failed else level
            has_error |= level == "error"
            causes = [
                f"Probable cause: {cause_sentence(diagnosis)}. {diagnosis.remedy}"
                for diagnosis in file.diagnoses
                if finding.id in diagnosis.explains
            ]
            problems.append(
                Problem(
                    path=file.path,
                    check=result.check,
                    code=finding.code or result.check,
                    level=level,
                    message=" ".join((finding.message, *causes)),
                    where=finding.where,
                    waived=finding.waived,
                )
            )
        # A failed check without a finding of that level must still fail the build.
        if failed and not has_error:
            message = f"The check failed: {result.reason or result.question}"
            problems.append(Problem(file.path, result.check, result.check, "error", message, Where()))
    crashed = [result.check for result in file.results if result.outcome == "crashed"]
    why = why_incomplete(file) or (f"crashed: {', '.join(crashed)}" if crashed else "")
    if why:
        problems.append(Problem(file.path, "", INCOMPLETE, "error", f"The check is incomplete: {why}.", Where()))
    return tuple(problems)


def record_to_junit(record: Record) -> str:
    """Return the record as a JUnit XML document."""
    suites = ET.Element("testsuites", name=printable(record.tool.name))
    for file in record.files:
        # All text passes through `printable`: XML 1.0 forbids most control characters, and a parser refuses the file.
        suite = ET.SubElement(suites, "testsuite", name=printable(file.path))
        properties = ET.SubElement(suite, "properties")
        facts = {
            "verdict": file.verdict,
            "sha256": file.sha256,
            "digest_kind": file.digest_kind,
            "version": record.tool.version,
            "ruleset_version": record.ruleset_version,
            "effort": record.effort,
            "profile": record.profile,
        }
        for name, value in facts.items():
            ET.SubElement(properties, "property", name=name, value=printable(value))
        problems = problems_of(file)
        for result in file.results:
            own = [problem for problem in problems if problem.check == result.check]
            suite.append(_junit_case(result, own, file.path))
        for problem in problems:
            if problem.code == INCOMPLETE:
                # A case of its own, because CI systems count the outcomes of cases only.
                ended = ET.SubElement(suite, "testcase", name="complete", classname=printable(file.path))
                ET.SubElement(ended, "error", message=printable(problem.message), type=INCOMPLETE)
        _junit_count(suite)
    _junit_count(suites)
    ET.indent(suites)
    return ET.tostring(suites, encoding="unicode", xml_declaration=True) + "\n"


def _junit_case(result: Result, problems: Sequence[Problem], path: str) -> ET.Element:
    case = ET.Element("testcase", name=printable(result.check), classname=printable(path))
    errors = [problem for problem in problems if problem.level == "error"]
    if errors:
        first = errors[0]
        failure = ET.SubElement(case, "failure", message=printable(first.message), type=printable(first.code))
        # One failure element a case, which every reader accepts; its text lists all findings.
        failure.text = "\n".join(_junit_line(problem) for problem in errors)
    elif result.outcome == "crashed":
        error = ET.SubElement(case, "error", message=printable(result.reason), type="crashed")
        error.text = "\n".join(printable(line) for line in result.traceback.splitlines())
    elif result.outcome in {"not_applicable", "not_observable"}:
        words = f"{OUTCOME_WORDS[result.outcome]}: {result.reason}"
        ET.SubElement(case, "skipped", message=printable(words), type=result.outcome)
    # Warnings and measurements do not fail a build; `system-out` shows them without an effect on the counts.
    measured, expected, least, coverage = check_cells(result)
    parts = (measured, expected and f"expected {expected}", least and f"sees from {least}", coverage)
    lines = [_junit_line(problem) for problem in problems if problem.level != "error"]
    lines.append(printable("; ".join(part for part in parts if part)))
    if any(lines):
        ET.SubElement(case, "system-out").text = "\n".join(line for line in lines if line)
    return case


def _junit_line(problem: Problem) -> str:
    where = place(problem.where)
    return printable(f"{problem.code}: {problem.message}" + (f" ({where})" if where else ""))


def _junit_count(element: ET.Element) -> None:
    """Set the numbers of cases below an element, of all and by outcome."""
    element.set("tests", str(len(element.findall(".//testcase"))))
    for attribute, tag in _JUNIT_ENDS.items():
        element.set(attribute, str(len(element.findall(f".//testcase/{tag}"))))


def record_to_github(record: Record) -> str:
    """Return one annotation a line; empty without problems."""
    lines: list[str] = []
    for problem in (problem for file in record.files for problem in problems_of(file)):
        where = place(problem.where)
        message = problem.message + (f" ({where})" if where else "")
        properties = f"file={_github_property(problem.path)},title={_github_property(problem.code)}"
        lines.append(f"::{_GITHUB_COMMANDS[problem.level]} {properties}::{_github_data(message)}\n")
    return "".join(lines)


def silenced(text: str) -> str:
    """Return text between commands that keep GitHub from executing any command in it.

    The token resumes commands, so that it is random and cannot be predicted.
    """
    token = secrets.token_hex(16)
    return f"::stop-commands::{token}\n{text}\n::{token}::\n"


def _github_data(text: str) -> str:
    """Return a message as the end of a command can carry it."""
    # The percent sign first: the escapes that follow contain it (actions/toolkit, escapeData).
    return printable(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _github_property(text: str) -> str:
    """Return the value of a property, in which colons and commas must be escaped as well."""
    return _github_data(text).replace(":", "%3A").replace(",", "%2C")


def record_to_badge(record: Record) -> str:
    """Return the gravest verdict of all files as the JSON of a badge."""
    verdict = gravest_verdict(record.files)
    badge = {"schemaVersion": 1, "label": "fedora-qa", "message": verdict, "color": _BADGE_COLOURS[verdict]}
    return json.dumps(badge, indent=1) + "\n"
