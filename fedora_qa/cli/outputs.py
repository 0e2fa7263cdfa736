"""What commands write: refused before the work if it cannot be written, and never written in part.

``fedora_reports`` and pyarrow are optional packages, imported only where a report or Parquet is requested.
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray
from rich.console import Console

from fedora_qa.causes import CAUSES
from fedora_qa.checks.explanation import Explanation, published_explanations
from fedora_qa.cli.arrays import arrays_beside, write_arrays
from fedora_qa.cli.console import stderr_console, stdout_console
from fedora_qa.cli.documents import STDOUT, write_document
from fedora_qa.cli.markdown import markdown_of
from fedora_qa.cli.published_studies import fault_price_text, fault_price_texts, pass_detection_power
from fedora_qa.comparison.types import Comparison
from fedora_qa.diagnosis.direct import is_direct
from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import is_special, replacing
from fedora_qa.record.ci import record_to_badge, record_to_junit
from fedora_qa.record.json_io import record_parts
from fedora_qa.record.markdown import record_to_markdown
from fedora_qa.record.sarif import RuleHelp, record_to_sarif
from fedora_qa.record.tables import CSV_NAMES, TABLE_NAMES, Kind, Table, record_to_csv, tables_of
from fedora_qa.record.types import FileRecord, Record
from fedora_qa.record.wording import capitalised
from fedora_qa.scoring.types import Score
from fedora_qa.storage.folder import is_folder, root_of

PARQUET_NAMES: Final = tuple(f"{name}.parquet" for name in TABLE_NAMES)
"""The files that hold the tables."""

_NAMED_IN_RESULTS = "The message of a result names the probable cause and its remedy, where there is one."


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
        """Where the evidence arrays lie: beside the record; a record on stdout, a device or a pipe has none."""
        if self.json is None or self.json == STDOUT or is_special(self.json):
            return None
        return arrays_beside(self.json)

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
        folders = [root_of(path) for path in read if is_folder(path)]
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
            # Into a device or a pipe it is written, a file is replaced.
            if not os.access(place if is_special(place) else place.parent, os.W_OK):
                raise MisuseError(f"Expected the folder of {target} to be writable")
        # Last, because these import optional packages; a wrong path is reported without that.
        if self.parquet:
            _require_parquet()
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
            write_document(self.html, _render_record(record, arrays))


def _without_evidence(file: FileRecord) -> FileRecord:
    return replace(file, evidence={})


def require_new_file(
    output: Path, inputs: Sequence[Path], *, force: bool, remedy: str = "use --force to write over it"
) -> None:
    """Raise ``MisuseError`` where a file cannot be written, is an input under any name, or exists without ``force``."""
    Outputs(own=(output,)).require_writable(inputs)
    if not output.exists():
        return
    if is_special(output):
        raise MisuseError(f"Expected a file to write, got {output}, which is a device or a pipe; choose another name")
    for path in inputs:
        # Hard links: two names of one file, neither of which leads to the other.
        if path.exists() and path.samefile(output):
            raise MisuseError(f"Expected an output of its own, got {output}, which is {path}")
    if not force:
        raise MisuseError(f"Expected a new file to write, got {output}, which exists; {remedy}")


def require_result_folder(folder: Path, remedy: str) -> None:
    """Make the folder where it is missing; raises ``MisuseError``, which ends with a remedy, if it is not writable."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise MisuseError(
            f"Expected to be able to keep results in {folder}, got: {problem.strerror}; {remedy}"
        ) from None
    if not os.access(folder, os.W_OK):
        raise MisuseError(f"Expected to be able to write into {folder}, got no permission; {remedy}")


def require_renderer() -> None:
    """Raise ``MisuseError`` where ``fedora_reports`` is not installed."""
    try:
        from fedora_reports import html  # noqa: F401, PLC0415 - an extra
    except ImportError as missing:
        raise MisuseError(
            f"Expected what draws reports, got: {missing}; install it with pip install 'fedora-qa[reports]'"
        ) from None


def page_or_none(document: Record | Comparison | Score, arrays: Mapping[str, NDArray[Any]]) -> str | None:
    """Draw the page of a document, of a record with its arrays; None where ``fedora_reports`` is not installed."""
    try:
        from fedora_reports.comparison import render_comparison  # noqa: PLC0415 - an extra
        from fedora_reports.html import render_html  # noqa: PLC0415 - an extra
        from fedora_reports.score import render_score  # noqa: PLC0415 - an extra
    except ImportError:
        return None
    if isinstance(document, Comparison):
        return render_comparison(document)
    return render_score(document) if isinstance(document, Score) else render_html(document, arrays)


