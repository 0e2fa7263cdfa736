"""``fedora-qa check``: check files, write the requested outputs, and print a summary."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from fedora_qa.cli.array_store import ArrayStore
from fedora_qa.cli.check_all import Request, check_all, executor_for
from fedora_qa.cli.exit_codes import exit_code
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.parameters import Budget
from fedora_qa.cli.record import evidence_arrays, record_of
from fedora_qa.cli.resume import resume_folder
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.settings import check_options, settings_from, with_jobs
from fedora_qa.cli.startup import START_TIME
from fedora_qa.cli.summary import Detail, print_record
from fedora_qa.config import CheckConfig
from fedora_qa.errors import MisuseError
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.record.types import Record
from fedora_qa.storage.place import Place


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
    require_budget_alone(budget, overrides["effort"], settings)
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
    record = with_budget(record, budget) if budget else record
    outputs.write(record, evidence_arrays(runs))
    print_record(record, outputs, detail)
    return exit_code(record.files, settings.fail_on)


def require_budget_alone(budget: Budget | None, effort: str | None, settings: CheckConfig) -> None:
    """Raise ``MisuseError`` where a budget is combined with an effort or with canaries."""
    if budget and effort:
        raise MisuseError("Expected either --effort or --budget, got both")
    if budget and settings.canary:
        raise MisuseError(
            "Expected no canaries with --budget, got both; leave one out, as the time of canaries is unknown"
        )


def with_budget(record: Record, budget: Budget) -> Record:
    """Return the record with the budget among the facts of its run; results depend on it and on the machine."""
    # In `run`, which a comparison of two records leaves out: the reach of a budget depends on the machine.
    host = {**record.run.host, "budget_s": budget.seconds}
    return replace(record, run=replace(record.run, host=host), effort=f"budget {budget.text}")
