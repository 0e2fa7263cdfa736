"""A step of a file as it travels: the name of a function and what it needs.

Whoever deals out the steps imports none of the functions, and does not look into what they hand on to each other. So
the process of the command loads neither the checks nor HDF5, and touches nothing of a file but its bytes.
"""

import importlib
import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

from fedora_qa.engine.desk import Desk
from fedora_qa.engine.progress import Progress
from fedora_qa.storage.place import Place

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Sealed(Generic[T]):
    """Something on its way through a process that does not look into it."""

    pickled: bytes

    @staticmethod
    def of(value: T) -> "Sealed[T]":
        """Seal a value."""
        return Sealed(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))

    def open(self) -> T:
        """Return the value."""
        return cast(T, pickle.loads(self.pickled))


@dataclass(frozen=True, slots=True)
class Surveyed:
    """A file whose stamps have been scanned: as much of its survey as who deals out its windows needs to know.

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
    """A function of ``steps.py`` by its name, its arguments, and the windows that it is to measure, if any."""

    function: str
    subject: Place | Surveyed
    arguments: tuple[Any, ...] = ()
    windows: Sequence[int] = ()

    def __call__(self, progress: Progress, desk: Desk | None = None) -> Any:
        """Do it, at the desk of the process where it has one."""
        function = getattr(importlib.import_module("fedora_qa.engine.steps"), self.function)
        return function(self, desk or Desk(keeps=False), progress)
