"""Faults that can be undone: each is data with a size, and alters the rows of a sequence in either direction."""

from collections.abc import Callable
from math import hypot
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.fault import Alteration, Fault, values_by_row
from fedora_qa.layout.canonical import datasets_of, spec_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

RowRange = tuple[int, int | None]
"""First row, and the row after the last; None: to the end of the stream."""

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]


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
    """Whether a fault is one of a range of rows, and not of the whole stream."""
    return getattr(fault, "rows", None) is not None


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
