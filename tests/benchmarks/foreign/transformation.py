"""A change to a file of the reference generator that leaves it correct."""

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256

import h5py

Change = Callable[[h5py.File], None]
"""Alters an open copy of a clean sequence."""


@dataclass(frozen=True, slots=True)
class Transformation:
    """One way in which a correct file differs from those of the reference generator.

    Attributes
    ----------
    name
        In the table, and of the files.
    change
        What is done to a copy.
    alters
        Beginnings of the paths of the objects that it alters; all else stays as it was, to the bit.
    maker
        Who makes such files, and why they stay correct.
    """

    name: str
    change: Change
    alters: tuple[str, ...]
    maker: str

    @property
    def held_out(self) -> bool:
        """Whether nobody looks at its outcomes while the checks are built: a third of all, by a hash of the name."""
        return sha256(self.name.encode()).digest()[0] % 3 == 0
