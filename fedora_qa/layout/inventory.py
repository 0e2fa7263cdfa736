"""List the datasets that lie in a file, whatever they are."""

from contextlib import suppress
from dataclasses import dataclass
from math import prod
from typing import Any, Final

import h5py
import hdf5plugin  # noqa: F401  importing it is how HDF5 learns the Blosc codec
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.filters import require_filters
from fedora_qa.layout.links import READ_ERRORS, RefusedError
from fedora_qa.layout.walk import walk

HEAD_ROWS: Final = 256
"""Rows that are read to guess what a dataset holds."""

_IMAGE_ROWS: Final = 1

_MOST_HEAD_BYTES: Final = 512 << 20
"""Decoded for the first rows. What takes more is no dataset that could be checked, and is left out."""


@dataclass(frozen=True, slots=True)
class StoredObject:
    """A dataset of numbers, with its first rows (of images: its first)."""

    path: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    head: NDArray[Any]

    @property
    def name(self) -> str:
        """Last part of the path, in lower case."""
        return self.path.rsplit("/", 1)[-1].lower()

    @property
    def group(self) -> str:
        """The path without its last part."""
        return self.path.rpartition("/")[0]


def dataset_paths(file: h5py.File) -> tuple[str, ...]:
    """Return the paths of the datasets that ``walk`` finds."""
    return walk(file).paths


def take_inventory(file: h5py.File) -> tuple[StoredObject, ...]:
    """Return every dataset of numbers of rank 1 or more whose first rows can be read."""
    items: list[StoredObject] = []
    for path in dataset_paths(file):
        with suppress(RefusedError, *READ_ERRORS):
            dataset = file[path]
            outside = dataset.is_virtual or dataset.external
            require_filters(dataset, path)
            numbers = dataset.shape and prod(dataset.shape) and dataset.dtype.kind in "iufb"
            # Values of virtual and external datasets lie in other files, which a draft may not read.
            if numbers and not outside and _head_bytes(dataset) <= _MOST_HEAD_BYTES:
                rows = _IMAGE_ROWS if dataset.ndim > 2 else HEAD_ROWS
                items.append(StoredObject(path, dataset.shape, dataset.dtype, np.asarray(dataset[:rows])))
    return tuple(items)


def _head_bytes(dataset: h5py.Dataset) -> int:
    """Return what decoding the first rows takes: whole chunks, or the rows alone."""
    rows = _IMAGE_ROWS if dataset.ndim > 2 else HEAD_ROWS
    chunk = prod(dataset.chunks) if dataset.chunks else 0
    row = prod(dataset.shape[1:])
    # HDF5 decodes whole chunks even for one row.
    return int(max(rows * row, chunk) * dataset.dtype.itemsize)
