"""The record as JSON: written entirely or not at all, and read back with every problem named."""

import json
import math
from collections.abc import Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import write_text
from fedora_qa.record.types import RECORD_VERSION, Record

RECORD_ADAPTER: Final[TypeAdapter[Record]] = TypeAdapter(Record)
"""Turns a record into plain values and back, checking every type."""


def record_to_json(record: Record) -> str:
    """Return the record as a JSON document.

    NaN and infinity become null. What UTF-8 cannot carry (an undecodable byte in a path) is written as an escape.

    Raises
    ------
    ValidationError
        The record holds what its types do not allow; such a document would not be readable again.
    """
    values = _plain(RECORD_ADAPTER.dump_python(record, warnings="none"))
    text = json.dumps(values, ensure_ascii=False, allow_nan=False, indent=1) + "\n"
    RECORD_ADAPTER.validate_json(text)
    return text


def record_from_json(text: str | bytes) -> Record:
    """Return the record that a JSON document holds.

    Raises
    ------
    MisuseError
        The text is not JSON, is of another record version, or does not fit the schema; names the offending place.
    """
    _require_version(text)
    try:
        return RECORD_ADAPTER.validate_json(text)
    except ValidationError as problem:
        first = problem.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the document"
        raise MisuseError(f"Expected a valid record, got at {place}: {first['msg']}; write the record again") from None


def write_record(record: Record, path: Path) -> None:
    """Write the record as JSON, entirely or not at all."""
    write_text(path, record_to_json(record))


def read_record(path: Path) -> Record:
    """Read a record; raises ``MisuseError`` where there is none."""
    try:
        return record_from_json(path.read_bytes())
    except OSError as problem:
        raise MisuseError(f"Expected a readable record at {path}, got: {problem.strerror}") from None


def _require_version(text: str | bytes) -> None:
    try:
        document = json.loads(text)
    except RecursionError:
        raise MisuseError("Expected a record as JSON, got lists within lists without end") from None
    except ValueError as problem:
        raise MisuseError(f"Expected a record as JSON, got: {problem}; give a file that --json wrote") from None
    version = document.get("record_version") if isinstance(document, dict) else None
    if version != RECORD_VERSION:
        raise MisuseError(
            f"Expected record_version {RECORD_VERSION!r}, got {version!r}; check the file again with this version"
        )


def _plain(value: Any) -> Any:
    """Return the value as JSON can carry it: no NaN, no infinity, no lone surrogates, no array library's scalars."""
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    if isinstance(value, Mapping):
        return {_plain(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value) if math.isfinite(value) else None
    raise TypeError(f"Expected a value that JSON can carry, got {type(value).__name__}")
