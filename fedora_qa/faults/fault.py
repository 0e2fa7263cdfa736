"""A fault as data, what it alters of what is read, and the view of a sequence with the fault in it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.binding import Memory
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.sequence import SequenceRows

Read = Callable[[int, int], NDArray[Any]]
"""Gives rows ``start`` to ``stop`` of a dataset as they are stored, in canonical units."""

Alteration = Callable[[Read, int, int], NDArray[Any]]
"""Gives the same rows with the fault in them, as many as were asked for; never writes into what it reads."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that is planted in what is read, never in the file.

    Attributes
    ----------
    description
        What is wrong, in words: ``events 1.9 ms late``.
    rows
        The altered datasets, by canonical key.
    declared, layout
        What the file declares, and where its datasets lie, in place of what it says itself; None: as it is.
    """

    description: str
    rows: Mapping[str, Alteration] = field(default_factory=dict)
    declared: Declared | None = None
    layout: Layout | None = None

    @property
    def moves_time(self) -> bool:
        """Whether timestamps or index maps are altered, so that they must be scanned anew."""
        # Keys outside of path/ are index maps, which the scan compares with event timestamps.
        return any(DATASETS[key].is_timestamps or not key.startswith("path/") for key in self.rows)


def values(alter: Callable[[NDArray[Any]], NDArray[Any]]) -> Alteration:
    """Return the alteration of every value by itself."""
    return lambda read, start, stop: alter(read(start, stop))


def values_by_row(alter: Callable[[NDArray[Any], NDArray[np.int64]], NDArray[Any]]) -> Alteration:
    """Return the alteration of values that depends on their rows: ``alter(values, row_numbers)``."""
    return lambda read, start, stop: alter(read(start, stop), np.arange(start, stop))


def rows_from(source: Callable[[NDArray[np.int64]], NDArray[np.int64]], count: int) -> Alteration:
    """Return the alteration that puts other rows of the same dataset in place: ``source(row_numbers)``.

    Sources outside of the ``count`` rows stay where they are.
    """

    def taken(read: Read, start: int, stop: int) -> NDArray[Any]:
        rows = np.arange(start, stop)
        if not len(rows):
            return read(start, stop)
        wanted = source(rows)
        wanted = np.where((wanted >= 0) & (wanted < count), wanted, rows)
        first = int(wanted.min())
        # One read of the range that holds all sources: datasets are read by ranges of rows.
        return read(first, int(wanted.max()) + 1)[wanted - first]

    return taken


class FaultySequence:
    """A view of a sequence with a fault in it: rows are altered as they are read, the file is never touched.

    Nothing is copied whole.

    Parameters
    ----------
    sequence
        As it is in the file.
    fault
        Its ``declared`` and ``layout`` replace those of the sequence where they are given.
    """

    def __init__(self, sequence: SequenceRows, fault: Fault) -> None:
        self._sequence = sequence
        self._fault = fault
        self.layout: Layout = fault.layout or sequence.layout
        self.declared: Declared = fault.declared or sequence.declared
        self.origin_ns: int = sequence.origin_ns

    def rows(self, key: str, start: int, stop: int, memory: Memory | None = None) -> NDArray[Any]:
        """Return rows ``start`` to ``stop`` (excluded) of a dataset in canonical units, with the fault.

        Raises
        ------
        UnreadableRowsError
            The rows do not decode.
        """
        alter = self._fault.rows.get(key)
        if alter is None:
            return self._sequence.rows(key, start, stop, memory)
        # Without ``memory``: an alteration may read other rows than those it returns, and returns an array of its own.
        return alter(lambda first, last: self._sequence.rows(key, first, last), start, stop)

    def chunk_rows(self, key: str) -> int:
        """Return how many rows of a dataset are stored together."""
        return self._sequence.chunk_rows(key)
