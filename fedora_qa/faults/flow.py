"""Faults of the order of flow fields."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.fault import Alteration, Fault, Read
from fedora_qa.faults.reversible import streams_in, value_keys
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows


@dataclass(frozen=True, slots=True)
class FlowIntervalShift:
    """Flow belongs to a neighbouring interval.

    Fields at the end of the stream that no row holds are lost, and NaN.

    Attributes
    ----------
    stream
        ``flow``, or a rate.
    intervals
        Number of intervals; positive: fields are stamped too late.
    """

    stream: str
    intervals: int
    cause: ClassVar[str] = "flow_interval_shifted"

    @property
    def magnitude(self) -> float:
        """Number of intervals."""
        return self.intervals

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Store fields in later rows."""
        description = f"{self.stream} is stamped {self.intervals} intervals too late"
        return self._moved(facts, description, self.intervals)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Store fields in earlier rows."""
        return self._moved(facts, f"{self.stream} back by {self.intervals} intervals", -self.intervals)

    def _moved(self, facts: Facts, description: str, later: int) -> Fault:
        streams_in(facts, self.stream)
        keys = value_keys(facts, self.stream)
        return Fault(description, {key: _later_by(later, facts.sizes[key]) for key in keys})


def _later_by(later: int, count: int) -> Alteration:
    """Return the alteration that stores each field ``later`` rows later, and NaN in the rows that become free."""

    def alter(read: Read, start: int, stop: int) -> NDArray[Any]:
        first, last = np.clip((start - later, stop - later), 0, count)
        moved = read(int(first), int(last))
        fields = np.full((stop - start, *moved.shape[1:]), np.nan, moved.dtype)
        begin = int(first) + later - start
        fields[begin : begin + len(moved)] = moved
        return fields

    return alter
