"""The arrays of one file, looked up by the names that ``fedora_qa.record.evidence`` gives them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.record.types import FileRecord, Record

Array = NDArray[Any]

_NUMBERS = "buif"
"""Kinds of NumPy types that can be drawn."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Arrays by name, and the title of each array that the record lists."""

    arrays: Mapping[str, Array]
    titles: Mapping[str, str]

    @property
    def missing(self) -> tuple[str, ...]:
        """Names that the record lists and that have no array."""
        return tuple(name for name in self.titles if name not in self.arrays)

    def numbers(self, name: str, *shape: int | None) -> Array | None:
        """Return the array if it holds numbers and has this shape (None: any length but 0), else None."""
        array = self.arrays.get(name)
        if array is None or array.dtype.kind not in _NUMBERS or array.ndim != len(shape) or not array.size:
            return None
        fits = all(wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=True))
        return array if fits else None

    def under(self, *parts: str) -> Iterator[str]:
        """Yield the names below a path, in the order of the record."""
        path = "/".join(parts) + "/"
        return (name for name in self.names() if name.startswith(path))

    def names(self) -> tuple[str, ...]:
        """Return all names: those of the record first, in its order."""
        return tuple(dict.fromkeys([*(name for name in self.titles if name in self.arrays), *self.arrays]))

    def title(self, name: str) -> str:
        """Return the title of an array; its name where it has none."""
        return self.titles.get(name) or name


def evidence_of(record: Record, place: int, arrays: Mapping[str, Array]) -> Evidence:
    """Return the evidence of one file.

    Parameters
    ----------
    place
        Index of the file in the record.
    arrays
        Arrays by name. With several files each name begins with the file's index: ``0/name``.
    """
    file: FileRecord = record.files[place]
    if len(record.files) == 1:
        return Evidence(arrays, file.evidence)
    prefix = f"{place}/"
    own = {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
    return Evidence(own, {name.removeprefix(prefix): title for name, title in file.evidence.items()})


def finite(array: Array) -> NDArray[np.float64]:
    """Return the finite values as one row of float64."""
    values = np.asarray(array, dtype=np.float64).ravel()
    return values[np.isfinite(values)]
