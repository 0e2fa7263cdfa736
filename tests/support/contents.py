"""All that a file holds, for comparisons bit by bit."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

Contents = dict[str, Any]
"""Values of all datasets by path, and of all attributes by ``path@name``."""


def contents_of(path: Path, read: Callable[[h5py.Dataset], Any] = lambda dataset: dataset[()]) -> Contents:
    """Read all of a small file, datasets by ``read``; what several links name is there under each name."""
    contents: Contents = {}

    def add(name: str, thing: h5py.HLObject) -> None:
        if isinstance(thing, h5py.Dataset):
            contents[name] = read(thing)
        contents.update({f"{name}@{key}": value for key, value in thing.attrs.items()})

    with h5py.File(path) as file:
        add("", file)
        file.visititems_links(lambda name, _: add(name, file[name]))
    return contents


class OriginalFile:
    """A small file of which altered copies are read: what a copy stores in the same bytes is not decoded again.

    Attributes
    ----------
    contents
        Of the file. A dataset that a copy stores alike is the same array in the contents of both.
    """

    def __init__(self, path: Path) -> None:
        self._stored: dict[str, Any] = {}
        file_bytes = path.read_bytes()

        def read(dataset: h5py.Dataset) -> Any:
            self._stored[dataset.name] = _stored(dataset, file_bytes)
            return dataset[()]

        self.contents = contents_of(path, read)

    def contents_of_copy(self, copy: Path, *, is_damaged: bool = False) -> Contents:
        """Return the contents of a copy; rows that cannot be read are zero where it is said to be damaged."""
        file_bytes = copy.read_bytes()

        def read(dataset: h5py.Dataset) -> Any:
            if dataset.chunks and self._stored.get(dataset.name) == _stored(dataset, file_bytes):
                return self.contents[dataset.name.removeprefix("/")]
            return _readable_rows(dataset) if is_damaged else dataset[()]

        return contents_of(copy, read)


def _stored(dataset: h5py.Dataset, file_bytes: bytes) -> Any:
    """Return the type, shape, filters and stored bytes of a chunked dataset; None without chunks."""
    if not dataset.chunks:
        return None
    chunks: dict[tuple[int, ...], tuple[int, bytes]] = {}

    def add(chunk: Any) -> None:
        stored = file_bytes[chunk.byte_offset : chunk.byte_offset + chunk.size]
        chunks[chunk.chunk_offset] = (chunk.filter_mask, stored)

    dataset.id.chunk_iter(add)
    return dataset.dtype, dataset.shape, dataset.id.get_create_plist(), chunks


def _readable_rows(dataset: h5py.Dataset) -> Any:
    """Return the values of a dataset, zero in rows whose stored bytes are damaged."""
    if not dataset.chunks:
        return dataset[()]
    values = np.zeros(dataset.shape, dataset.dtype)
    for row in range(len(values)):
        with suppress(OSError):
            values[row] = dataset[row]
    return values
