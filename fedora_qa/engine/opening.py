"""The task that comes before all others of a file: whether it opens within a limit of time."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fedora_qa.engine.executor import Task
from fedora_qa.engine.task_functions import OPEN_AND_CLOSE
from fedora_qa.storage.opening_limit import opening_limit_s
from fedora_qa.storage.place import Place, RemoteFile

if TYPE_CHECKING:  # loads HDF5
    from fedora_qa.layout.dialect import DialectChoice

_OPENING_S: Final = 60.0
"""A file opens in hundredths of a second, over a slow network in some seconds."""


def opening_test(path: Place, dialect: "DialectChoice" = None, allow_external: Iterable[Path] = ()) -> Task | None:
    """Return the task that tests whether a file opens within a limit of time; None for a file behind a URL.

    Raises
    ------
    MisuseError
        The environment sets a limit that is no number above 0.
    """
    if isinstance(path, RemoteFile):
        return None
    return Task(OPEN_AND_CLOSE, (path, dialect, tuple(allow_external)), limit_s=opening_limit_s(_OPENING_S))
