"""The record as CSV tables (RFC 4180, UTF-8), for spreadsheets and data frames."""

import csv
import io
from typing import Final

from fedora_qa.record.tables import TABLE_NAMES, Cell, Table, tables_of
from fedora_qa.record.types import Record
from fedora_qa.record.wording import printable

_FORMULA_STARTS: Final = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""Characters that start a formula, also after spaces; with their full-width forms of East Asian keyboards."""

CSV_NAMES: Final = tuple(f"{name}.csv" for name in TABLE_NAMES)
"""The files that hold the tables."""


def record_to_csv(record: Record) -> dict[str, str]:
    """Return each table as CSV text, by the name of its file; the first column names the sequence."""
    return {name: _csv(table) for name, table in zip(CSV_NAMES, tables_of(record), strict=True)}


def _csv(table: Table) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(column.name for column in table.columns)
    writer.writerows([_cell(value) for value in row] for row in table.rows)
    return text.getvalue()


def _cell(value: Cell) -> str:
    """Return a cell; None is empty. Text that a spreadsheet would calculate is marked as text."""
    if value is None:
        return ""
    # Before `str`, which would write True: the words are those of the JSON.
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return _cell(" ".join(map(str, value)))
    if isinstance(value, str):
        text = printable(value)
        # Spreadsheets calculate a cell that starts like a formula (CWE-1236); an apostrophe marks it as text.
        return f"'{text}" if text.lstrip().startswith(_FORMULA_STARTS) else text
    return str(value)
