"""``fedora-qa repair``: a copy of a file in which confirmed, mechanical faults are undone."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from fedora_qa.cli.exit_codes import CLEAN, FINDINGS
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.outputs import require_new_file
from fedora_qa.cli.progress import progress_bar
from fedora_qa.cli.sequences import require_one_sequence
from fedora_qa.cli.settings import check_options, settings_from
from fedora_qa.engine.executors.executor import Task, Worker, opening_test
from fedora_qa.engine.options import CheckOptions
from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import staging_path
from fedora_qa.record.wording import cause_sentence, unobeyed
from fedora_qa.repairs.repair import repair as repair_file
from fedora_qa.repairs.result import Repair
from fedora_qa.storage.place import Place, RemoteFile

_BESIDE_SHOWN = 5


def run_repair(
    file: Place,
    output: Path | None,
    dry_run: bool,
    only: tuple[str, ...],
    config: Path | None,
    force: bool,
    **overrides: Any,
) -> int:
    """Run the command and return its exit code."""
    if isinstance(file, RemoteFile):
        raise MisuseError(f"Expected a file on this machine, got {file}; copy it first")
    if output is None and not dry_run:
        raise MisuseError("Expected -o OUT, the file to write, or --dry-run, got neither")
    settings = settings_from(config, overrides)
    require_writable(file, output, config, settings.metadata, force=force)
    options = check_options(settings)
    require_one_sequence(file, options.dialect)
    named = tuple(name.strip() for names in only for name in names.split(",") if name.strip())
    opening = opening_test(file, options.dialect, options.allow_external)
    with progress_bar(file.name) as bar:
        if output is None or dry_run:
            result = run_isolated(Task(_repair, (file, None, options, named)), file, opening, bar)
        else:
            with staging_path(output) as written:
                result = run_isolated(Task(_repair, (file, written, options, named)), file, opening, bar)
                if not result.refusal:
                    written.replace(output)
    for line in repair_lines(result, None if dry_run else output):
        click.echo(unobeyed(line))
    return FINDINGS if result.refusal else CLEAN


def require_writable(
    file: Path, output: Path | None, config: Path | None, metadata: str | None, *, force: bool
) -> None:
    """Raise ``MisuseError`` where the output is an input under any name, exists, or cannot be written."""
    if output is not None:
        inputs = [file, *(Path(each) for each in (config, metadata) if each)]
        require_new_file(output, inputs, force=force, remedy="use --force to write over it, or force=True")


def repair_lines(result: Repair, output: Path | None) -> Iterator[str]:
    """Yield what was done, or with no output what would be, in sentences."""
    for step in result.steps:
        yield f"{step.diagnosis.id}  {cause_sentence(step.diagnosis)}  ({step.diagnosis.status})"
        yield f"    {step.done}"
    for each in result.datasets:
        removed = f", {each.removed} removed" if each.removed else ""
        yield f"    {each.path}: {each.rows} rows altered{removed}"
    for attribute in result.attributes:
        yield f"    {attribute}"
    for left in result.omissions:
        yield f"{left.diagnosis.id}  {cause_sentence(left.diagnosis)}  ({left.diagnosis.status}): left as it is"
        yield f"    {left.reason}"
    if result.beside and result.datasets:
        more = f" and {len(result.beside) - _BESIDE_SHOWN} more" if len(result.beside) > _BESIDE_SHOWN else ""
        names = ", ".join(result.beside[:_BESIDE_SHOWN])
        yield f"Not in the dialect, and left as they are, although they may refer to what is altered: {names}{more}"
    if result.refusal:
        yield f"Nothing is written: {result.refusal}"
    elif output is None:
        yield "Nothing is written: this is what would be done."
    else:
        yield f"{output} is written, and was checked: what is repaired is gone, and nothing is new."


def _repair(file: Path, output: Path | None, options: CheckOptions, only: tuple[str, ...], worker: Worker) -> Repair:
    return repair_file(file, output, options, worker.progress, only=only)
