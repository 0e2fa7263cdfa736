"""Run single checks on a file through the engine."""

from pathlib import Path

from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.record.types import Diagnosis, Result


def run_check(path: Path, name: str) -> Result:
    """Return the result of one check; one that crashed shows its traceback."""
    (result,) = check_file(path, CheckOptions(select=(name,))).record.results
    if result.outcome == "crashed":
        raise RuntimeError(result.traceback)
    return result


def diagnoses_of(path: Path, subject: str) -> list[Diagnosis]:
    """Return the diagnoses from the checks of one subject."""
    return list(check_file(path, CheckOptions(select=(subject,))).record.diagnoses)


def rules(result: Result) -> list[str]:
    """Return the rules that were broken, without the name of the check."""
    return [finding.code.removeprefix(f"{result.check}.") for finding in result.findings]
