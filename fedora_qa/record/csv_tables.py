"""The record as CSV tables (RFC 4180, UTF-8), for spreadsheets and data frames."""

import csv
import io
from typing import Final

from fedora_qa.record.tables import TABLE_NAMES, tables_of
from fedora_qa.record.types import Record
from fedora_qa.record.wording import printable

_FORMULA_STARTS: Final = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""Characters that start a formula, also after spaces; with their full-width forms of East Asian keyboards."""

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
                    text = printable(plain)
                    # Spreadsheets calculate what starts like a formula (CWE-1236); an apostrophe marks it as text.
                    cells.append(f"'{text}" if text.lstrip().startswith(_FORMULA_STARTS) else text)
                else:
                    cells.append(str(plain))
            writer.writerow(cells)
        texts[name] = output.getvalue()
    return texts
