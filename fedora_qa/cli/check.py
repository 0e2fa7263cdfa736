"""``fedora-qa check``: check files, write the requested outputs, and print a summary."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from click.shell_completion import CompletionItem

from fedora_qa.cli.exit_codes import exit_code
from fedora_qa.cli.options import (
    PATH,
    allow_external_option,
    config_option,
    detail_options,
    dialect_option,
    ignore_option,
    metadata_option,
    record_options,
    select_option,
)
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.record import evidence_arrays, record_of
from fedora_qa.cli.resume import resume_folder
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.startup import START_TIME, loading_modules
from fedora_qa.cli.summary import Detail, print_record
from fedora_qa.config import CheckConfig, read_config
from fedora_qa.engine.options import CheckOptions
from fedora_qa.errors import MisuseError
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.record.types import Record
from fedora_qa.storage.place import Place, place_of

if TYPE_CHECKING:  # the process that distributes the work loads no measuring code
    from fedora_qa.layout.dialect import DialectChoice

_SECONDS_PER_UNIT: Final[Mapping[str, float]] = {"s": 1.0, "m": 60.0, "h": 3600.0}


class PlaceParam(click.ParamType):  # type: ignore[type-arg]  # generic only from click 8.4 on
    """Turns an argument into a place; raises ``MisuseError`` for a URL that cannot be read."""

    name = "place"

    def convert(self, value: str | Place, param: click.Parameter | None, ctx: click.Context | None) -> Place:
        """Return the place that the argument names."""
        return place_of(value) if isinstance(value, str) else value

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Leave it to the shell to complete paths."""
        return [CompletionItem(incomplete, type="file")]


@dataclass(frozen=True, slots=True)
class Budget:
    """An amount of time, as it was given and in seconds."""

    text: str
    seconds: float


class BudgetParam(click.ParamType):  # type: ignore[type-arg]  # generic only from click 8.4 on
    """Turns an amount such as ``60s`` into a budget; raises ``MisuseError``."""

    name = "time"

    def convert(self, value: str | Budget, param: click.Parameter | None, ctx: click.Context | None) -> Budget:
        """Return the budget that the argument states."""
        return parse_budget(value) if isinstance(value, str) else value


@click.command()
@click.argument("files", nargs=-1, required=True, type=PlaceParam())
@click.option(
    "--effort",
    type=click.Choice(["quick", "standard", "full", "exhaustive"]),
    help="How much to look at; full unless configured otherwise.",
)
@click.option(
    "--budget",
    type=BudgetParam(),
    metavar="TIME",
    help="Look at as much as fits into a time such as 60s, 5m or 0.5h, in place of an effort.",
)
@select_option
@ignore_option
@config_option
@dialect_option
@metadata_option
@click.option(
    "--profile",
    type=click.Choice(["release", "training", "strict"]),
    help="From which size a deviation matters: to publish the data (default), to train on them, or any size.",
)
@click.option("--fail-on", type=click.Choice(["failed", "warned"]), help="From which outcome on to exit with 1.")
@click.option(
    "--memory",
    metavar="AMOUNT",
    help="Memory to aim at, such as 1GB, of all processes together; a peak may exceed it.",
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    help="Files, and windows of a file, checked at once; 1 unless configured otherwise. They share the memory.",
)
@click.option("--dask", metavar="ADDRESS", help="Do the work on a Dask cluster, such as tcp://host:8786.")
@click.option(
    "--resume",
    type=PATH,
    metavar="DIR",
    help="Keep the result of each file in DIR, and check only files without one. Made where it is missing.",
)
@click.option(
    "--canary",
    is_flag=True,
    default=None,
    help="Plant a fault for each check, in memory: a check that does not detect its own is reported as crashed.",
)
@allow_external_option
@detail_options
@record_options
def check(
    files: tuple[Place, ...],
    config: Path | None,
    dask: str | None,
    resume: Path | None,
    budget: Budget | None,
    outputs: Outputs,
    detail: Detail,
    **overrides: Any,
) -> int:
    """Check FILES, or folders of them: recompute what must hold between their streams, and report what does not.

    Exit codes: 0 clean; 1 findings at or above --fail-on; 2 misuse; 3 incomplete. With several, 2 before 3 before 1.
    """
    with loading_modules():
        from fedora_qa.cli.check_all import Request, check_all, executor_for  # noqa: PLC0415 - loads what measures

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
    started = datetime.now(UTC).isoformat(timespec="seconds")
    stored = resume_folder(resume, settings, options) if resume else None
    executor = executor_for(settings, dask)
    # Read before the executor is closed: afterwards a cluster has no workers to count.
    jobs = executor.capacity
    began = click.get_current_context().meta.get(START_TIME)
    runs = check_all(files, Request(settings, options, started, stored, began), executor)
    workers = {"peak_worker_memory_mib": executor.peak_memory_mib} if executor.peak_memory_mib else {}
    record = record_of(runs, settings, started, {"jobs": jobs, **workers})
    record = with_budget(record, budget) if budget else record
    outputs.write(record, evidence_arrays(runs))
    print_record(record, github=outputs.github, detail=detail)
    return exit_code(record.files, settings.fail_on)


