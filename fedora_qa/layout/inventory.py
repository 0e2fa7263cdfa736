"""What a draft is made from: the datasets of a file, each with its first rows."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import prod
from pathlib import PurePosixPath
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.decodable import require_filters, require_sound_blocks
from fedora_qa.layout.dialect import Form
from fedora_qa.layout.hdf5_objects import READ_ERRORS, RefusedError, walk
from fedora_qa.layout.members import array_of_members, form_of_members
from fedora_qa.layout.metadata import small_values

Fields = dict[str, str | float | list[int] | list[str]]
"""Keys of a dataset's place in a dialect, and their values."""

HEAD_ROWS: Final = 256
"""Rows that are read to guess what a dataset holds."""

_IMAGE_ROWS: Final = 1

_MOST_HEAD_BYTES: Final = 512 << 20
"""Largest decoded size of the first rows. Datasets beyond it could not be checked, and are left out."""

_AXES: Final = ("xyzw", "xyz")
"""Ends of the names of members that are the parts of one vector: quaternions, and all others."""


@dataclass(frozen=True, slots=True)
class StoredObject:
    """A dataset of numbers, with its first rows (of images: its first).

    ``path`` is that of a dataset, or the name or pattern of files in a folder. ``role`` is that of the file, and
    ``form`` its format. ``member`` names an array of NPZ, and ``members`` are those of a compound type, of which
    several are one vector. ``tail`` is the last row, None where it was not read.
    """

    path: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    head: NDArray[Any]
    role: str = ""
    form: Form = "hdf5"
    member: str = ""
    members: tuple[str, ...] = ()
    tail: NDArray[Any] | None = None

    @property
    def place(self) -> Fields:
        """Where it lies, as fields of ``dialect.DatasetPlace``."""
        of_role: Fields = {"file": self.role} if self.role else {}
        path = self.path if self.form == "hdf5" else self.member
        of_members: Fields = {"members": list(self.members)} if self.members else {}
        return {**of_role, "path": path, **of_members} if path else of_role

    @property
    def columns(self) -> tuple[NDArray[np.float64], ...]:
        """The first rows of each column, of text and of single numbers; none for other datasets."""
        if len(self.shape) != 1 and self.form != "text":
            return ()
        return tuple(np.asarray(self.head, np.float64).reshape(len(self.head), -1).T)

    def span(self, column: int) -> float:
        """Return the last less the first number of a column; 0 where the last was not read."""
        if self.tail is None:
            return 0.0
        return float(self.tail.reshape(-1)[column]) - float(self.head.reshape(len(self.head), -1)[0, column])

    @property
    def name(self) -> str:
        """Last part of the address, in lower case, of a file without its ending; of a vector what its members share."""
        if len(self.members) > 1:
            return self.members[0][:-1].strip("_").lower() or "position"
        last = self.address.rsplit("/", 1)[-1].lower()
        return last if self.form == "hdf5" or self.member else PurePosixPath(last).stem

    @property
    def group(self) -> str:
        """The address without its last part."""
        return self.address.rpartition("/")[0]

    @property
    def address(self) -> str:
        """The path, and the member of a compound type below it."""
        return f"{self.path}/{self.members[0]}" if self.members else self.path


def take_inventory(file: h5py.File) -> tuple[StoredObject, ...]:
    """Return every dataset of numbers of rank 1 or more whose first rows can be read, and scalars that are offsets."""
    items: list[StoredObject] = []
    for path in walk(file).paths:
        with suppress(RefusedError, *READ_ERRORS):
            dataset = file[path]
            outside = dataset.is_virtual or dataset.external
            require_filters(dataset, path)
            if dataset.shape == () and "offset" in path.lower() and dataset.dtype.kind in "iuf" and not outside:
                items.append(StoredObject(path, (), dataset.dtype, np.asarray(small_values(dataset, path))))
                continue
            is_table = bool(dataset.dtype.names) and len(dataset.shape or ()) == 1 and not dataset.dtype.hasobject
            numbers = dataset.shape and prod(dataset.shape) and (dataset.dtype.kind in "iufb" or is_table)
            # Values of virtual and external datasets lie in other files, which a draft may not read.
            if not numbers or outside:
                continue
            rows = _IMAGE_ROWS if dataset.ndim > 2 else HEAD_ROWS
            # HDF5 decodes whole chunks even for one row.
            values = max(rows * prod(dataset.shape[1:]), prod(dataset.chunks) if dataset.chunks else 0)
            if values * dataset.dtype.itemsize <= _MOST_HEAD_BYTES:
                require_sound_blocks(dataset, 0, rows)
                if is_table:
                    items += _members(path, dataset)
                else:
                    tail = None
                    with suppress(RefusedError, *READ_ERRORS):
                        if len(dataset.shape) < 3:
                            require_sound_blocks(dataset, len(dataset) - 1, len(dataset))
                            tail = np.asarray(dataset[-1])
                    head = np.asarray(dataset[:rows])
                    items.append(StoredObject(path, dataset.shape, dataset.dtype, head, tail=tail))
    return tuple(items)


def _members(path: str, dataset: h5py.Dataset) -> Iterator[StoredObject]:
    """Yield the members of a table of a compound type that are numbers, and vectors of those that are its parts."""
    names = [name for name in dataset.dtype.names if name.isprintable() and dataset.dtype[name].base.kind in "iufb"]
    vectors = [
        members
        for axes in _AXES
        for stem in dict.fromkeys(name[:-1] for name in names)
        # Three of the four parts of a quaternion are no vector.
        if set(members := tuple(f"{stem}{axis}" for axis in axes)) <= set(names)
        and (len(axes) == 4 or f"{stem}w" not in names)
    ]
    for members in (*vectors, *((name,) for name in names)):
        with suppress(RefusedError):
            form = form_of_members(dataset, members, path)
            head = array_of_members(dataset.fields(list(members))[:HEAD_ROWS], members)
            yield StoredObject(path, form.shape, form.dtype, head, members=members)
