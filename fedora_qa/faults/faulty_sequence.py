"""A view of a sequence with a fault in it: rows are altered as they are read, the file is never touched."""

from typing import Any

from numpy.typing import NDArray

from fedora_qa.faults.fault import Fault
from fedora_qa.layout.binding import Memory
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.sequence import SequenceRows


class FaultySequence:
    """A view of a sequence that passes everything on but what the fault alters. Nothing is copied whole."""

    def __init__(self, sequence: SequenceRows, fault: Fault) -> None:
        self._sequence = sequence
        self._fault = fault
        self.layout: Layout = fault.layout or sequence.layout
        self.declared: Declared = fault.declared or sequence.declared
        self.origin_ns: int = sequence.origin_ns

    def rows(self, key: str, start: int, stop: int, memory: Memory | None = None) -> NDArray[Any]:
        """Return rows in canonical units, with the fault; raises ``UnreadableRowsError``."""
        alter = self._fault.rows.get(key)
        if alter is None:
            return self._sequence.rows(key, start, stop, memory)
        # Without ``memory``: an alteration may read other rows than those it returns, and returns an array of its own.
        return alter(lambda first, last: self._sequence.rows(key, first, last), start, stop)

    def chunk_rows(self, key: str) -> int:
        """Return how many rows are stored together."""
        return self._sequence.chunk_rows(key)
