"""Check files with the executor of the settings, and store each run as soon as it is complete."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import click

from fedora_qa.check_names import selected_explanations
from fedora_qa.cli.array_store import ArrayStore
from fedora_qa.cli.compiling import compile_for
from fedora_qa.cli.host import usable_cores
from fedora_qa.cli.progress import files_progress
from fedora_qa.cli.resume import ResumeFolder
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from fedora_qa.config import LEAST_MEMORY_BYTES, CheckConfig
from fedora_qa.engine.cluster import DaskExecutor
from fedora_qa.engine.executor import Executor, InProcess
from fedora_qa.engine.files import check_files
from fedora_qa.engine.opening import opening_test
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.processes import ProcessExecutor
from fedora_qa.errors import MisuseError
from fedora_qa.judgement.verdict import with_required_coverage
from fedora_qa.record.types import FileRecord, Result
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.version import Version, local_version
from fedora_qa.subjects import subject_of

_UNCHANGED: Final = "unchanged"
_UNCHANGED_QUESTION: Final = "Did the file stay as it was while it was checked?"


@dataclass(frozen=True, slots=True)
class Request:
    """How files are to be checked.

    Attributes
    ----------
    stored
        Where runs are stored for another command; None: nowhere.
    began
        Start of the command, s on ``time.monotonic``, for a budget.
    aside
        Where evidence is put while other files are checked; None: it stays in memory.
    """

    settings: CheckConfig
    options: CheckOptions
    started: str
    stored: ResumeFolder | None = None
    began: float | None = None
    aside: ArrayStore | None = None


def executor_for(settings: CheckConfig, dask: str | None = None, *, in_process: bool = False) -> Executor:
    """Return the executor of the tasks: as many processes as the settings state, or a cluster at an address.

    Even a single job opens and measures files in another process: a file that crashes HDF5 does not end the command.

    Parameters
    ----------
    in_process
        Whether a single job runs in this process: it starts sooner, and can be debugged.

    Raises
    ------
    MisuseError
        The memory is too little for the number of jobs, or there is no such cluster.
    """
    if dask is not None:
        return DaskExecutor(dask)
    jobs = settings.jobs or 1
    if jobs == 1 and (in_process or os.environ.get(IN_PROCESS_VARIABLE)):
        return InProcess()
    # A single job has the least memory by `parse_bytes`; here the share of each of several is tested.
    if jobs > 1 and settings.memory_bytes // jobs < LEAST_MEMORY_BYTES:
        least = f"{jobs * LEAST_MEMORY_BYTES >> 20}MiB"
        raise MisuseError(f"Expected memory of at least {least} for {jobs} jobs, got {settings.memory}; use fewer jobs")
    # Jobs times threads stays within the cores; more threads than cores slow each other down.
    return ProcessExecutor(jobs, threads=max(1, usable_cores() // jobs))


def check_all(files: Sequence[Place], request: Request, executor: Executor) -> list[FileRun]:
    """Check the files except those whose run is stored, and return the runs of all files in their order."""
    stored, required, aside = request.stored, request.settings.required_coverage, request.aside

    def put_aside(run: FileRun) -> FileRun:
        return replace(run, arrays=aside.put(run.arrays)) if aside else run

    stored_runs = {path: stored.stored_run(path) for path in files} if stored else {}
    runs = {path: put_aside(run) for path, stored_run in stored_runs.items() if (run := stored_run.load()) is not None}
    missing = [path for path in files if path not in runs]
    # All versions before any reading: a file that changes while others are checked is detected as well.
    versions = {path: local_version_of(path) for path in missing}
    try:
        with executor:
            if missing:
                options = request.options
                selected = selected_explanations(options.select, options.ignore)
                tests = (opening_test(path, options.dialect, options.allow_external) for path in missing)
                compile_for(frozenset(subject_of(each.check) for each in selected), executor, tests)
            with files_progress(file_count=len(runs)) as report:
                for path, run in check_files(missing, request.options, executor, report, request.began):
                    record = incomplete_if_changed(run.record, path, versions[path])
                    runs[path] = put_aside(replace(run, record=with_required_coverage(record, required)))
                    # The record of an unchanged file is the same object; the run of a changed file is not stored.
                    if stored and record is run.record:
                        stored_runs[path].store(runs[path], request.started)
    except KeyboardInterrupt:
        if stored:
            click.echo(f"fedora-qa: {len(runs)} of {len(files)} files are done, and kept in {stored.path}", err=True)
        raise
    return [runs[path] for path in files]


def local_version_of(place: Place) -> Version | None:
    """Return the version of a local file; None behind a URL, where reading detects a change."""
    return None if isinstance(place, RemoteFile) else local_version(place)


def incomplete_if_changed(file: FileRecord, place: Place, before: Version | None) -> FileRecord:
    """Return the record, incomplete if the size or the time of the last change of its file differs now.

    A record and its digest belong to one content; data read partly before and partly after a change belong to none.
    """
    if local_version_of(place) == before:
        return file
    reason = "Expected the file to stay as it is while it is checked, got a change; check it again"
    # As a crashed result every format shows it, with the exit code of an incomplete run.
    return replace(
        file,
        verdict="incomplete",
        results=(*file.results, Result(_UNCHANGED, "crashed", _UNCHANGED_QUESTION, reason=reason)),
    )
