"""Evidence of many files, put aside on disk while others are checked: memory does not grow with their number."""

import os
import weakref
from collections.abc import Iterator, Mapping
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]


class ArrayStore:
    """A temporary file without a name: the system removes it with the process, whatever ends that."""

    def __init__(self) -> None:
        # It lives as long as the store, to which the arrays refer; no block of code begins and ends with it.
        self._file = TemporaryFile()  # noqa: SIM115
        weakref.finalize(self, self._file.close)

    def put(self, arrays: Arrays) -> "StoredArrays":
        """Write arrays to the end of the file, and return them as a mapping that reads each when it is asked for.

        Raises
        ------
        ValueError
            An array holds Python objects.
        """
        places: dict[str, int] = {}
        self._file.seek(0, os.SEEK_END)
        for name, array in arrays.items():
            places[name] = self._file.tell()
            np.lib.format.write_array(self._file, np.asanyarray(array), allow_pickle=False)
        return StoredArrays(self, places)

    def read(self, place: int) -> NDArray[Any]:
        """Return the array that begins at a place of the file, bytes."""
        self._file.seek(place)
        array: NDArray[Any] = np.lib.format.read_array(self._file, allow_pickle=False)
        return array


class StoredArrays(Mapping[str, NDArray[Any]]):
    """Arrays of a store, by name.

    Parameters
    ----------
    store
        Holds the arrays.
    places
        Where each begins in its file, bytes.
    """

    def __init__(self, store: ArrayStore, places: Mapping[str, int]) -> None:
        self._store = store
        self._places = places

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Read an array."""
        return self._store.read(self._places[name])

    def __iter__(self) -> Iterator[str]:
        """Yield the names, in the order in which the arrays were put."""
        return iter(self._places)

    def __len__(self) -> int:
        """Return how many arrays there are."""
        return len(self._places)
