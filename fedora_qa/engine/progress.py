"""How far the work has come: of one step, and of all files together."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

Progress = Callable[[str, int, int], None]
"""Called with what is going on, how much is done, and of how much."""


MEASURING: Final = "measuring"
"""What is going on while windows are handed to the checks."""


def quiet(what: str, done: int, of: int) -> None:
    """Report no progress."""


@dataclass(frozen=True, slots=True)
class ProgressTally:
    """How far a run over some files has come.

    Attributes
    ----------
    doing
        What was told last.
    windows
        Of the files whose stamps have been read; of the others it is not known yet.
    bytes_done
        A file counts in proportion to the windows of it that have been measured; its judgement counts as one more.
    """

    doing: str
    files_done: int
    files: int
    windows_done: int
    windows: int
    bytes_done: int
    bytes: int


Report = Callable[[ProgressTally], None]
"""Is told how far the run has come, from any thread."""
