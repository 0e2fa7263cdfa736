"""The record as CSV tables (RFC 4180, UTF-8), for spreadsheets and data frames."""

import csv
import io
import re
from collections.abc import Iterable, Sequence
from typing import Final

from fedora_qa.record.tables import TABLE_NAMES, tables_of
from fedora_qa.record.types import Record
from fedora_qa.record.wording import printable

_FORMULA_STARTS: Final = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""Characters that start a formula, also after spaces; with their full-width forms of East Asian keyboards."""

_NUMBER: Final = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?")
_ABSENT: Final = frozenset({"-", "–"})

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
            "" if cell in _ABSENT else cell if _NUMBER.fullmatch(cell) else _uncalculated(cell) for cell in row
        )
    return output.getvalue()


def _uncalculated(plain: str) -> str:
    """Return text that a spreadsheet shows as it is."""
    text = printable(plain)
    # Spreadsheets calculate what starts like a formula (CWE-1236); an apostrophe marks it as text.
    return f"'{text}" if text.lstrip().startswith(_FORMULA_STARTS) else text
