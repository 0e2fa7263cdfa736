"""List the datasets that lie in a file, whatever they are."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import h5py
import hdf5plugin  # noqa: F401  importing it is how HDF5 learns the Blosc codec
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.links import READ_ERRORS

HEAD_ROWS: Final = 256
"""Rows that are read to guess what a dataset holds."""

_IMAGE_ROWS: Final = 1


@dataclass(frozen=True, slots=True)
class Item:
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
    """Return the paths of all datasets that can be reached without following links out of their group.

    Damaged groups end the walk early; what was found until then is returned. Names that cannot be printed are left
    out: neither a terminal nor a dialect should hold them.
    """
    paths: list[str] = []

    def note(path: str | bytes, found: h5py.Group | h5py.Dataset) -> None:
        if isinstance(path, str) and path.isprintable() and isinstance(found, h5py.Dataset):
            paths.append(path)

    with suppress(*READ_ERRORS):
        file.visititems(note)
    return tuple(paths)


def take_inventory(file: h5py.File) -> tuple[Item, ...]:
    """Return every dataset of numbers of rank 1 or more whose first rows can be read."""
    items: list[Item] = []
    for path in dataset_paths(file):
        with suppress(*READ_ERRORS):
            dataset = file[path]
            outside = dataset.is_virtual or dataset.external
            if dataset.shape and dataset.size and dataset.dtype.kind in "iufb" and not outside:
                rows = _IMAGE_ROWS if dataset.ndim > 2 else HEAD_ROWS
                items.append(Item(path, dataset.shape, dataset.dtype, np.asarray(dataset[:rows])))
    return tuple(items)
