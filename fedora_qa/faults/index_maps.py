"""Faults of the maps from frames and milliseconds to events, and maps that follow altered timestamps."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.faults.fault import Alteration, Fault, FaultySequence, InapplicableError, Read, RowRange, in_rows
from fedora_qa.layout.canonical import FRAMES_OF_MAP, timestamps_of
from fedora_qa.sequence.facts import Facts, IndexMap
from fedora_qa.sequence.scan import scan
from fedora_qa.sequence.sequence import SequenceRows

Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class IndexShift:
    """Indices are too large by a constant.

    Attributes
    ----------
    stream
        The index map: ``rgb_to_event``, ``depth_to_event`` or ``ms_to_event``.
    events
        Number of events; positive: indices too large.
    rows
        Rows of the map; None: all.
    """

    stream: str
    events: int
    rows: RowRange | None = None
    cause: ClassVar[str] = "index_off_by_one"

    @property
    def magnitude(self) -> float:
        """Number of events."""
        return self.events

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the constant."""
        return self._shifted(facts, self.events, f"{self.stream} is {self.events} events too far")

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the constant."""
        return self._shifted(facts, -self.events, f"{self.stream} back by {self.events} events")

    def _shifted(self, facts: Facts, events: int, description: str) -> Fault:
        return Fault(description, {_key_of(facts, self.stream): in_rows(lambda index: index + events, self.rows)})


@dataclass(frozen=True, slots=True)
class IndexSide:
    """Indices point after the events with the timestamp of the frame.

    Attributes
    ----------
    stream
        The index map: ``rgb_to_event`` or ``depth_to_event``.
    """

    stream: str
    cause: ClassVar[str] = "index_side"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Let correct entries count the events that are not later than the frame."""
        index_map = _map_of(facts, self.stream)
        description = f"{self.stream} points behind equal timestamps"
        return self._exchanged(facts, description, index_map.expected_left, index_map.expected_right)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Let entries that count the events not later than the frame count those before it."""
        index_map = _map_of(facts, self.stream)
        description = f"{self.stream} points to the first of equal timestamps"
        return self._exchanged(facts, description, index_map.expected_right, index_map.expected_left)

    def _exchanged(self, facts: Facts, description: str, before: Int64, after: Int64) -> Fault:
        def alter(read: Read, start: int, stop: int) -> NDArray[Any]:
            stored = read(start, stop)
            return np.where(stored == before[start:stop], after[start:stop], stored)

        return Fault(description, {_key_of(facts, self.stream): alter})


def with_following_maps(facts: Facts, sequence: SequenceRows, fault: Fault) -> Fault:
    """Let the index maps follow the timestamps that an undone fault alters.

    A recorder may have made the maps from the faulty timestamps or from correct ones. Entries that equal the number of
    events before their frame or millisecond, by the timestamps with the fault, get that number by the timestamps
    without it. Others stay.

    Parameters
    ----------
    facts
        Of ``sequence``, with the fault.
    sequence
        The sequence with the fault.
    fault
        Alters timestamps, so that the fault is undone; it may also replace rows of the maps.

    Returns
    -------
    Fault
        With alterations of the maps, which scan the timestamps of events once when a map is read.
    """
    view = FaultySequence(sequence, fault)
    # The length of cells has no influence on the maps.
    index_maps = cache(lambda: scan(view, NS_PER_S).facts.maps_to_events)
    rows = dict(fault.rows)
    for name, index_map in facts.maps_to_events.items():
        key = f"metadata/{name}"
        # Milliseconds have no timestamps of their own.
        if {timestamps_of(FRAMES_OF_MAP.get(name, "events")), timestamps_of("events")} & fault.rows.keys():
            rows[key] = _following(name, index_map, index_maps, fault.rows.get(key))
    return replace(fault, rows=rows)


def _following(
    name: str, index_map: IndexMap, maps_without_fault: Callable[[], Any], replace_rows: Alteration | None
) -> Alteration:
    def expected(start: int, stop: int) -> Int64:
        return index_map.correct[start:stop]

    def alter(read: Read, start: int, stop: int) -> NDArray[Any]:
        # The expected entries of the rows that are read: a fault may replace rows, as those of repeated frames.
        stored, faulty = (replace_rows(rows, start, stop) if replace_rows else rows(start, stop)
                          for rows in (read, expected))  # fmt: skip
        if not np.any(stored == faulty):
            return stored
        return np.where(stored == faulty, maps_without_fault()[name].correct[start:stop], stored)

    return alter


def _map_of(facts: Facts, stream: str) -> IndexMap:
    if stream not in facts.index_maps:
        raise InapplicableError(f"Expected a file with {stream}, its frames and events, got none; name another stream")
    return facts.index_maps[stream]


def _key_of(facts: Facts, stream: str) -> str:
    key = f"metadata/{stream}"
    if key not in facts.layout.bindings:
        raise InapplicableError(f"Expected a file with {key}, got none; name another stream")
    return key