def _render_record(record: Record, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Draw the report from a record and its arrays, with the detection power that was measured."""
    from fedora_reports.html import render_html  # noqa: PLC0415 - an extra

    return render_html(record, arrays, pass_detection_power(), fault_price_texts())


def _require_parquet() -> None:
    """Raise ``MisuseError`` where pyarrow, which writes Parquet, is not installed."""
    try:
        import pyarrow.parquet  # noqa: F401, PLC0415 - an extra
    except ImportError as missing:
        raise MisuseError(
            f"Expected what writes Parquet, got: {missing}; install it with pip install 'fedora-qa[parquet]'"
        ) from None


def write_parquet(folder: Path, record: Record) -> None:
    """Write each table of a record into a folder, each file entirely or not at all."""
    import pyarrow.parquet  # noqa: PLC0415 - an extra

    for name, table in zip(PARQUET_NAMES, tables_of(record), strict=True):
        with replacing(folder / name) as temporary:
            pyarrow.parquet.write_table(arrow_table(table), temporary)


def arrow_table(table: Table) -> Any:
    """Return a table as a ``pyarrow.Table``: every column of one type, unknown values null.

    A column of scalars of any type becomes two: its numbers, and under ``<name>_text`` what is no number.
    """
    import pyarrow as pa  # noqa: PLC0415 - an extra

    types: dict[Kind, Any] = {
        "text": pa.string(),
        "texts": pa.list_(pa.string()),
        "integer": pa.int64(),
        "integers": pa.list_(pa.int64()),
        "number": pa.float64(),
    }
    arrays: dict[str, Any] = {}
    for place, column in enumerate(table.columns):
        cells = [_arrow_value(row[place]) for row in table.rows]
        # An Arrow column has one type; a statistic may be a number, a text or a flag.
        if column.kind == "scalar":
            arrays[column.name] = pa.array([cell if _is_number(cell) else None for cell in cells], types["number"])
            # Flags as JSON has them: true, false.
            texts = [str(cell).lower() if isinstance(cell, bool) else cell for cell in cells]
            arrays[f"{column.name}_text"] = pa.array(
                [cell if isinstance(cell, str) else None for cell in texts], types["text"]
            )
        else:
            arrays[column.name] = pa.array(cells, types[column.kind])
    return pa.table(arrays)


def _arrow_value(value: Any) -> Any:
    """Return a cell as Arrow can carry it, and as the record's JSON does.

    A number that is not finite is null, an undecodable byte of a path an escape.
    """
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    if isinstance(value, tuple):
        return [_arrow_value(item) for item in value]
    return None if _is_number(value) and not math.isfinite(value) else value


def _is_number(value: Any) -> bool:
    # bool is a subclass of int; as numbers, flags would become 0 and 1.
    return isinstance(value, Real) and not isinstance(value, bool)


def rule_helps() -> Mapping[str, RuleHelp]:
    """Return the help of the rules of every check, by the name of the check."""
    return {explained.check: _help_of(explained) for explained in published_explanations()}


def _help_of(explained: Explanation) -> RuleHelp:
    """Return what a check measures, why it matters, what it cannot detect, and what to do."""
    price = "\n".join(f"- {line}" if line else "" for line in fault_price_text(explained.check).splitlines()[:-1])
    sections = {
        "What is checked": explained.measured,
        "Why it matters": "\n\n".join(filter(None, (explained.sections["Why it matters"], price))),
        "What it cannot detect": explained.sections["Cannot detect"],
        "What to do": "\n".join([*_remedies(explained.check), _NAMED_IN_RESULTS]),
    }
    text = "\n\n".join(f"{title}\n{section}" for title, section in sections.items()).replace("``", "")
    markdown = "\n\n".join(f"## {title}\n\n{markdown_of(section)}" for title, section in sections.items())
    return RuleHelp(
        description=explained.measured.replace("``", ""),
        text=f"{explained.question}\n\n{text}",
        markdown=f"**{markdown_of(explained.question)}**\n\n{markdown}",
    )


def _remedies(check: str) -> list[str]:
    """Return the remedies of the causes that a check measures directly, as a list of Markdown and a blank line."""
    causes = [cause for cause in CAUSES.values() if is_direct(cause.identifier, f"{check}.rule")]
    items = [f"- {capitalised(cause.meaning)}: {cause.remedy}" for cause in causes]
    return [*items, ""] if items else []
