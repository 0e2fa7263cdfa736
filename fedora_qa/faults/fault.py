"""A fault as data, the view of a sequence that contains it, and faults that can be undone.

A fault that can be undone is data with a size, and alters the rows of a sequence in either direction.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import hypot
from types import MappingProxyType
from typing import Any, Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.canonical import datasets_of, spec_of
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

_WIDEST_RANGE: Final = 4
"""Ratio up to which a range that holds all sources may exceed the number of rows, to be read at once."""

Read = Callable[[int, int], NDArray[Any]]
"""Returns rows ``start`` to ``stop`` (excluded) of a dataset, without the fault, in canonical units."""

Alteration = Callable[[Read, int, int], NDArray[Any]]
"""Returns rows ``start`` to ``stop`` (excluded) with the fault; never writes into the arrays that it reads."""

RowRange = tuple[int, int | None]
"""First row, and the row after the last; None: to the end of the stream."""

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]


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


Sensor = Literal["gyro", "accelerometer"]
KEYS_OF_SENSORS: Final[Mapping[Sensor, str]] = MappingProxyType(
    {"gyro": "path/imu/angular_velocity", "accelerometer": "path/imu/linear_acceleration"}
)
"""Dataset of the vectors of a sensor of the IMU."""


class InapplicableError(Exception):
    """The fault can be neither planted in this sequence nor undone there; the message states the reason."""


class ReversibleFault(Protocol):
    """A fault with its size, which can be planted in a sequence and undone in another.

    Implementations are frozen dataclasses, whose fields are the sizes that a diagnosis fits. ``undo`` takes a sequence
    that has the fault, whoever made it, and returns what gives the rows without it. Both refer to the rows of the
    sequence to which they are applied, of which ``facts`` must be.
    """

    @property
    def cause(self) -> str:
        """Identifier of the cause, as in ``fedora_qa.causes``."""
        ...

    @property
    def stream(self) -> str:
        """The stream; ``flow`` is every rate."""
        ...

    @property
    def magnitude(self) -> float | None:
        """Size in the unit of the cause, positive for too late or too large; None where the cause has no size."""
        ...

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Return the fault for a view of a sequence without it.

        Parameters
        ----------
        facts
            Of ``sequence``.
        sequence
            The sequence that gets the fault.

        Returns
        -------
        Fault
            For ``FaultySequence(sequence, fault)``.

        Raises
        ------
        InapplicableError
            The sequence lacks a stream or a declaration that the fault needs.
        """
        ...

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Return the alteration for a view of a sequence that has the fault, in which it is undone.

        Parameters and errors are those of ``plant``.
        """
        ...


def streams_in(facts: Facts, stream: str) -> tuple[str, ...]:
    """Return the stream itself, or for ``flow`` every rate of the file; raise ``InapplicableError`` without any."""
    names = facts.flow_streams if stream == "flow" else (stream,)
    present = tuple(name for name in names if name in facts.streams)
    if not present:
        raise InapplicableError(f"Expected a file with the stream {stream}, got none; name a stream of the file")
    return present


def value_keys(facts: Facts, stream: str) -> tuple[str, ...]:
    """Return the datasets of a stream (``flow``: of every rate) that hold its values, without timestamps."""
    specs = (spec for name in streams_in(facts, stream) for spec in datasets_of(name))
    return tuple(spec.key for spec in specs if not spec.is_timestamps)


def row_keys(facts: Facts, stream: str) -> tuple[str, ...]:
    """Return all datasets of one stream that share its rows: timestamps, values, and companions of the values."""
    return tuple(key for key in facts.layout.bindings if spec_of(key).stream == stream)


def is_of_part(fault: ReversibleFault) -> bool:
    """Whether a fault is one of a range of rows or of a rectangle of the image, or begins and ends."""
    return any(getattr(fault, name, None) is not None for name in ("rows", "duration_ns", "region", "while_ns"))


def within(numbers: NDArray[np.int64], rows: RowRange | None) -> NDArray[np.bool_]:
    """Return which row numbers (n,) lie in a range of rows; with None all do."""
    start, stop = rows or (0, None)
    # The comparison with the last number of int64 stands for a range without end.
    return (numbers >= start) & (numbers < (np.iinfo(np.int64).max if stop is None else stop))


def in_rows(alter: Callable[[NDArray[Any]], NDArray[Any]], rows: RowRange | None) -> Alteration:
    """Return the alteration that applies ``alter`` to the values (n, ...) of a range of rows; type and shape stay."""

    def altered(values: NDArray[Any], numbers: NDArray[np.int64]) -> NDArray[Any]:
        inside = within(numbers, rows).reshape(-1, *(1,) * (values.ndim - 1))
        if not np.any(inside):
            return values
        changed = alter(values).astype(values.dtype, copy=False)
        return changed if np.all(inside) else np.where(inside, changed, values)

    return values_by_row(altered)


def signed_length(vector: tuple[float, ...]) -> float:
    """Return the length of a vector with the sign of its largest component, as the magnitude of a cause."""
    largest = max(vector, key=abs)
    return hypot(*vector) if largest >= 0 else -hypot(*vector)
