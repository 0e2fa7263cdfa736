"""The record as CSV tables (RFC 4180, UTF-8), for spreadsheets and data frames."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Final

from fedora_qa.record.types import FileRecord, Record, Scalar, Where
from fedora_qa.record.wording import printable

Row = tuple[Scalar, ...]

_FORMULA_STARTS: Final = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""What begins a formula, also after spaces, and in the full width that East Asian keyboards write."""
_PLACE: Final = ("stream", "start_us", "stop_us", "index_start", "index_stop", "frame", "pixel", "tile")


def record_to_csv(record: Record) -> dict[str, str]:
    """Return each table as CSV text, by the name of its file; the first column names the sequence."""
    return {
        name: _csv(head, ((file.path, *row) for file in record.files for row in rows(file)))
        for name, (head, rows) in _TABLES.items()
    }


def _files(file: FileRecord) -> Iterator[Row]:
    yield file.verdict, file.dialect, file.size, file.sha256, file.digest_kind


def _results(file: FileRecord) -> Iterator[Row]:
    for result in file.results:
        coverage = result.coverage
        seen = (coverage.seen, coverage.of, coverage.unit) if coverage else (None, None, None)
        yield result.check, result.outcome, *seen, result.reason


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
        explains = " ".join(d.explains)
        yield d.id, d.cause, d.stream, d.magnitude, d.unit, d.standard_error, d.confidence, d.remedy, explains


def _statistics(file: FileRecord) -> Iterator[Row]:
    for group, values in file.statistics.items():
        for name, value in values.items():
            yield group, name, value


_TABLES: Final[Mapping[str, tuple[tuple[str, ...], Callable[[FileRecord], Iterator[Row]]]]] = MappingProxyType(
    {
        "files.csv": (("file", "verdict", "dialect", "size_bytes", "sha256", "digest_kind"), _files),
        "results.csv": (("file", "check", "outcome", "seen", "of", "coverage_unit", "reason"), _results),
        "measurements.csv": (
            ("file", "check", "name", "value", "unit", "standard_error", "expected", "limit", "least_detectable",
             "side", "tests"),
            _measurements,
        ),
        "findings.csv": (("file", "check", "id", "code", "severity", "message", *_PLACE), _findings),
        "diagnoses.csv": (
            ("file", "id", "cause", "stream", "magnitude", "unit", "standard_error", "confidence", "remedy",
             "explains"),
            _diagnoses,
        ),
        "statistics.csv": (("file", "group", "name", "value"), _statistics),
    }
)  # fmt: skip

CSV_NAMES: Final = tuple(_TABLES)
"""The files that hold the tables."""


def _place(where: Where) -> Iterator[Scalar]:
    for name in _PLACE:
        value = getattr(where, name)
        yield " ".join(map(str, value)) if isinstance(value, tuple) else value


def _csv(head: tuple[str, ...], rows: Iterable[Row]) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(head)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: Scalar) -> str:
    """Return a cell; nothing is empty. Text that a spreadsheet would calculate is marked as text."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        shown = printable(value)
        return f"'{shown}" if shown.lstrip().startswith(_FORMULA_STARTS) else shown
    return str(value)
