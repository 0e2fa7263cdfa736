"""``fedora-qa check``: check files, store each run when it is complete, write outputs, print a summary."""

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Future, as_completed
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import click

from fedora_qa.check_names import selected_explanations, subject_of
from fedora_qa.cli.arrays import ArrayStore
from fedora_qa.cli.exit_codes import exit_code
from fedora_qa.cli.host import usable_cores
from fedora_qa.cli.options import Budget
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.progress import files_progress, progress_bar
from fedora_qa.cli.record import evidence_arrays, record_of
from fedora_qa.cli.resume import ResumeFolder, resume_folder
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.settings import check_options, settings_from, with_jobs
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE, START_TIME
from fedora_qa.cli.summary import Detail, print_record
from fedora_qa.config import LEAST_MEMORY_BYTES, CheckConfig
from fedora_qa.engine.compilation.kernel_groups import KernelGroup, listed_groups
from fedora_qa.engine.executors.cluster import DaskExecutor
from fedora_qa.engine.executors.executor import COMPILE_GROUP, UNCOMPILED, Executor, InProcess, Task, opening_test
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.files import check_files
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import quiet
from fedora_qa.errors import FedoraError, MisuseError
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.judgement.verdict import with_required_coverage
from fedora_qa.record.types import FileRecord, Record, Result
from fedora_qa.storage.folder import Version, local_version
from fedora_qa.storage.place import Place, RemoteFile

COMPILING: Final = "compiling for this machine, once"

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


def run_check(
    files: tuple[Place, ...],
    config: Path | None,
    dask: str | None,
    resume: Path | None,
    budget: Budget | None,
    outputs: Outputs,
    detail: Detail,
    **overrides: Any,
) -> int:
    """Run the command and return its exit code."""
    settings = settings_from(config, overrides)
    # An effort from the command line contradicts a budget; one in the configuration file is overridden by it.
    _require_budget_alone(budget, overrides["effort"], settings)
    if dask and overrides["jobs"]:
        raise MisuseError("Expected either --jobs or --dask, got both")
    options = replace(check_options(settings), evidence=EvidenceOptions() if outputs.show_evidence else None)
    options = replace(options, budget_s=budget.seconds if budget else None)
    # Misuse is reported before hours of measuring, not after them.
    files = sequences_of(files, options.dialect)
    outputs.require_writable([file for file in files if isinstance(file, Path)])
    # A cluster has workers of its own, and the memory is that of one.
    settings = replace(settings, jobs=None) if dask else with_jobs(settings, files)
    options = replace(options, memory_bytes=settings.memory_bytes)
    started = datetime.now(UTC).isoformat(timespec="seconds")
    stored = resume_folder(resume, settings, options) if resume else None
    executor = executor_for(settings, dask)
    # Read before the executor is closed: afterwards a cluster has no workers to count.
    jobs = executor.capacity
    began = click.get_current_context().meta.get(START_TIME)
    aside = ArrayStore() if len(files) > 1 else None
    runs = check_all(files, Request(settings, options, started, stored, began, aside), executor)
    workers = {"peak_worker_memory_mib": executor.peak_memory_mib} if executor.peak_memory_mib else {}
    record = record_of(runs, settings, started, {"jobs": jobs, **workers})
    record = _with_budget(record, budget) if budget else record
    outputs.write(record, evidence_arrays(runs))
    print_record(record, outputs, detail)
    return exit_code(record.files, settings.fail_on)


def _require_budget_alone(budget: Budget | None, effort: str | None, settings: CheckConfig) -> None:
    """Raise ``MisuseError`` where a budget is combined with an effort or with canaries."""
    if budget and effort:
        raise MisuseError("Expected either --effort or --budget, got both")
    if budget and settings.canary:
        raise MisuseError(
            "Expected no canaries with --budget, got both; leave one out, as the time of canaries is unknown"
        )


