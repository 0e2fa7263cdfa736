"""Text files: columns of numbers (timestamps, trajectories of TUM, CSV), and documents (YAML, TOML, JSON)."""

import io
import json
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from numpy.typing import NDArray

from fedora_qa.errors import first_line
from fedora_qa.sources.source import SourceError

LARGEST_BYTES: Final = 64 << 20
"""Largest file: text is parsed as a whole. Half a million poses of TUM fit, 40 minutes at 200 Hz."""

MOST_COLUMNS: Final = 64

_HEAD_LINES: Final = 8
"""Lines without numbers at the beginning, which are names of columns or remarks."""

LARGEST_DOCUMENT_BYTES: Final = 1 << 20
"""Largest document: a calibration has some kilobytes."""


@dataclass(frozen=True, slots=True)
class NumberTable:
    """Rows of numbers in a text file. Each process parses it once.

    Attributes
    ----------
    path
        The file.
    changed_ns
        Time of its last change: other content is parsed anew.
    shape
        (rows, columns).
    dtype
        ``int64`` where every number is whole, else ``float64``.
    """

    path: Path
    changed_ns: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    rows_together: int = 0

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Return rows, (stop - start, columns)."""
        return _parsed(self.path, self.changed_ns)[start:stop].copy()


def number_table(path: Path) -> NumberTable:
    """Return the numbers in a text file; raises ``SourceError`` or ``OSError``."""
    changed_ns = path.stat().st_mtime_ns
    numbers = _parsed(path, changed_ns)
    return NumberTable(path, changed_ns, numbers.shape, numbers.dtype)


@lru_cache(maxsize=8)
def _parsed(path: Path, changed_ns: int) -> NDArray[Any]:
    size = path.stat().st_size
    if size > LARGEST_BYTES:
        message = f"Expected {path.name} in {LARGEST_BYTES} bytes at most, got {size}; write it as HDF5 or NPY"
        raise SourceError("too_large", "wrong_shape", message)
    try:
        lines = path.read_bytes().decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise SourceError(
            "unreadable", "wrong_dtype", f"Expected numbers as text in {path.name}, got other bytes"
        ) from None
    kept = [
        line for line in (raw.partition("#")[0].replace(",", " ").replace(";", " ").strip() for raw in lines) if line
    ]
    # Names of columns come before the first line of numbers.
    head = 0
    while head < min(len(kept), _HEAD_LINES) and not _is_number(kept[head].split()[0]):
        head += 1
    body = kept[head:]
    if not body:
        return np.empty((0, 1), np.int64)
    # A first column of names looks like a head without end: what stood in it would be lost, row by row.
    first = body[0].split()[0]
    if not _is_number(first):
        message = f"Expected rows that begin with a number in {path.name}, got {first!r}; put columns of names last"
        raise SourceError("wrong_dtype", "wrong_dtype", message)
    columns = len(body[0].split())
    if columns > MOST_COLUMNS:
        raise SourceError(
            "wrong_shape", "wrong_shape", f"Expected {MOST_COLUMNS} columns at most in {path.name}, got {columns}"
        )
    for number, line in enumerate(body):
        if len(line.split()) != columns:
            message = f"Expected {columns} numbers in row {number} of {path.name}, got {len(line.split())}"
            raise SourceError("wrong_shape", "truncated", message)
    # A column of names, as of images beside their timestamps, is no column of numbers: it reads as 0.
    named = [column for column, word in enumerate(body[0].split()) if not _is_number(word)]
    text = "\n".join(body)
    for dtype in (np.int64, np.float64):
        try:
            read = np.loadtxt(
                io.StringIO(text),
                dtype=dtype,
                ndmin=2,
                comments=None,
                usecols=[column for column in range(columns) if column not in named],
            )
            return np.insert(read, [column - i for i, column in enumerate(named)], 0, axis=1) if named else read
        except (ValueError, OverflowError):
            continue
    raise SourceError("wrong_dtype", "wrong_dtype", f"Expected numbers in every row of {path.name}, got other text")


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def document_value(path: Path, keys: str) -> Any:
    """Return the value at a path of keys, joined by slashes; None where there is none.

    Raises
    ------
    SourceError
        The document is too large, or not of the format that its name states.
    OSError
        It cannot be read.
    """
    value = _document(path, path.stat().st_mtime_ns)
    for key in filter(None, keys.split("/")):
        if isinstance(value, list) and key.isdigit() and int(key) < len(value):
            value = value[int(key)]
        elif isinstance(value, dict) and key in value:
            value = value[key]
        else:
            return None
    return value


@lru_cache(maxsize=4)
def _document(path: Path, changed_ns: int) -> Any:
    size = path.stat().st_size
    if size > LARGEST_DOCUMENT_BYTES:
        raise SourceError(
            "too_large", "unknown", f"Expected {path.name} in {LARGEST_DOCUMENT_BYTES} bytes at most, got {size}"
        )
    try:
        text = path.read_text("utf-8")
        if path.suffix.lower() == ".toml":
            return tomllib.loads(text)
        # The safe loader makes numbers, text, lists and tables, and runs nothing.
        return json.loads(text) if path.suffix.lower() == ".json" else yaml.load(text, Loader=_Loader)
    except (ValueError, yaml.YAMLError, RecursionError) as error:
        raise SourceError(
            "unreadable", "unknown", f"Expected a document in {path.name}, got: {first_line(error)}"
        ) from None


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML publishes no types
    """Refuses aliases: a few lines of them stand for any number of values."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Return the next node; raises ``YAMLError`` for an alias."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("an alias, which is not read")
        return super().compose_node(parent, index)
