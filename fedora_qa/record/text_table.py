"""A table of text."""

from dataclasses import dataclass
from typing import Final

ABSENT: Final = "-"

SOURCE: Final = "source"
"""Heads a column that names who published a row."""


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table of text: the first ``words`` columns hold words, the others numbers."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    words: int = 2
