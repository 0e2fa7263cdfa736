"""``fedora-qa export``: a sequence in a layout of others."""

from pathlib import Path

import click

from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.options import PATH, dialect_option, metadata_option
from fedora_qa.cli.progress import progress_bar
from fedora_qa.engine.executor import Task
from fedora_qa.engine.worker import Worker
from fedora_qa.errors import MisuseError
from fedora_qa.exporting.run import ExportForm, export_sequence
from fedora_qa.layout.dialect import DialectChoice, load_choice
from fedora_qa.record.wording import unobeyed


@click.command("export")
@click.argument("source", type=PATH)
@click.argument("output", type=PATH)
@click.option(
    "--to", "form", type=click.Choice(["tum", "dsec"]), required=True, help="tum: a text of poses; dsec: a folder."
)
@dialect_option
@metadata_option
def export(source: Path, output: Path, form: ExportForm, dialect: str | None, metadata: str | None) -> int:
    """Write SOURCE, a file or folder, in a layout of others to OUTPUT.

    tum writes the poses of the body in the world. dsec writes events, images, flow of 10 Hz, and the calibration of
    pinhole cameras; depth, IMU, poses and other flow have no place there. OUTPUT gets its name when it is complete.

    Exit codes: 0 written; 2 SOURCE cannot be read, or OUTPUT not be written, and nothing is left behind.
    """
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
