"""What commands write: refused before the work if it cannot be written, and never written in part."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from rich.console import Console

from fedora_qa.cli.arrays import arrays_beside, write_arrays
from fedora_qa.cli.console import stderr_console, stdout_console
from fedora_qa.cli.documents import STDOUT, write_document
from fedora_qa.cli.html import render_record, require_renderer
from fedora_qa.cli.parquet import PARQUET_NAMES, require_parquet, write_parquet
from fedora_qa.cli.rule_help import rule_helps
from fedora_qa.errors import MisuseError
from fedora_qa.record.badge import record_to_badge
from fedora_qa.record.csv_tables import CSV_NAMES, record_to_csv
from fedora_qa.record.json_io import record_parts
from fedora_qa.record.junit import record_to_junit
from fedora_qa.record.markdown import record_to_markdown
from fedora_qa.record.sarif import record_to_sarif
from fedora_qa.record.types import FileRecord, Record


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where to write what; None is not written, and ``STDOUT`` is printed.

    Attributes
    ----------
    own
        What a command writes by itself: a dialect, a drawing.
    csv, parquet
        Folders, which may be the same.
    github
        Whether to print annotations.
    summary
        Whether to print what people read.
    """

    json: Path | None = None
    markdown: Path | None = None
    html: Path | None = None
    own: tuple[Path | None, ...] = ()
    junit: Path | None = None
    sarif: Path | None = None
    badge: Path | None = None
    latex: Path | None = None
    csv: Path | None = None
    parquet: Path | None = None
    github: bool = False
    summary: bool = True

    @property
    def arrays(self) -> Path | None:
        """Where the evidence arrays lie: beside the record; a record on stdout has none."""
        return arrays_beside(self.json) if self.json and self.json != STDOUT else None

    @property
    def show_evidence(self) -> bool:
        """Whether an output is written that holds the evidence."""
        return self.arrays is not None or self.html is not None

    @property
    def _documents(self) -> tuple[Path | None, ...]:
        return (self.json, self.markdown, self.html, self.junit, self.sarif, self.badge, self.latex)

    def console(self) -> Console:
        """Return where to print what people read: stderr where a document has stdout to itself."""
        return stderr_console() if STDOUT in self._documents else stdout_console()

    def require_writable(self, inputs: Sequence[Path]) -> None:
        """Raise ``MisuseError`` where an output cannot be written, or would overwrite an input or another output."""
        documents = (path for path in self._documents if path != STDOUT)
        targets = [path for path in (*documents, self.arrays, *self.own) if path is not None]
        for folder, names in ((self.csv, CSV_NAMES), (self.parquet, PARQUET_NAMES)):
            if not folder:
                continue
            if folder.exists() and not folder.is_dir():
                raise MisuseError(f"Expected a folder for the tables, got a file: {folder}")
            if not folder.exists() and not (folder.parent.is_dir() and os.access(folder.parent, os.W_OK)):
                raise MisuseError(f"Expected the folder of {folder} to exist and be writable; make it first")
            # A folder that does not exist yet holds nothing that could be overwritten.
            targets += [folder / name for name in names if folder.is_dir()]
        # Resolved, because two names may lead to one file by a link or `..`.
        places = [path.resolve() for path in targets]
        read = {path.resolve() for path in inputs}
        folders = [path for path in read if path.is_dir()]
        for target, place in zip(targets, places, strict=True):
            if place in read or places.count(place) > 1:
                raise MisuseError(f"Expected an output of its own, got {target}, which is an input or another output")
            # A folder is identified by all files in it, so that an output would change what was checked.
            for folder in folders:
                if place.is_relative_to(folder):
                    raise MisuseError(f"Expected an output outside of {folder}, which is read, got {target}")
            if place.is_dir():
                raise MisuseError(f"Expected a file to write, got a folder: {target}")
            if not place.parent.is_dir():
                raise MisuseError(f"Expected the folder of {target} to exist; make it first")
            if not os.access(place.parent, os.W_OK):
                raise MisuseError(f"Expected the folder of {target} to be writable")
        # Last, because these import optional packages; a wrong path is reported without that.
        if self.parquet:
            require_parquet()
        if self.html:
            require_renderer()

    def write(self, record: Record, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write everything; the arrays first, so that no record refers to what is not there."""
        if self.arrays:
            write_arrays(self.arrays, arrays)
        if self.json:
            # No arrays lie beside a record on stdout.
            kept = record if self.arrays else replace(record, files=tuple(map(_without_evidence, record.files)))
            write_document(self.json, record_parts(kept))
        if self.markdown:
            write_document(self.markdown, record_to_markdown(record))
        if self.junit:
            write_document(self.junit, record_to_junit(record))
        if self.sarif:
            write_document(self.sarif, record_to_sarif(record, rule_helps()))
        if self.badge:
            write_document(self.badge, record_to_badge(record))
        if self.csv:
            self.csv.mkdir(exist_ok=True)
            for name, table in record_to_csv(record).items():
                write_document(self.csv / name, table)
        if self.parquet:
            self.parquet.mkdir(exist_ok=True)
            write_parquet(self.parquet, record)
        if self.html:
            write_document(self.html, render_record(record, arrays))


def _without_evidence(file: FileRecord) -> FileRecord:
    return replace(file, evidence={})


def require_new_file(
    output: Path, inputs: Sequence[Path], *, force: bool, remedy: str = "use --force to write over it"
) -> None:
    """Raise ``MisuseError`` where a file cannot be written, is an input under any name, or exists without ``force``."""
    Outputs(own=(output,)).require_writable(inputs)
    if not output.exists():
        return
    for path in inputs:
        # Hard links: two names of one file, neither of which leads to the other.
        if path.exists() and path.samefile(output):
            raise MisuseError(f"Expected an output of its own, got {output}, which is {path}")
    if not force:
        raise MisuseError(f"Expected a new file to write, got {output}, which exists; {remedy}")
