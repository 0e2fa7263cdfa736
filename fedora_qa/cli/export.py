"""``fedora-qa export``: a sequence in a layout of others."""

import os
from pathlib import Path
from typing import Literal

import click
import h5py

from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.progress import progress_bar
from fedora_qa.cli.sequences import require_one_sequence
from fedora_qa.engine.executors.executor import Task, Worker, opening_test
from fedora_qa.errors import MisuseError, UnreadableRowsError, UnrecognisedError
from fedora_qa.exporting.dsec import write_dsec
from fedora_qa.exporting.tum import write_tum
from fedora_qa.layout.create import DeferredErrorFile
from fedora_qa.layout.dialect import DialectChoice, load_choice
from fedora_qa.record.atomic import replacing
from fedora_qa.record.json_io import read_record
from fedora_qa.record.types import FileRecord
from fedora_qa.record.wording import not_recognised, unobeyed
from fedora_qa.sequence.canonical_copy import write_canonical
from fedora_qa.sequence.sequence import Sequence, open_sequence
from fedora_qa.storage.folder import is_folder, root_of

Form = Literal["tum", "dsec", "fedora", "rerun"]


def run_export(
    source: Path, output: Path, form: Form, record_path: Path | None, dialect: str | None, metadata: str | None
) -> int:
    """Run the command and return its exit code."""
    if record_path is not None and form != "rerun":
        raise MisuseError(f"Expected --record with --to rerun, got it with --to {form}; leave it out")
    record = None if record_path is None else _record_of(source, record_path)
    if output.exists() or output.is_symlink():
        raise MisuseError(f"Expected a new output, got {output}, which exists; remove it, or choose another name")
    if not output.parent.is_dir():
        raise MisuseError(f"Expected the folder of {output} to exist; make it first")
    if not os.access(output.parent, os.W_OK):
        raise MisuseError(f"Expected the folder of {output} to be writable")
    if is_folder(source) and output.resolve().is_relative_to(root_of(source).resolve()):
        raise MisuseError(f"Expected an output outside of {source}, which is read, got {output}")
    choice = load_choice(dialect, metadata)
    require_one_sequence(source, choice)
    with progress_bar(source.name) as bar:
        rows, beside = run_isolated(
            Task(_export, (source, output, form, record, choice)), source, opening_test(source, choice), bar
        )
    counted = ", ".join(f"{stream} {count}" for stream, count in rows.items())
    click.echo(unobeyed(f"{output} is written; rows: {counted}."))
    for line in beside:
        click.echo(unobeyed(f"    {line}"))
    return CLEAN


def _export(
    source: Path, output: Path, form: Form, record: FileRecord | None, dialect: DialectChoice, worker: Worker
) -> tuple[dict[str, int], tuple[str, ...]]:
    """Write a sequence in the layout of a name; return the number of rows by stream, and what has no place there."""
    try:
        with open_sequence(source, dialect) as sequence:
            if not sequence.layout.is_recognised:
                raise UnrecognisedError(not_recognised(source))
            if form == "tum":
                return write_tum(sequence, output), ()
            if form == "dsec":
                return write_dsec(sequence, output, worker.progress), ()
            if form == "rerun":
                return _write_rerun(sequence, output, record, worker)
            with replacing(output) as temporary, DeferredErrorFile(temporary, "the sequence") as handle:
                with h5py.File(handle, "w") as file:
                    written = write_canonical(sequence, file, worker.progress)
                handle.raise_failure()
            lines = [f"{key} is left out: {reason}" for key, reason in written.left_out.items()]
            if written.beside:
                lines.append(f"The layout has no place for {written.beside.name}: declare it with --metadata.")
            return written.rows, tuple(lines)
    except UnreadableRowsError as error:
        raise MisuseError(f"{error}: {source}; check the file first, and repair it or cut out a part") from error


def _write_rerun(
    sequence: Sequence, output: Path, record: FileRecord | None, worker: Worker
) -> tuple[dict[str, int], tuple[str, ...]]:
    try:
        from fedora_qa.exporting.rerun_recording import write_rerun  # noqa: PLC0415 - an extra
    except ImportError as missing:
        raise MisuseError(
            f"Expected what writes for Rerun, got: {missing}; install it with pip install 'fedora-qa[rerun]'"
        ) from None
    return write_rerun(sequence, output, record, worker.progress)


def _record_of(source: Path, record_path: Path) -> FileRecord:
    """Return what a record has of a sequence.

    Raises
    ------
    MisuseError
        There is no record, or the sequence is not in it.
    """
    files = read_record(record_path).files
    for file in files:
        if Path(file.path).name == source.name:
            return file
    checked = ", ".join(Path(file.path).name for file in files) or "none"
    raise MisuseError(f"Expected {source.name} in {record_path}, got {checked}; check it with --json first")
