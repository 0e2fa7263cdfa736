"""The arrays of evidence on disk: in one compressed file beside a record, or put aside while others are checked.

The file beside a record is written entirely or not at all, and never unpickled.
"""

import os
import weakref
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import replacing

MOST_BYTES: Final = 4 << 30
"""Most bytes of all arrays, unpacked: arrays of unknown origin must not exhaust the memory of the reader."""

_COMPRESSION: Final = 1
"""Level of zlib: images of 1440x1080 take 0.55 of the time of the default level, and 3% more bytes."""

Arrays = Mapping[str, NDArray[Any]]


def arrays_beside(record_path: Path) -> Path:
    """Return where the arrays of a record lie."""
    return record_path.with_name(record_path.name + ".arrays.npz")


def write_arrays(target: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays by name, entirely or not at all; raises ``TypeError`` for Python objects."""
    for name, array in arrays.items():
        # All arrays are examined first, so that nothing is written if one is refused. Objects need pickle, and reading
        # them back would execute code from the file.
        if array.dtype.hasobject:
            raise TypeError(f"Expected numbers in the evidence {name!r}, got Python objects")
    with (
        replacing(target) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=_COMPRESSION) as packed,
    ):
        for name, array in arrays.items():
            # The size of an entry is not known when its header is written; without zip64 an array over 2 GiB fails.
            with packed.open(f"{name}.npy", "w", force_zip64=True) as entry:  # as numpy.savez has them
                np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)


def read_arrays(path: Path, beginnings: tuple[str, ...] = ("",)) -> dict[str, NDArray[Any]]:
    """Read the arrays that ``write_arrays`` wrote, or those whose names begin with one of ``beginnings``.

    Raises
    ------
    MisuseError
        There is no such file, or it is damaged.
    """
    if not path.is_file():
        raise MisuseError(f"Expected the evidence of the record at {path}, got no such file")
    try:
        with zipfile.ZipFile(path) as packed, np.load(path, allow_pickle=False) as stored:
            # The archive's directory states the unpacked sizes: a small file that unpacks to an enormous one is refused
            # before anything is unpacked.
            if sum(entry.file_size for entry in packed.infolist()) > MOST_BYTES:
                raise MisuseError(f"Expected evidence of {MOST_BYTES >> 20} MiB at most, got more in {path}")
            return {name: stored[name] for name in stored.files if name.startswith(beginnings)}
    # MemoryError as well: a damaged header may state a shape that no memory holds.
    except (OSError, ValueError, MemoryError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as problem:
        raise MisuseError(f"Expected the evidence of the record at {path}, got a damaged file: {problem}") from None


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
