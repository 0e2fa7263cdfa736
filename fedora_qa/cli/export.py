"""``fedora-qa export``: a sequence in a layout of others."""

from pathlib import Path

import click

from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.progress import progress_bar
from fedora_qa.engine.executor import Task
from fedora_qa.engine.worker import Worker
from fedora_qa.errors import MisuseError
from fedora_qa.exporting.run import ExportForm, export_sequence
from fedora_qa.layout.dialect import DialectChoice, load_choice
from fedora_qa.record.wording import unobeyed


def run_export(source: Path, output: Path, form: ExportForm, dialect: str | None, metadata: str | None) -> int:
    """Do what the command says and return its exit code."""
    if output.exists() or output.is_symlink():
        raise MisuseError(f"Expected a new output, got {output}, which exists; remove it, or choose another name")
    if not output.parent.is_dir():
        raise MisuseError(f"Expected the folder of {output} to exist; make it first")
    if source.is_dir() and output.resolve().is_relative_to(source.resolve()):
        raise MisuseError(f"Expected an output outside of {source}, which is read, got {output}")
    choice = load_choice(dialect, metadata)
    with progress_bar(source.name) as bar:
        rows: dict[str, int] = run_isolated(Task(_export, (source, output, form, choice)), source, None, bar)
    counted = ", ".join(f"{stream} {count}" for stream, count in rows.items())
    click.echo(unobeyed(f"{output} is written; rows: {counted}."))
    return CLEAN


def _export(source: Path, output: Path, form: ExportForm, dialect: DialectChoice, worker: Worker) -> dict[str, int]:
    return export_sequence(source, output, form, dialect, worker.progress)
