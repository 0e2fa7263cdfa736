"""Whatever a record holds, every format tells its verdict, and the exit code with it."""

import csv
import io
import json
from collections.abc import Mapping

from hypothesis import given
from junitparser import JUnitXml

from fedora_qa.cli.exit_codes import exit_code
from fedora_qa.record.ci import record_to_badge, record_to_github, record_to_junit
from fedora_qa.record.json_io import record_to_json
from fedora_qa.record.sarif import record_to_sarif
from fedora_qa.record.tables import record_to_csv
from fedora_qa.record.types import Record
from tests.support.random_records import records, unhurried

CODES = {"clean": 0, "findings": 1, "incomplete": 3}
GRAVEST_FIRST = ("incomplete", "findings", "clean")


def code_of(verdicts: Mapping[str, bool]) -> int:
    """The exit code of the gravest verdict that holds."""
    return next(CODES[verdict] for verdict in GRAVEST_FIRST if verdicts.get(verdict, verdict == "clean"))


def told_by_json(record: Record) -> int:
    verdicts = {file["verdict"] for file in json.loads(record_to_json(record))["files"]}
    return code_of(dict.fromkeys(verdicts, True))


def told_by_junit(record: Record) -> int:
    suites = JUnitXml.fromstring(record_to_junit(record).encode())
    return code_of({"incomplete": suites.errors > 0, "findings": suites.failures > 0})


def told_by_sarif(record: Record) -> int:
    (run,) = json.loads(record_to_sarif(record, {}))["runs"]
    found = any(result["level"] == "error" for result in run["results"])
    return code_of({"incomplete": not run["invocations"][0]["executionSuccessful"], "findings": found})


def told_by_github(record: Record) -> int:
    lines = [line for line in record_to_github(record).splitlines() if line.startswith("::error ")]
    incomplete = any(",title=incomplete::" in line for line in lines)
    return code_of({"incomplete": incomplete, "findings": bool(lines)})


def told_by_csv(record: Record) -> int:
    rows = csv.DictReader(io.StringIO(record_to_csv(record)["files.csv"]))
    return code_of(dict.fromkeys((row["verdict"] for row in rows), True))


def told_by_badge(record: Record) -> int:
    return CODES[json.loads(record_to_badge(record))["message"]]


TELLERS = (told_by_json, told_by_junit, told_by_sarif, told_by_github, told_by_csv, told_by_badge)


@unhurried
@given(records())
def test_one_verdict(record: Record) -> None:
    """JSON, JUnit, SARIF, annotations, CSV and badge tell the verdict that the exit code tells."""
    told = {tell(record) for tell in TELLERS}
    assert told == {exit_code(record.files, "failed")}
