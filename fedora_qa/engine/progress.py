"""Progress of one step, and of all files together; seconds of each stage."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

Progress = Callable[[str, int, int], None]
"""Called with the name of the stage, how much of it is done, and of how much."""


MEASURING: Final = "measuring"
"""The stage in which windows are handed to the checks."""


def quiet(what: str, done: int, of: int) -> None:
    """Report no progress."""


@dataclass(frozen=True, slots=True)
class ProgressTally:
    """How far a run over some files has come.

    Attributes
    ----------
    doing
        The last message.
    windows
        Of the files whose timestamps have been read; of the others it is not known yet.
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
"""Called with the progress of the run, from any thread."""


@dataclass(slots=True)
class Stopwatch:
    """Seconds by stage; a stage that is entered again adds to its seconds."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the seconds of the block to the stage."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - began
