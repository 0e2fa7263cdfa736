"""All that a file holds, for comparisons bit by bit."""

from pathlib import Path
from typing import Any

import h5py

Contents = dict[str, Any]
"""Values of all datasets by path, and of all attributes by ``path@name``."""


def contents_of(path: Path) -> Contents:
    """Read all of a small file; what several links name is there under each name."""
    contents: Contents = {}

    def add(name: str, thing: h5py.HLObject) -> None:
        if isinstance(thing, h5py.Dataset):
            contents[name] = thing[()]
        contents.update({f"{name}@{key}": value for key, value in thing.attrs.items()})

    with h5py.File(path) as file:
        add("", file)
        file.visititems_links(lambda name, _: add(name, file[name]))
    return contents