def _with_budget(record: Record, budget: Budget) -> Record:
    """Return the record with the budget among the facts of its run; results depend on it and on the machine."""
    # In `run`, which a comparison of two records leaves out: the reach of a budget depends on the machine.
    host = {**record.run.host, "budget_s": budget.seconds}
    return replace(record, run=replace(record.run, host=host), effort=f"budget {budget.text}")


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
    versions = {path: _local_version_of(path) for path in missing}
    try:
        with executor:
            if missing:
                options = request.options
                selected = selected_explanations(options.select, options.ignore)
                tests = (opening_test(path, options.dialect, options.allow_external) for path in missing)
                compile_for(frozenset(subject_of(each.check) for each in selected), executor, tests)
            with files_progress(file_count=len(runs)) as report:
                for path, run in check_files(missing, request.options, executor, report, request.began):
                    record = _incomplete_if_changed(run.record, path, versions[path])
                    runs[path] = put_aside(replace(run, record=with_required_coverage(record, required)))
                    # The record of an unchanged file is the same object; the run of a changed file is not stored.
                    if stored and record is run.record:
                        stored_runs[path].store(runs[path], request.started)
    except KeyboardInterrupt:
        if stored:
            click.echo(f"fedora-qa: {len(runs)} of {len(files)} files are done, and kept in {stored.path}", err=True)
        raise
    return [runs[path] for path in files]


def _local_version_of(place: Place) -> Version | None:
    """Return the version of a local file; None behind a URL, where reading detects a change."""
    return None if isinstance(place, RemoteFile) else local_version(place)


def _incomplete_if_changed(file: FileRecord, place: Place, before: Version | None) -> FileRecord:
    """Return the record, incomplete if the size or the time of the last change of its file differs now.

    A record and its digest belong to one content; data read partly before and partly after a change belong to none.
    """
    if _local_version_of(place) == before:
        return file
    reason = "Expected the file to stay as it is while it is checked, got a change; check it again"
    # As a crashed result every format shows it, with the exit code of an incomplete run.
    return replace(
        file,
        verdict="incomplete",
        results=(*file.results, Result(_UNCHANGED, "crashed", _UNCHANGED_QUESTION, reason=reason)),
    )


def compile_for(
    subjects: frozenset[str],
    executor: Executor,
    tests: Iterable[Task | None],
    groups: Sequence[KernelGroup] | None = None,
) -> Sequence[KernelGroup]:
    """Compile what checks of some subjects call and this machine has not compiled yet; return those groups.

    Parameters
    ----------
    executor
        Does the checks. Only processes of this machine find later what is compiled here; others compile as they call.
    tests
        Whether each file opens (``opening_test``): where none does, nothing is compiled.
    groups
        In place of those that the package lists.
    """
    if not isinstance(executor, ProcessExecutor):
        return ()
    listed = listed_groups() if groups is None else groups
    try:
        # In a worker: the process of the command loads no measuring code.
        missing: Sequence[KernelGroup] = executor.submit(Task(UNCOMPILED, (subjects, listed)), quiet).result()
    except FedoraError:
        return ()
    if not missing or not any(_opens(test, executor) for test in tests):
        return ()
    click.echo(f"fedora-qa: {COMPILING}", err=True)
    with ProcessExecutor(usable_cores()) as compilers, progress_bar(COMPILING) as report:
        futures: list[Future[Any]] = [compilers.submit(Task(COMPILE_GROUP, (group,)), quiet) for group in missing]
        for done, future in enumerate(as_completed(futures), start=1):
            # A process that died leaves its group to the check that needs it.
            with suppress(FedoraError):
                future.result()
            report("", done, len(futures))
    return missing


def _opens(test: Task | None, executor: Executor) -> bool:
    """Return whether a file opens; a file without a test, behind a URL, counts as one that does."""
    if test is None:
        return True
    try:
        return bool(executor.submit(test, quiet).result())
    except (FedoraError, OSError):
        return False
