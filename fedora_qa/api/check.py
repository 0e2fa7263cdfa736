"""Check files from Python, and read records of earlier runs."""

from dataclasses import fields, replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any

from fedora_qa.api.checked import CheckedRecord
from fedora_qa.cli.arrays import arrays_beside, read_arrays
from fedora_qa.cli.check import check_options
from fedora_qa.cli.check_all import Request, check_all, executor_for
from fedora_qa.cli.record import evidence_arrays, record_of
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.config import CheckConfig, read_config, with_options
from fedora_qa.errors import MisuseError
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.record.json_io import read_record as read_plain
from fedora_qa.record.types import Record

AnyPath = str | PathLike[str]


def check(
    *paths: AnyPath, config: AnyPath | None = None, evidence: bool = True, apart: bool = False, **options: Any
) -> CheckedRecord:
    """Check files as ``fedora-qa check`` does, and return the record of all of them.

    Parameters
    ----------
    paths
        HDF5 files, folders that are one sequence, and folders of these, each once.
    config
        A ``fedora-qa.toml`` whose options hold where none are given here.
    evidence
        Whether to keep images and series for the report.
    apart
        Whether to open files in another process even with a single job: for files from unknown sources, which may
        crash HDF5 or take for ever to open. Their checks are then ``crashed``, and the program continues.
    **options
        The keys of ``fedora-qa.toml``: ``effort="quick"``, ``select=["imu"]``, ``jobs=4``. With several jobs, or
        ``apart``, a script must guard its entry with ``if __name__ == "__main__"``, as multiprocessing requires.

    Raises
    ------
    MisuseError
        No such file, not HDF5 at all, or an option that does not exist or has an illegal value. Defects of a
        file raise nothing: they stand in the record.
    """
    files = [Path(path) for path in paths]
    if not files:
        raise MisuseError("Expected at least one file to check, got none")
    settings = with_options(read_config(Path(config)) if config else CheckConfig(), options)
    engine_options = replace(check_options(settings), evidence=EvidenceOptions() if evidence else None)
    # Before workers are started: a wrong path is a misuse of the call, not a finding.
    sequences = sequences_of(files, engine_options.dialect)
    started = datetime.now(UTC).isoformat(timespec="seconds")
    executor = executor_for(settings, in_process=not apart)
    # Read here, as ``check_all`` closes the executor.
    jobs = executor.capacity
    runs = check_all(sequences, Request(settings, engine_options, started), executor)
    return _with_arrays(record_of(runs, settings, started, {"jobs": jobs}), evidence_arrays(runs))


def read_record(path: AnyPath) -> CheckedRecord:
    """Read a record that ``fedora-qa check --json`` or ``save`` wrote, with the arrays beside it if they are there.

    Raises
    ------
    MisuseError
        There is no record, or its arrays are damaged.
    """
    record, beside = read_plain(Path(path)), arrays_beside(Path(path))
    return _with_arrays(record, read_arrays(beside) if beside.is_file() else {})


def _with_arrays(record: Record, arrays: dict[str, Any]) -> CheckedRecord:
    return CheckedRecord(**{field.name: getattr(record, field.name) for field in fields(record)}, arrays=arrays)
