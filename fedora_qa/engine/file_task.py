"""A step of a file as it travels: the name of a function and what it needs.

The process that deals out the steps imports none of the functions, and does not open the values that they hand on to
each other. So the process of the command loads neither the checks nor HDF5, and reads of a file only its bytes.
"""

import importlib
import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, Generic, TypeVar, cast

from fedora_qa.engine.open_file import OpenFile
from fedora_qa.engine.progress import Progress
from fedora_qa.storage.place import Place

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Sealed(Generic[T]):
    """A value on its way through a process that does not open it: as bytes, or as the path of a file.

    States of windows are large, as some checks keep a number for each pixel: a pipe would hold them several times at
    both ends.
    """

    pickled: bytes
    path: Path | None = None

    @staticmethod
    def of(value: T, folder: Path | None = None) -> "Sealed[T]":
        """Seal a value, in a new file where there is a folder for such."""
        if folder is None:
            return Sealed(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))
        # Not deleted when closed: another process opens it by name, and ``discard`` removes it.
        with NamedTemporaryFile(dir=folder, delete=False) as file:
            pickle.dump(value, file, pickle.HIGHEST_PROTOCOL)
        return Sealed(b"", Path(file.name))

    def open(self) -> T:
        """Return the value."""
        if self.path is None:
            return cast(T, pickle.loads(self.pickled))
        with self.path.open("rb") as file:
            return cast(T, pickle.load(file))

    def discard(self) -> None:
        """Remove the file, if there is one."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)


@dataclass(frozen=True, slots=True)
class Surveyed:
    """A file whose timestamps have been scanned: the part of its survey that is needed to deal out its windows.

    Attributes
    ----------
    windows
        How many are to be measured.
    survey
        The survey itself.
    """

    path: Place
    windows: int
    survey: Sealed[Any]


@dataclass(frozen=True, slots=True)
class FileTask:
    """A function of ``steps.py`` by its name, its arguments, and the windows that it is to measure, if any.

    ``folder`` is where to leave large values; where None, they are part of the answer.
    """

    function: str
    subject: Place | Surveyed
    arguments: tuple[Any, ...] = ()
    windows: Sequence[int] = ()
    folder: Path | None = None

    def __call__(self, progress: Progress, open_file: OpenFile | None = None) -> Any:
        """Do the task, with the open file of the process where it has one."""
        # Imported where the task is done, so that unpickling it loads neither the checks nor HDF5.
        function = getattr(importlib.import_module("fedora_qa.engine.steps"), self.function)
        return function(self, open_file or OpenFile(keeps=False), progress)
