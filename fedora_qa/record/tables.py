"""The record as tables of typed columns: what CSV, Parquet and data frames are made from."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Literal

from fedora_qa.record.types import FileRecord, Record, Scalar, Where

Kind = Literal["text", "texts", "integer", "integers", "number", "scalar"]
"""What a column holds: ``texts`` and ``integers`` hold several values in a cell, ``scalar`` one of any type."""

Cell = Scalar | tuple[str, ...] | tuple[int, ...]
Row = tuple[Cell, ...]


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
class _Shape:
    columns: tuple[Column, ...]
    rows: Callable[[FileRecord], Iterator[Row]]


def tables_of(record: Record) -> tuple[Table, ...]:
    """Return every table of a record."""
    return tuple(table_of(record, name) for name in TABLE_NAMES)


def table_of(record: Record, name: str) -> Table:
    """Return one table of a record; raises ``KeyError`` where there is none of the name."""
    shape = _SHAPES[name]
    # The path is in each row, so that tables of one record can be joined.
    rows = tuple((file.path, *row) for file in record.files for row in shape.rows(file))
    return Table(name, (Column("file", "text"), *shape.columns), rows)


def _files(file: FileRecord) -> Iterator[Row]:
    yield file.verdict, file.dialect, file.size, file.sha256, file.digest_kind


def _results(file: FileRecord) -> Iterator[Row]:
    for result in file.results:
        coverage = result.coverage
        coverage_cells = (coverage.seen, coverage.of, coverage.unit) if coverage else (None, None, None)
        yield result.check, result.outcome, *coverage_cells, result.reason


def _measurements(file: FileRecord) -> Iterator[Row]:
    for result in file.results:
        for m in result.measurements:
            yield (
                result.check, m.name, m.value, m.unit, m.standard_error, m.expected, m.limit, m.least_detectable,
                m.side, m.tests,
            )  # fmt: skip


def _findings(file: FileRecord) -> Iterator[Row]:
    for result in file.results:
        for finding in result.findings:
            yield result.check, finding.id, finding.code, finding.severity, finding.message, *_place(finding.where)


def _diagnoses(file: FileRecord) -> Iterator[Row]:
    for d in file.diagnoses:
        yield d.id, d.cause, d.stream, d.magnitude, d.unit, d.standard_error, d.confidence, d.remedy, d.explains


def _statistics(file: FileRecord) -> Iterator[Row]:
    for group, values in file.statistics.items():
        for name, value in values.items():
            yield group, name, value


def _place(where: Where) -> Iterator[Cell]:
    for column in _PLACE:
        yield getattr(where, column.name)


def _columns(**kinds: Kind) -> tuple[Column, ...]:
    return tuple(Column(name, kind) for name, kind in kinds.items())


_PLACE: Final = _columns(
    stream="text", start_us="number", stop_us="number", index_start="integer", index_stop="integer", frame="integer",
    pixel="integers", tile="integers",
)  # fmt: skip

_SHAPES: Final = {
    "files": _Shape(
        _columns(verdict="text", dialect="text", size_bytes="integer", sha256="text", digest_kind="text"), _files
    ),
    "results": _Shape(
        _columns(check="text", outcome="text", seen="integer", of="integer", coverage_unit="text", reason="text"),
        _results,
    ),
    "measurements": _Shape(
        _columns(
            check="text", name="text", value="number", unit="text", standard_error="number", expected="number",
            limit="number", least_detectable="number", side="text", tests="integer",
        ),
        _measurements,
    ),
    "findings": _Shape(
        (*_columns(check="text", id="text", code="text", severity="text", message="text"), *_PLACE), _findings
    ),
    "diagnoses": _Shape(
        _columns(
            id="text", cause="text", stream="text", magnitude="number", unit="text", standard_error="number",
            confidence="number", remedy="text", explains="texts",
        ),
        _diagnoses,
    ),
    "statistics": _Shape(_columns(group="text", name="text", value="scalar"), _statistics),
}  # fmt: skip

TABLE_NAMES: Final = tuple(_SHAPES)
"""The tables, in the order in which they are written."""
