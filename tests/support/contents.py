"""All that a file holds, for comparisons bit by bit."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

Contents = dict[str, Any]
"""Values of all datasets by path, and of all attributes by ``path@name``."""


def _readable_rows(dataset: h5py.Dataset) -> Any:
    """Return the values of a dataset, zero in rows whose stored bytes are damaged."""
    values = np.zeros(dataset.shape, dataset.dtype)
    for row in range(len(values)):
        with suppress(OSError):
            values[row] = dataset[row]
    return values


def contents_of(path: Path, *, is_damaged: bool = False) -> Contents:
    """Read all of a small file; what several links name is there under each name.

    Rows that cannot be read are zero where a file is said to be damaged.
    """
    contents: Contents = {}

    def add(name: str, thing: h5py.HLObject) -> None:
        if isinstance(thing, h5py.Dataset):
            contents[name] = _readable_rows(thing) if is_damaged and thing.chunks else thing[()]
        contents.update({f"{name}@{key}": value for key, value in thing.attrs.items()})

    with h5py.File(path) as file:
        add("", file)
        file.visititems_links(lambda name, _: add(name, file[name]))
    return contents
