"""Check files from Python, and read records of earlier runs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from fedora_qa.api.checked import CheckedRecord, with_arrays
from fedora_qa.api.options import AnyPath, folder_texts, path_text, settings_of
from fedora_qa.cli.arrays import arrays_beside, read_arrays
from fedora_qa.cli.check_all import Request, check_all, executor_for
from fedora_qa.cli.record import evidence_arrays, record_of
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.settings import check_options
from fedora_qa.engine.effort import Effort
from fedora_qa.errors import MisuseError
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.judgement.materiality import Profile
from fedora_qa.record.json_io import read_record as read_plain


def check(
    *paths: AnyPath,
    effort: Effort | None = None,
    select: Sequence[str] | None = None,
    ignore: Sequence[str] | None = None,
    dialect: AnyPath | None = None,
    metadata: AnyPath | None = None,
    profile: Profile | None = None,
    fail_on: Literal["failed", "warned"] | None = None,
    memory: str | None = None,
    false_alarm_rate: float | None = None,
    canary: bool | None = None,
    jobs: int | None = None,
    allow_external: Sequence[AnyPath] | None = None,
    required_coverage: Mapping[str, float] | None = None,
    config: AnyPath | None = None,
    evidence: bool = True,
    apart: bool = False,
) -> CheckedRecord:
    """Check files as ``fedora-qa check`` does, and return the record of all of them.

    An option that is None holds as ``config`` states it, and without one as its default.

    Parameters
    ----------
    paths
        HDF5 files, folders that are one sequence, and folders of these, each once.
    effort
        How much to look at: ``"quick"``, ``"standard"``, ``"full"`` (default) or ``"exhaustive"``.
    select, ignore
        Subjects or checks to run and to leave out, such as ``["clocks", "imu.noise"]``; default: all, and none.
    dialect
        How the files name and scale their data: a name, or a TOML file; default: as it is recognised.
    metadata
        A TOML file whose table ``[metadata]`` declares what the sequences do not declare; default: none.
    profile
        From which size a deviation matters: ``"release"`` (default) to publish the data, ``"training"`` to train on
        them, ``"strict"`` for any size.
    fail_on
        From which outcome on a command exits with 1: ``"failed"`` (default) or ``"warned"``. It is part of the
        configuration whose digest the record holds, and changes no verdict.
    memory
        Memory to aim at of all processes together, with its unit, such as ``"512MiB"``; default ``"1GB"``, 1e9 bytes.
    false_alarm_rate
        Probability, between 0 and 1, that a correct file fails, shared by all comparisons of the file; default 1e-4.
    canary
        Whether each check must detect a fault that is planted for it in memory; default False.
    jobs
        Files, and windows of a file, checked at once, each in a process of its own; default 1, in this process. With
        several, or ``apart``, a script must guard its entry with ``if __name__ == "__main__"``, as multiprocessing
        requires.
    allow_external
        Folders with other files that a file may link to, or consist of; default: none.
    required_coverage
        Least share, 0 to 1, of its stream that a subject or check must cover, by its name; default: none.
    config
        A ``fedora-qa.toml`` with these options; paths in it are relative to it.
    evidence
        Whether to keep images and series for the report.
    apart
        Whether to open files in another process even with a single job: for files from unknown sources, which may
        crash HDF5 or take for ever to open. Their checks are then ``crashed``, and the program continues.

    Returns
    -------
    CheckedRecord
        What was found of each file, with times in us on its own clock, and values in the units that stand beside them.

    Raises
    ------
    MisuseError
        No such file, not HDF5 at all, or an option with an illegal value. Defects of a file raise nothing: they stand
        in the record.
    """
    files = [Path(path) for path in paths]
    if not files:
        raise MisuseError("Expected at least one file to check, got none")
    options = {
        "effort": effort,
        "select": select,
        "ignore": ignore,
        "dialect": path_text(dialect),
        "metadata": path_text(metadata),
        "profile": profile,
        "fail_on": fail_on,
        "memory": memory,
        "false_alarm_rate": false_alarm_rate,
        "canary": canary,
        "jobs": jobs,
        "allow_external": folder_texts(allow_external),
        "required_coverage": required_coverage,
    }
    settings = settings_of(config, options)
    engine_options = replace(check_options(settings), evidence=EvidenceOptions() if evidence else None)
    # Before workers are started: a wrong path is a misuse of the call, not a finding.
    sequences = sequences_of(files, engine_options.dialect)
    started = datetime.now(UTC).isoformat(timespec="seconds")
    executor = executor_for(settings, in_process=not apart)
    # Read here, as ``check_all`` closes the executor.
    workers = executor.capacity
    runs = check_all(sequences, Request(settings, engine_options, started), executor)
    return with_arrays(record_of(runs, settings, started, {"jobs": workers}), evidence_arrays(runs))


def read_record(path: AnyPath) -> CheckedRecord:
    """Read a record that ``fedora-qa check --json`` or ``save`` wrote, with the arrays beside it if they are there.

    Raises
    ------
    MisuseError
        There is no record, or its arrays are damaged.
    """
    record, beside = read_plain(Path(path)), arrays_beside(Path(path))
    return with_arrays(record, read_arrays(beside) if beside.is_file() else {})
