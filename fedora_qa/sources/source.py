"""What every source of rows offers, and how it refuses a file."""

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class SourceError(ValueError):
    """A file that cannot be read as a source of rows; one sentence.

    Attributes
    ----------
    rule
        Short name of the rule that was broken, as of ``layout.hdf5_objects.RefusedError``.
    cause
        Identifier of ``causes.py``.
    """

    def __init__(self, rule: str, cause: str, message: str) -> None:
        super().__init__(message)
        self.rule = rule
        self.cause = cause


class OutsideRows(Protocol):
    """Rows that lie outside of HDF5, along axis 0."""

    @property
    def path(self) -> Path:
        """The file, or the folder of the files, that holds the rows."""
        ...

    @property
    def shape(self) -> tuple[int, ...]:
        """Of all rows."""
        ...

    @property
    def dtype(self) -> np.dtype[Any]:
        """As stored."""
        ...

    @property
    def rows_together(self) -> int:
        """How many rows are stored together; 0 where any number is read alike."""
        ...

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Return rows as stored; raises ``SourceError`` or ``OSError`` where they cannot be read."""
        ...