def settings_from(config: Path | None, overrides: dict[str, Any]) -> CheckConfig:
    """Return the configuration with the options of the command line in its place."""
    settings = read_config(config) if config else CheckConfig()
    # An option that was not given must not override the file; click states that by None, or () if it may be repeated.
    return replace(settings, **{name: value for name, value in overrides.items() if value not in {None, ()}})


def check_options(settings: CheckConfig) -> CheckOptions:
    """Return the engine's options; raises ``MisuseError`` for a check, dialect or amount that does not exist."""
    if settings.required_coverage or settings.select or settings.ignore:
        # Raises ``MisuseError`` where a name matches no check, or no check is left to run.
        from fedora_qa.engine.run import select_checks  # noqa: PLC0415 - loads every check

        # The same names as in `select` are legal here; one that is misspelt would otherwise require nothing.
        select_checks(tuple(settings.required_coverage), ())
        if not select_checks(settings.select, settings.ignore):
            raise MisuseError(
                "Expected at least one check to run, got a selection that leaves none; see `fedora-qa checks`"
            )
    return CheckOptions(
        effort=settings.effort,
        select=settings.select,
        ignore=settings.ignore,
        dialect=dialect_choice(settings.dialect, settings.metadata),
        memory_bytes=settings.memory_bytes,
        false_alarm_rate=settings.false_alarm_rate,
        profile=settings.profile,
        canary=settings.canary,
        allow_external=external_folders(settings.allow_external),
    )


def dialect_choice(dialect: str | None, metadata: str | None) -> "DialectChoice":
    """Return how sequences are read, by the names of a dialect and of a file of metadata; raises ``MisuseError``."""
    if not dialect and not metadata:
        return None
    from fedora_qa.layout.dialect import load_choice  # noqa: PLC0415 - loads HDF5

    return load_choice(dialect, metadata)


def external_folders(names: tuple[str, ...]) -> tuple[Path, ...]:
    """Return folders in which other files may be read; raises ``MisuseError`` where one does not exist."""
    # Absolute, because workers may have another working directory.
    folders = tuple(Path(name).absolute() for name in names)
    for folder in folders:
        if not folder.is_dir():
            raise MisuseError(f"Expected a folder in which other files may be read, got {folder}")
    return folders


def parse_budget(text: str) -> Budget:
    """Return an amount of time such as ``60s``, ``5m`` or ``0.5h``; raises ``MisuseError``."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([smh])\s*", text.lower())
    seconds = float(match[1]) * _SECONDS_PER_UNIT[match[2]] if match else 0.0
    # 0s is refused like text that does not match: no window fits into it.
    if seconds <= 0:
        raise MisuseError(f"Expected a time with a unit, such as 60s, 5m or 0.5h, got {text!r}")
    return Budget(text.strip(), seconds)


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
