"""A fault as data, alterations of rows, and the view of a sequence that contains a fault."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.canonical import spec_of
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.sequence import SequenceRows

_WIDEST_RANGE: Final = 4
"""Ratio up to which a range that holds all sources may exceed the number of rows, to be read at once."""

Read = Callable[[int, int], NDArray[Any]]
"""Returns rows ``start`` to ``stop`` (excluded) of a dataset, without the fault, in canonical units."""

Alteration = Callable[[Read, int, int], NDArray[Any]]
"""Returns rows ``start`` to ``stop`` (excluded) with the fault; never writes into the arrays that it reads."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of the rows that are read; the file itself is never changed.

    Attributes
    ----------
    description
        What is wrong, in words: ``events 1.9 ms late``.
    rows
        Alterations of datasets, by canonical key.
    declared, layout
        Declarations and layout that replace those of the file; None: those of the file.
    """

    description: str
    rows: Mapping[str, Alteration] = field(default_factory=dict)
    declared: Declared | None = None
    layout: Layout | None = None

    @property
    def moves_time(self) -> bool:
        """Whether timestamps or index maps are altered, so that they must be scanned again."""
        # Keys outside of path/ are those of index maps, which the scan compares with event timestamps.
        return any(spec_of(key).is_timestamps or not key.startswith("path/") for key in self.rows)


def values(alter: Callable[[NDArray[Any]], NDArray[Any]]) -> Alteration:
    """Return the alteration that applies ``alter`` to the rows (n, ...) that are read."""
    return lambda read, start, stop: alter(read(start, stop))


def values_by_row(alter: Callable[[NDArray[Any], NDArray[np.int64]], NDArray[Any]]) -> Alteration:
    """Return the alteration that applies ``alter(values, row_numbers)`` to rows (n, ...) and their numbers (n,)."""
    return lambda read, start, stop: alter(read(start, stop), np.arange(start, stop))


def rows_from(source: Callable[[NDArray[np.int64]], NDArray[np.int64]], count: int) -> Alteration:
    """Return the alteration that replaces rows by other rows of the same dataset.

    Parameters
    ----------
    source
        Maps row numbers (n,) to the numbers (n,) of the rows that replace them.
    count
        Number of rows of the dataset. A row whose source lies outside of 0 to ``count`` - 1 is not replaced.

    Returns
    -------
    Alteration
        Reads the smallest range of rows that holds all sources, or several ranges where they lie far apart.
    """

    def taken(read: Read, start: int, stop: int) -> NDArray[Any]:
        rows = np.arange(start, stop)
        if not len(rows):
            return read(start, stop)
        wanted = source(rows)
        wanted = np.where((wanted >= 0) & (wanted < count), wanted, rows)
        first, last = int(wanted.min()), int(wanted.max())
        if last - first < _WIDEST_RANGE * len(rows):
            # One read of the range that holds all sources: datasets are read by ranges of rows.
            return read(first, last + 1)[wanted - first]
        # Of sources far apart only the successive ones are read together, so that memory is that of the rows.
        needed = np.unique(wanted)
        runs = np.split(needed, np.flatnonzero(np.diff(needed) > 1) + 1)
        parts = np.concatenate([read(int(run[0]), int(run[-1]) + 1) for run in runs])
        return parts[np.searchsorted(needed, wanted)]

    return taken


class FaultySequence:
    """A view of a sequence that contains a fault. Rows are altered when they are read; the file is never changed.

    No dataset is copied as a whole.

    Parameters
    ----------
    sequence
        The sequence without the fault.
    fault
        The fault. Its ``declared`` and ``layout`` replace those of the sequence where they are not None.

    Attributes
    ----------
    layout, declared
        Layout and declarations with the fault.
    origin_ns
        The origin of the sequence.
    """

    def __init__(self, sequence: SequenceRows, fault: Fault) -> None:
        self._sequence = sequence
        self._fault = fault
        self.layout: Layout = fault.layout or sequence.layout
        self.declared: Declared = fault.declared or sequence.declared
        self.origin_ns: int = sequence.origin_ns

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows of a dataset in canonical units, with the fault.

        Parameters
        ----------
        key
            Canonical key of the dataset.
        start, stop
            First row, and the row after the last one.

        Returns
        -------
        NDArray
            (stop - start, ...); timestamps in int64 ns from the origin.

        Raises
        ------
        UnreadableRowsError
            If the rows do not decode.
        """
        alter = self._fault.rows.get(key)
        if alter is None:
            return self._sequence.rows(key, start, stop)
        return alter(lambda first, last: self._sequence.rows(key, first, last), start, stop)

    def chunk_rows(self, key: str) -> int:
        """Return the number of rows of a dataset that are stored together."""
        return self._sequence.chunk_rows(key)
