"""Run single checks on a file through the engine."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from fedora_qa.causes import stream_family
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import Diagnosis, FileRecord, Result
from tests.support.all_checks import CHECKS


def without_trials() -> AbstractContextManager[Any]:
    """Undo no proposed fault, which follows the results and alters none."""
    return patch("fedora_qa.engine.trials.composite_faults.run_trials", return_value={})


def measured_record(path: Path, *select: str) -> FileRecord:
    """Return the record of some checks, in which results and verdict are meant.

    No proposed fault is undone and no evidence is collected: both follow the results, and alter none.
    """
    with without_trials():
        return check_file(path, CheckOptions(select=select, evidence=None)).record


def run_check(path: Path, name: str) -> Result:
    """Return the result of one check; one that crashed shows its traceback."""
    (result,) = measured_record(path, name).results
    if result.outcome == "crashed":
        raise RuntimeError(result.traceback)
    return result


def diagnoses_of(path: Path, subject: str) -> list[Diagnosis]:
    """Return the diagnoses from the checks of one subject."""
    return list(check_file(path, CheckOptions(select=(subject,), evidence=None)).record.diagnoses)


def diagnosed(path: Path, name: str) -> tuple[Result, list[Diagnosis]]:
    """Check the whole subject of a check, once: the result of the check, and the diagnoses from the subject."""
    record = check_file(path, CheckOptions(select=(name.split(".", maxsplit=1)[0],), evidence=None)).record
    (result,) = (result for result in record.results if result.check == name)
    if result.outcome == "crashed":
        raise RuntimeError(result.traceback)
    return result, list(record.diagnoses)


def rules(result: Result) -> list[str]:
    """Return the rules that were broken, without the name of the check."""
    return [finding.code.removeprefix(f"{result.check}.") for finding in result.findings]


def checks_that_read(*streams: str) -> tuple[str, ...]:
    """Return the checks that a fault of some streams can alter: of these streams, of all that is there, or of both.

    The others measure what they measure of the clean file. A fault of declarations can alter every check.
    """
    faulty = {stream_family(stream) for stream in streams}
    return tuple(
        check.name
        for check in CHECKS
        if "metadata" in faulty
        or not check.needs
        or not faulty.isdisjoint(map(stream_family, (*check.needs, *check.looks_at)))
    )
