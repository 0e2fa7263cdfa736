"""Fault of a clock that was set back, of which the samples were sorted afterwards."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.estimators.clocks.merged_clock import merged_clock
from fedora_qa.faults.fault import Alteration, Fault, InapplicableError, row_keys, rows_from, streams_in, values_by_row
from fedora_qa.faults.index_maps import with_following_maps
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ClockSetBackAndSorted:
    """From a sample on the clock is behind, and samples are sorted by what it says.

    Attributes
    ----------
    stream
        With a regular clock.
    offset_ns
        Offset of the samples behind, ns, negative.
    row
        The first of them.
    """

    stream: str
    offset_ns: float
    row: int
    cause: ClassVar[str] = "time_offset"

    @property
    def magnitude(self) -> float:
        """Offset, ms."""
        return self.offset_ns / NS_PER_MS

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Set the clock back, and sort."""
        rows: dict[str, Alteration] = {}
        for name in streams_in(facts, self.stream):
            times_ns = facts.clocks[name].times_ns.copy()
            times_ns[self.row :] += round(self.offset_ns)
            order = np.argsort(times_ns, kind="stable")
            rows |= _in_order(facts, name, order, times_ns[order])
        return Fault(f"{self.stream} {-self.magnitude:.4g} ms early from row {self.row}, and sorted", rows)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Sort by the samples of the clock before and behind the step, and take the step back.

        Raises
        ------
        InapplicableError
            The timestamps are not those of such a clock.
        """
        rows: dict[str, Alteration] = {}
        for name in streams_in(facts, self.stream):
            times_ns = facts.clocks[name].times_ns
            merged = merged_clock(times_ns, resolution_ns=NS_PER_US)
            if merged is None:
                raise InapplicableError(f"Expected timestamps of a regular clock that was set back, got {name}")
            behind_ns = times_ns[merged.behind] - round(self.offset_ns)
            order = np.concatenate([merged.before, merged.behind])
            rows |= _in_order(facts, name, order, np.concatenate([times_ns[merged.before], behind_ns]))
        description = f"{self.stream} {-self.magnitude:.4g} ms later from row {self.row}, and sorted"
        return with_following_maps(facts, sequence, Fault(description, rows))


def _in_order(facts: Facts, stream: str, order: Int64, times_ns: Int64) -> dict[str, Alteration]:
    """Return the alterations that give a stream its rows (n,) in an order, with timestamps (n,)."""
    key = timestamps_of(stream)
    rows = {each: rows_from(lambda numbers: order[numbers], len(order)) for each in row_keys(facts, stream)}
    return {**rows, key: values_by_row(lambda _, numbers: times_ns[numbers])}
