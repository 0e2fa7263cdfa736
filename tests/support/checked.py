"""Run single checks on a file through the engine."""

from pathlib import Path
from unittest.mock import patch

from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.record.types import Diagnosis, FileRecord, Result


def measured_record(path: Path, *select: str) -> FileRecord:
    """Return the record of some checks, in which results and verdict are meant.

    No proposed fault is undone and no evidence is collected: both follow the results, and alter none.
    """
    with patch("fedora_qa.engine.composite_faults.run_trials", return_value={}):
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


def rules(result: Result) -> list[str]:
    """Return the rules that were broken, without the name of the check."""
    return [finding.code.removeprefix(f"{result.check}.") for finding in result.findings]
