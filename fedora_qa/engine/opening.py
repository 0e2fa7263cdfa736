"""Test whether a file opens at all, for code that opens it outside of the engine afterwards."""

from collections.abc import Iterable
from pathlib import Path

from fedora_qa.engine.open_file import OPENING_S
from fedora_qa.engine.time_limit import time_limit
from fedora_qa.layout.dialect import Dialect
from fedora_qa.sequence.sequence import open_sequence


def require_end_of_opening(path: Path, dialect: Dialect | None = None, allow_external: Iterable[Path] = ()) -> None:
    """End this process where a file takes for ever to open; only for workers, whose end is noticed.

    Arguments and what it raises are those of ``open_sequence``.
    """
    with time_limit(OPENING_S):
        open_sequence(path, dialect, allow_external=allow_external).close()
