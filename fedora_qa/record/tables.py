"""Tables: a record as tables of typed columns, for CSV (here), Parquet and data frames; and tables of text.

CSV is that of RFC 4180, UTF-8, for spreadsheets and data frames.
"""

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from fedora_qa.record.types import Record, Scalar
from fedora_qa.record.wording import number, printable

Kind = Literal["text", "texts", "integer", "integers", "number", "scalar"]
"""What a column holds: ``texts`` and ``integers`` hold several values in a cell, ``scalar`` one of any type."""

Cell = Scalar | tuple[str, ...] | tuple[int, ...]
Row = tuple[Cell, ...]

ABSENT: Final = "-"
"""Stands in a table of text for an absent value."""

SOURCE: Final = "source"
"""Heads a column of a table of text that names who published a row."""

_FORMULA_STARTS: Final = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""Characters that start a formula, also after spaces; with their full-width forms of East Asian keyboards."""

_NUMBER: Final = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?")
_ABSENT_CELLS: Final = frozenset({ABSENT, "–"})


@dataclass(frozen=True, slots=True)
class Column:
    """A column, every cell of which is of its kind or None."""

    name: str
    kind: Kind


@dataclass(frozen=True, slots=True)
class Table:
    """A table; its first column names the sequence."""

    name: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table of text: the first ``words`` columns hold words, the others numbers."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    words: int = 2


def number_cell(value: Scalar, scale: float = 1.0) -> str:
    """Return ``scale`` times a number as a cell of a table of text; ``ABSENT`` for anything else."""
    return number(scale * value) if isinstance(value, int | float) else ABSENT


def tables_of(record: Record) -> tuple[Table, ...]:
    """Return every table of a record."""
    return tuple(table_of(record, name) for name in TABLE_NAMES)


def table_of(record: Record, name: str) -> Table:
    """Return one table of a record; raises ``KeyError`` where there is none of the name."""
    columns = (Column("file", "text"), *_COLUMNS[name])
    rows: list[Row] = []
    for file in record.files:
        # The path is in each row, so that tables of one record can be joined.
        path = file.path
        match name:
            case "files":
                rows.append((path, file.verdict, file.dialect, file.size, file.sha256, file.digest_kind))
            case "results":
                for r in file.results:
                    coverage = (r.coverage.seen, r.coverage.of, r.coverage.unit) if r.coverage else (None, None, None)
                    rows.append((path, r.check, r.outcome, *coverage, r.reason))
            case "measurements":
                rows += [
                    (path, r.check, m.name, m.value, m.unit, m.standard_error, m.expected, m.limit, m.least_detectable,
                     m.side, m.tests, m.material, *(m.least_detectable_range or (None, None)))
                    for r in file.results for m in r.measurements
                ]  # fmt: skip
            case "findings":
                for r in file.results:
                    for f in r.findings:
                        place = (getattr(f.where, column.name) for column in _PLACE)
                        rows.append((path, r.check, f.id, f.code, f.severity, f.message, *place))
            case "diagnoses":
                rows += [
                    (path, d.id, d.cause, d.stream, d.magnitude, d.unit, d.standard_error, d.confidence, d.remedy,
                     d.explains, d.status, d.tried, d.cleared, d.windows, d.after)
                    for d in file.diagnoses
                ]  # fmt: skip
            case "statistics":
                rows += _statistic_rows(path, file.statistics)
            case _:
                raise AssertionError(f"columns without rows: {name}")
    return Table(name, columns, tuple(rows))


def statistics_table(by_file: Mapping[str, Mapping[str, Mapping[str, Scalar]]]) -> Table:
    """Return the table of the statistics of files, by their paths, as ``table_of`` does of a record."""
    rows = tuple(row for path, statistics in by_file.items() for row in _statistic_rows(path, statistics))
    return Table("statistics", (Column("file", "text"), *_COLUMNS["statistics"]), rows)


def _statistic_rows(path: str, statistics: Mapping[str, Mapping[str, Scalar]]) -> Iterator[Row]:
    for group, values in statistics.items():
        for key, value in values.items():
            yield path, group, key, value


def _columns(**kinds: Kind) -> tuple[Column, ...]:
    return tuple(Column(name, kind) for name, kind in kinds.items())


_PLACE: Final = _columns(
    stream="text", start_us="number", stop_us="number", index_start="integer", index_stop="integer", frame="integer",
    pixel="integers", tile="integers",
)  # fmt: skip

_COLUMNS: Final = {
    "files": _columns(verdict="text", dialect="text", size_bytes="integer", sha256="text", digest_kind="text"),
    "results": _columns(
        check="text", outcome="text", seen="integer", of="integer", coverage_unit="text", reason="text",
    ),
    "measurements": _columns(
        check="text", name="text", value="number", unit="text", standard_error="number", expected="number",
        limit="number", least_detectable="number", side="text", tests="integer", material="number",
        lowest_detectable="number", highest_detectable="number",
    ),
    "findings": (*_columns(check="text", id="text", code="text", severity="text", message="text"), *_PLACE),
    "diagnoses": _columns(
        id="text", cause="text", stream="text", magnitude="number", unit="text", standard_error="number",
        confidence="number", remedy="text", explains="texts", status="text", tried="texts", cleared="texts",
        windows="integer", after="texts",
    ),
    "statistics": _columns(group="text", name="text", value="scalar"),
}  # fmt: skip
"""Columns of each table besides ``file``; ``table_of`` gives its rows."""

TABLE_NAMES: Final = tuple(_COLUMNS)
"""The tables, in the order in which they are written."""

CSV_NAMES: Final = tuple(f"{name}.csv" for name in TABLE_NAMES)
"""The files that hold the tables."""


def record_to_csv(record: Record) -> dict[str, str]:
    """Return each table as CSV text, by the name of its file; the first column names the sequence.

    None is an empty cell. Text that a spreadsheet would calculate is marked as text.
    """
    texts: dict[str, str] = {}
    for name, table in zip(CSV_NAMES, tables_of(record), strict=True):
        output = io.StringIO()
        writer = csv.writer(output)
        writer.writerow(column.name for column in table.columns)
        for row in table.rows:
            cells: list[str] = []
            for value in row:
                plain = " ".join(map(str, value)) if isinstance(value, tuple) else value
                if plain is None:
                    cells.append("")
                elif isinstance(plain, bool):  # before `str`, which would write True: the words are those of the JSON
                    cells.append("true" if plain else "false")
                elif isinstance(plain, str):
                    cells.append(_uncalculated(plain))
                else:
                    cells.append(str(plain))
            writer.writerow(cells)
        texts[name] = output.getvalue()
    return texts


def table_to_csv(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of text as CSV; numbers stay numbers, and a dash, which marks an absent value, an empty cell."""
    output = io.StringIO()
    writer = csv.writer(output)
    for row in (head, *rows):
        writer.writerow(
            "" if cell in _ABSENT_CELLS else cell if _NUMBER.fullmatch(cell) else _uncalculated(cell) for cell in row
        )
    return output.getvalue()


def _uncalculated(plain: str) -> str:
    """Return text that a spreadsheet shows as it is."""
    text = printable(plain)
    # Spreadsheets calculate what starts like a formula (CWE-1236); an apostrophe marks it as text.
    return f"'{text}" if text.lstrip().startswith(_FORMULA_STARTS) else text
