"""The record as SARIF 2.1.0 (OASIS standard, errata 01), as code-scanning systems read it.

Findings are results; what makes a file incomplete is a notification of a run whose execution was not successful. A
waived finding is a suppressed result; where there is one, every result of the run states whether it is (3.27.23). A
rule has the level of its gravest result, which is the default of all that it reports (3.50.3).
"""

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import quote

from fedora_qa.record.ci import INCOMPLETE, Level, Problem, problems_of
from fedora_qa.record.markdown import escape
from fedora_qa.record.types import Record
from fedora_qa.record.wording import cause_sentence, place, printable, status_sentence

SCHEMA: Final = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"

_LEVELS: Final[tuple[Level, ...]] = ("error", "warning", "note")
"""The gravest first."""


@dataclass(frozen=True, slots=True)
class RuleHelp:
    """What people read of a rule beside its results.

    Attributes
    ----------
    description
        What is measured, in plain text.
    text, markdown
        What is checked, why it matters and what to do, in plain text and in Markdown.
    """

    description: str
    text: str
    markdown: str


def record_to_sarif(record: Record, helps: Mapping[str, RuleHelp]) -> str:
    """Return the record as a SARIF 2.1.0 document with one run.

    Parameters
    ----------
    helps
        By the name of a check the help of its rules. The rules of other checks have the question as their help.
    """
    problems = [problem for file in record.files for problem in problems_of(file)]
    findings = [problem for problem in problems if problem.code != INCOMPLETE]
    missing = [problem for problem in problems if problem.code == INCOMPLETE]
    questions = {result.check: result.question for file in record.files for result in file.results}
    # By their printable text: two codes that differ only in what XML and JSON cannot show are one rule.
    problems_of_rule: dict[str, list[Problem]] = {}
    for problem in findings:
        problems_of_rule.setdefault(printable(problem.code), []).append(problem)
    rules = sorted(problems_of_rule)
    artifacts: list[dict[str, Any]] = []
    for file in record.files:
        artifact: dict[str, Any] = {
            "location": {"uri": artifact_uri(file.path)},
            "length": file.size,
            "properties": {
                "verdict": file.verdict,
                "diagnoses": [
                    {
                        "cause": printable(f"{diagnosis.stream}:{diagnosis.cause}"),
                        "status": diagnosis.status,
                        "text": printable(f"{cause_sentence(diagnosis)}; {status_sentence(diagnosis)}"),
                    }
                    for diagnosis in file.diagnoses
                ],
            },
        }
        # A partial digest is not the SHA-256 of the file, with which readers would compare it.
        if file.digest_kind == "full":
            artifact["hashes"] = {"sha-256": printable(file.sha256)}
        artifacts.append(artifact)
    run = {
        "tool": {
            "driver": {
                "name": printable(record.tool.name),
                "version": printable(record.tool.version),
                "rules": [_rule(rule, problems_of_rule[rule], questions, helps) for rule in rules],
            }
        },
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {
                # False where a file is incomplete; findings alone are the result of a successful execution.
                "executionSuccessful": not missing,
                "toolExecutionNotifications": [
                    {
                        "level": "error",
                        "message": {"text": printable(problem.message)},
                        "locations": [_location(problem)],
                        "descriptor": {"id": INCOMPLETE},
                    }
                    for problem in missing
                ],
            }
        ],
        "artifacts": artifacts,
        "results": _results(findings, rules),
        "properties": {
            "ruleset_version": printable(record.ruleset_version),
            "effort": printable(record.effort),
            "profile": printable(record.profile),
        },
    }
    document = {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}
    return json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def artifact_uri(path: str) -> str:
    """Return a path as a URI reference: ``file://`` where it is absolute, else relative to the repository."""
    quoted = quote(path.encode("utf-8", "backslashreplace"))
    # Code scanning resolves a relative reference against the root of the repository.
    return f"file://{quoted}" if path.startswith("/") else quoted


def _rule(
    rule: str, problems: Sequence[Problem], questions: Mapping[str, str], helps: Mapping[str, RuleHelp]
) -> dict[str, Any]:
    """Return a rule with its help and level; its problems are one at least."""
    check = problems[-1].check
    question = printable(questions[check])
    rule_help = helps.get(check) or RuleHelp(question, question, escape(question))
    levels = {problem.level for problem in problems}
    return {
        "id": rule,
        "shortDescription": {"text": question},
        "fullDescription": {"text": rule_help.description},
        "help": {"text": rule_help.text, "markdown": rule_help.markdown},
        "defaultConfiguration": {"level": next(level for level in _LEVELS if level in levels)},
    }


def _results(findings: Sequence[Problem], rules: Sequence[str]) -> list[dict[str, Any]]:
    """Return a result for each finding; a fingerprint distinguishes it from others of its rule, stream and file."""
    states_suppressions = any(problem.waived for problem in findings)
    counts: Counter[tuple[str, str, str]] = Counter()
    results: list[dict[str, Any]] = []
    for problem in findings:
        # Without message, time and row, which change with every measured number: the alert must stay the same one.
        kin = (problem.path, problem.code, problem.where.stream or "")
        digest = hashlib.sha256(json.dumps((*kin, str(counts[kin]))).encode()).hexdigest()
        counts[kin] += 1
        result: dict[str, Any] = {
            "ruleId": printable(problem.code),
            "ruleIndex": rules.index(printable(problem.code)),
            "level": problem.level,
            "message": {"text": printable(problem.message)},
            "locations": [_location(problem)],
            "partialFingerprints": {"streamOfRule/v1": digest},
            "properties": {"check": printable(problem.check)},
        }
        if states_suppressions:
            result["suppressions"] = []
        if problem.waived is not None:
            waived = problem.waived
            justification = printable(f"{waived.reason} ({waived.owner}, until {waived.until})")
            result["suppressions"] = [{"kind": "external", "status": "accepted", "justification": justification}]
        results.append(result)
    return results


def _location(problem: Problem) -> dict[str, Any]:
    """Return the file, and the place in it as text.

    GitHub shows no result without a line. HDF5 has none, so every result stands in the first.
    """
    location: dict[str, Any] = {
        "physicalLocation": {
            "artifactLocation": {"uri": artifact_uri(problem.path)},
            "region": {"startLine": 1},
        }
    }
    if place(problem.where):
        location["logicalLocations"] = [{"fullyQualifiedName": printable(place(problem.where))}]
    return location
