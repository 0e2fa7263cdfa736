"""The record as JUnit XML: one suite for each file, one case for each check.

The form is the common ground of what CI systems read (Jenkins, GitLab, Azure): failures are findings, errors are
reasons why a file is incomplete, and skipped are checks that were not applicable or not observable.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from fedora_qa.record.problems import INCOMPLETE, Problem, problems_of
from fedora_qa.record.types import Record, Result
from fedora_qa.record.wording import OUTCOME_WORDS, check_cells, place, printable

_ENDS = {"failures": "failure", "errors": "error", "skipped": "skipped"}


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
            suite.append(_case(result, own, file.path))
        for problem in problems:
            if problem.code == INCOMPLETE:
                # A case of its own, because CI systems count the outcomes of cases only.
                ended = ET.SubElement(suite, "testcase", name="complete", classname=printable(file.path))
                ET.SubElement(ended, "error", message=printable(problem.message), type=INCOMPLETE)
        _count(suite)
    _count(suites)
    ET.indent(suites)
    return ET.tostring(suites, encoding="unicode", xml_declaration=True) + "\n"


def _case(result: Result, problems: Sequence[Problem], path: str) -> ET.Element:
    case = ET.Element("testcase", name=printable(result.check), classname=printable(path))
    errors = [problem for problem in problems if problem.level == "error"]
    if errors:
        first = errors[0]
        failure = ET.SubElement(case, "failure", message=printable(first.message), type=printable(first.code))
        # One failure element a case, which every reader accepts; its text lists all findings.
        failure.text = "\n".join(_line(problem) for problem in errors)
    elif result.outcome == "crashed":
        error = ET.SubElement(case, "error", message=printable(result.reason), type="crashed")
        error.text = "\n".join(printable(line) for line in result.traceback.splitlines())
    elif result.outcome in {"not_applicable", "not_observable"}:
        words = f"{OUTCOME_WORDS[result.outcome]}: {result.reason}"
        ET.SubElement(case, "skipped", message=printable(words), type=result.outcome)
    # Warnings and measurements do not fail a build; `system-out` shows them without an effect on the counts.
    measured, expected, least, coverage = check_cells(result)
    parts = (measured, expected and f"expected {expected}", least and f"sees from {least}", coverage)
    lines = [_line(problem) for problem in problems if problem.level != "error"]
    lines.append(printable("; ".join(part for part in parts if part)))
    if any(lines):
        ET.SubElement(case, "system-out").text = "\n".join(line for line in lines if line)
    return case


def _line(problem: Problem) -> str:
    where = place(problem.where)
    return printable(f"{problem.code}: {problem.message}" + (f" ({where})" if where else ""))


def _count(element: ET.Element) -> None:
    """Set the numbers of cases below an element, of all and by outcome."""
    element.set("tests", str(len(element.findall(".//testcase"))))
    for attribute, tag in _ENDS.items():
        element.set(attribute, str(len(element.findall(f".//testcase/{tag}"))))
