"""The record's tables as Parquet. pyarrow is an optional package, imported only where they are requested."""

import math
from numbers import Real
from pathlib import Path
from typing import Any, Final

from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import replacing
from fedora_qa.record.tables import TABLE_NAMES, Kind, Table, tables_of
from fedora_qa.record.types import Record

PARQUET_NAMES: Final = tuple(f"{name}.parquet" for name in TABLE_NAMES)
"""The files that hold the tables."""


def require_parquet() -> None:
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
