"""``fedora-qa layout``: the streams of a file, their places, and what was inferred."""

import tomllib
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from shlex import quote
from typing import Final

import h5py
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from fedora_qa.cli.console import stdout_console, text
from fedora_qa.cli.isolated import run_isolated_light
from fedora_qa.cli.outputs import require_new_file
from fedora_qa.cli.sequences import require_hdf5
from fedora_qa.cli.settings import external_folders
from fedora_qa.errors import MisuseError, UnreadableFileError, first_line
from fedora_qa.layout.describe import DatasetRow, Description, describe
from fedora_qa.layout.dialect import DialectChoice, load_choice, split_choice
from fedora_qa.layout.draft_file import draft_dialect
from fedora_qa.layout.draft_folder import draft_folder
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.folder import OpenFolder, matched_folder, sequences_in
from fedora_qa.layout.resolve import resolve, unrecognised
from fedora_qa.record.atomic import write_text
from fedora_qa.record.wording import NOT_RECOGNISED, number
from fedora_qa.storage.folder import is_folder, list_files
from fedora_qa.storage.signature import opening_limit_s

_LONGEST_S: Final = 20.0
"""Usual limit of time by the clock, s; a file of ten thousand objects takes a few seconds."""

_UNUSED_SHOWN = 20
_WIDE = 110
"""Columns from which the datasets fit into a table."""


def run_layout(
    file: Path,
    dialect: str | None,
    metadata: str | None,
    draft_path: Path | None,
    allow_external: tuple[str, ...],
) -> int:
    """Run the command and return its exit code."""
    dialect_read = load_choice(dialect, metadata)
    if draft_path:
        require_new_file(draft_path, [file], force=False, remedy="it may hold corrections; choose another name")
    if not is_folder(file):
        require_hdf5([file])
    elif not list_files(file):
        raise MisuseError(f"Expected a sequence, got a folder without files: {file}")
    arguments = (file, dialect_read, draft_path.stem if draft_path else "", external_folders(allow_external))
    description, draft = run_isolated_light(_describe_file, arguments, file, opening_limit_s(_LONGEST_S))
    console = stdout_console()
    console.print(Text.assemble(("Dialect  ", "bold"), text(description.dialect)))
    console.print(Text())
    if description.datasets and console.width >= _WIDE:
        columns = ["stream", "found at", "shape", "type", "units", "stored"]
        if any(row.conversion for row in description.datasets):
            columns.append("conversion")
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for column in columns:
            table.add_column(column, no_wrap=column in {"stream", "shape", "type", "units"}, overflow="fold")
        previous = ""
        for row in description.datasets:
            # Rows arrive by stream; a repeated name would hide where the next stream starts.
            stream = "" if row.stream == previous else row.stream
            cells = (stream, row.path, _shape(row.shape), row.dtype, row.units, _storage(row), row.conversion)
            table.add_row(*(text(cell) for cell in cells[: len(columns)]))
            previous = row.stream
        console.print(table)
        console.print(Text())
    elif description.datasets:
        # The content of the table as two short lines for each dataset.
        for row in description.datasets:
            console.print(text(f"{row.path}  {_shape(row.shape)}  {row.dtype} {row.units}"))
            details = ", ".join(part for part in (row.stream, _storage(row), row.conversion) if part)
            console.print(Padding(text(details, "dim"), (0, 0, 0, 4), expand=False))
        console.print(Text())
    inferred = [f"{name}: {number(v) if isinstance(v, float) else v}" for name, v in description.inferred]
    unused = description.unused[:_UNUSED_SHOWN]
    more = len(description.unused) - len(unused)
    for title, lines, style in (
        ("Absent", [f"{stream}: {reason}" for stream, reason in description.absent], ""),
        ("Inferred", inferred, ""),
        ("Problems", description.problems, "red"),
        ("Unknown to the dialect", [*unused, *([f"... and {more} more"] if more else [])], ""),
        ("Not examined", description.unseen, ""),
    ):
        if not lines:
            continue
        console.print(Text(title, style="bold"))
        for line in lines:
            console.print(Padding(text(line, style), (0, 0, 0, 2), expand=False))
        console.print(Text())
    if not (description.datasets or description.problems or draft_path):
        remedy = f"draft one with fedora-qa layout {quote(str(file))} --draft-dialect OUT.toml"
        console.print(text(f"{NOT_RECOGNISED}: no dialect describes anything in {file.name}; {remedy}"))
    if draft_path:
        write_text(draft_path, draft)
        guessed = len(tomllib.loads(draft).get("datasets", {}))
        counted = f"{guessed} dataset{'s' * (guessed != 1)}"
        remedy = (
            "Correct it, and check with it as --dialect." if guessed else "Nothing looks like a stream of a sequence."
        )
        console.print(text(f"{draft_path} is written, with {counted} that were guessed. {remedy}"))
    return 0


def _describe_file(
    file: Path, dialect: DialectChoice, draft_name: str, allow_external: tuple[Path, ...]
) -> tuple[Description, str]:
    """Return what a file holds, and a draft of its dialect if a name is given for it, else an empty text."""
    external_files = ExternalFiles(allow_external) if allow_external else None
    if is_folder(file):
        several = sequences_in(file, split_choice(dialect)[0])
        if not draft_name and len(several) > 1:
            named = ", ".join(map(str, several))
            raise MisuseError(f"Expected one sequence, got {file}, which holds {len(several)}: name one of {named}")
        sequence = several[0] if several else file
        matched = None if len(several) > 1 else matched_folder(sequence, split_choice(dialect)[0])
        if matched is None:
            files = tuple(each.name for each in list_files(file))
            absent = tuple(unrecognised(str(file)).absent.items())
            draft = draft_folder(file, draft_name) if draft_name else ""
            return Description("unknown", (), absent, files, (), (), ()), draft
        with closing(OpenFolder(matched)) as folder:
            description = describe(folder, resolve(folder, dialect, external_files), external_files)
        return description, draft_folder(file, draft_name) if draft_name else ""
    try:
        # The real path, because HDF5 searches for external files beside the name by which it was given this one.
        # Best-effort locking, because a read-only file system grants no locks.
        with h5py.File(file.resolve(), "r", locking="best-effort") as opened:
            description = describe(opened, resolve(opened, dialect, external_files), external_files)
            return description, draft_dialect(opened, draft_name) if draft_name else ""
    except OSError as error:
        raise UnreadableFileError(f"Expected a complete HDF5 file, got: {first_line(error)}") from None


def _storage(row: DatasetRow) -> str:
    chunks = f"{row.chunks[0]} {'row' if row.chunks[0] == 1 else 'rows'} a chunk" if row.chunks else "contiguous"
    return chunks if row.codec == "none" else f"{chunks}, {row.codec}"


def _shape(sizes: Sequence[int]) -> str:
    return " x ".join(map(str, sizes)) or "scalar"
