"""Timestamps first: one cheap pass over all timestamps and index maps, before windows are cut.

Windows do not depend on broken clocks: every item gets its cell of the grid by its *envelope*, the latest timestamp up
to it, which never decreases.
"""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import FRAMES_OF_MAP, MS_TO_EVENT, is_timed, timestamps_of
from fedora_qa.sequence.facts import (
    NEVER_NS,
    Clock,
    EventScan,
    EventStep,
    Facts,
    IndexMap,
    MillisecondMap,
    clock_of,
    far_rows,
    has_place,
    milliseconds_ns,
)
from fedora_qa.sequence.sequence import SequenceRows

Int64 = NDArray[np.int64]

BLOCK_ROWS: Final = 1 << 20
"""Number of event timestamps in a block."""

MOST_CELLS: Final = 1 << 14
"""Largest number of cells that become windows: 54 minutes of 0.2 s. Longer sequences, and timestamps far apart, get
longer cells."""

FARTHEST_INDEX: Final = 1 << 53
"""Largest stored index: larger ones are clipped, so that differences fit int64 and are exact in float64."""

KEPT_STEPS: Final = 8
"""Number of longest steps of either direction that are kept. A clock reset has two; the others give the usual
length."""


@dataclass(frozen=True, slots=True)
class Runs:
    """The grid cell of each row of a stream, as runs of rows.

    Attributes
    ----------
    cells
        (r,) numbers of the cells, not decreasing.
    starts
        (r,) first row of each run.
    count
        Number of rows.
    """

    cells: Int64
    starts: Int64
    count: int


@dataclass(frozen=True, slots=True)
class Scan:
    """Results of the scan.

    Attributes
    ----------
    facts
        The facts of the file.
    runs
        Cells of the rows, by stream.
    cell_ns
        Length of a cell, ns.
    block_first_ns
        (b,) latest timestamp up to the first event of each block, ns from the file's origin.
    """

    facts: Facts
    runs: Mapping[str, Runs]
    cell_ns: int
    block_first_ns: Int64


@dataclass
class _EventTally:
    """Counts over the scanned blocks of event timestamps.

    Attributes
    ----------
    cell_ns
        Length of a cell of the grid.
    frame_timestamps
        By index map: the instants (frames,), ns, whose events are counted.
    latest_ns, earliest_ns, previous_ns
        The largest, smallest and last timestamp so far; the largest and the last are None before the first block.
    count
        Number of events.
    decreases, first_decrease, largest_decrease_ns
        Number of steps backwards, the row of the first, and the length of the longest.
    behind
        Number of events before the envelope.
    grid_ns
        Greatest common divisor of all steps.
    cells, starts
        Runs of rows, block by block.
    block_first_ns
        Envelope at the first event of each block.
    left, right
        By index map: numbers (frames,) of the events that are earlier, and not later, than each instant.
    unreadable
        Rows of the blocks that cannot be decoded.
    unplaced, first_unplaced
        Number of events without a place in time, and the row of the first.
    around
        By index map: the events next to each frame.
    pointed
        By index map: the events that its entries point to.
    instants, shortest_step_ns
        As of ``EventScan``.
    """

    cell_ns: int
    frame_timestamps: Mapping[str, Int64]
    latest_ns: int | None = None
    earliest_ns: int = 0
    count: int = 0
    decreases: int = 0
    first_decrease: int = -1
    largest_decrease_ns: int = 0
    behind: int = 0
    longest_steps: tuple[EventStep, ...] = ()
    grid_ns: int = 0
    previous_ns: int | None = None
    cells: list[Int64] = field(default_factory=list)
    starts: list[Int64] = field(default_factory=list)
    block_first_ns: list[int] = field(default_factory=list)
    left: dict[str, Int64] = field(default_factory=dict)
    right: dict[str, Int64] = field(default_factory=dict)
    unreadable: list[tuple[int, int]] = field(default_factory=list)
    unplaced: int = 0
    first_unplaced: int = -1
    around: Mapping[str, "_NearestEvents"] = field(default_factory=dict)
    pointed: Mapping[str, "_PointedEvents"] = field(default_factory=dict)
    instants: int = 1
    shortest_step_ns: int = 0

    def add(self, start: int, times_ns: Int64) -> None:
        """Add the timestamps of one block, whose first row is ``start``."""
        placed = has_place(times_ns)
        placed[far_rows(times_ns)] = False
        if not np.all(placed):
            self.unplaced += int(np.count_nonzero(~placed))
            self.first_unplaced = self.first_unplaced if self.first_unplaced >= 0 else start + int(np.argmin(placed))
            # An event without a place in time counts as simultaneous with the one before it.
            before = np.maximum.accumulate(np.where(placed, np.arange(len(placed)), -1))
            first_ns = int(times_ns[int(np.argmax(placed))]) if np.any(placed) else 0
            previous_ns = first_ns if self.previous_ns is None else self.previous_ns
            times_ns = np.where(before < 0, previous_ns, times_ns[before])
        # The step between two blocks counts too. The first event of a file gets a step of 0, which alters no count.
        previous_ns = int(times_ns[0]) if self.previous_ns is None else self.previous_ns
        steps = np.diff(times_ns, prepend=previous_ns)
        backwards = np.flatnonzero(steps < 0)
        if len(backwards) and self.first_decrease < 0:
            self.first_decrease = start + int(backwards[0])
        self.decreases += len(backwards)
        self.largest_decrease_ns = max(self.largest_decrease_ns, -int(steps.min()))
        is_forwards = steps > 0
        self.instants += int(np.count_nonzero(is_forwards))
        shortest_ns = int(np.min(steps, where=is_forwards, initial=self.shortest_step_ns or NEVER_NS))
        self.shortest_step_ns = shortest_ns if shortest_ns < NEVER_NS else 0
        self.longest_steps = longest_steps(self.longest_steps, start, previous_ns, times_ns)
        # gcd(g, 0) = g, so that repeated timestamps do not alter the grid.
        self.grid_ns = int(np.gcd(self.grid_ns, np.gcd.reduce(np.abs(steps))))
        low, high = int(times_ns.min()), int(times_ns.max())
        self.earliest_ns = low if self.latest_ns is None else min(self.earliest_ns, low)
        floor = low if self.latest_ns is None else self.latest_ns
        self.block_first_ns.append(max(floor, int(times_ns[0])))
        # Running maximum from the first block on: the envelope of the module docstring.
        envelope = np.maximum(np.maximum.accumulate(times_ns), floor)
        self.behind += int(np.count_nonzero(times_ns < envelope))
        cells = envelope // self.cell_ns
        changes = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1))
        # The first run continues a cell that the previous block began.
        if self.cells and self.cells[-1][-1] == cells[0]:
            changes = changes[1:]
        if len(changes):
            self.cells.append(cells[changes])
            self.starts.append(changes + start)
        # Add, for each frame, the events of this block that are earlier (left) and not later (right).
        ordered: Int64 | None = None
        for name, frames in self.frame_timestamps.items():
            left = self.left.setdefault(name, np.zeros(len(frames), np.int64))
            right = self.right.setdefault(name, np.zeros(len(frames), np.int64))
            # For frames after the block all its events count, for frames before it none; only frames within need a
            # search.
            after = frames > high
            left[after] += len(times_ns)
            right[after] += len(times_ns)
            within = np.flatnonzero((frames >= low) & ~after)
            if len(within):
                if ordered is None:
                    # Counts of blocks add up, so that sorting within a block suffices.
                    ordered = np.sort(times_ns) if np.any(np.diff(times_ns) < 0) else times_ns
                left[within] += np.searchsorted(ordered, frames[within], "left")
                right[within] += np.searchsorted(ordered, frames[within], "right")
        for nearest in self.around.values():
            ordered = np.sort(times_ns) if ordered is None else ordered
            nearest.add(ordered)
        for pointed in self.pointed.values():
            pointed.add(start, times_ns)
        self.latest_ns = max(floor, high)
        self.previous_ns = int(times_ns[-1])
        self.count += len(times_ns)

    def skip(self, start: int, stop: int) -> None:
        """Add a block that cannot be decoded; its events have no place in time."""
        self.unreadable.append((start, stop))
        self.block_first_ns.append(self.latest_ns or 0)


class _PointedEvents:
    """Timestamps of the events that the entries (n,) of a map point to, and of those before them."""

    def __init__(self, entries: Int64) -> None:
        self._entries = entries
        self.times_ns = np.repeat([[-NEVER_NS, NEVER_NS]], len(entries), axis=0)

    def add(self, start: int, times_ns: Int64) -> None:
        """Add a block of event timestamps, whose first row is ``start``."""
        for side, rows in enumerate((self._entries - 1 - start, self._entries - start)):
            within = (rows >= 0) & (rows < len(times_ns))
            self.times_ns[within, side] = times_ns[rows[within]]


class _NearestEvents:
    """Instants of the events next to each frame, before and not before it, and how many events share them."""

    def __init__(self, frames_ns: Int64) -> None:
        self._frames_ns = frames_ns
        self._before = np.full(len(frames_ns), -NEVER_NS)
        self._after = np.full(len(frames_ns), NEVER_NS)
        self._before_count, self._after_count = (np.zeros(len(frames_ns), np.int64) for _ in range(2))

    def add(self, ordered_ns: Int64) -> None:
        """Add a block of event timestamps, ascending."""
        place = np.searchsorted(ordered_ns, self._frames_ns, "left")
        for side, at, rows in (("before", place - 1, place > 0), ("after", place, place < len(ordered_ns))):
            instants = ordered_ns[at[rows]]
            counts = np.searchsorted(ordered_ns, instants, "right") - np.searchsorted(ordered_ns, instants, "left")
            nearest, count = (
                (self._before, self._before_count) if side == "before" else (self._after, self._after_count)
            )
            closer = instants > nearest[rows] if side == "before" else instants < nearest[rows]
            count[rows] = np.where(closer, counts, count[rows] + np.where(instants == nearest[rows], counts, 0))
            nearest[rows] = np.where(closer, instants, nearest[rows])

    def expected(self, stored: Int64, left: Int64) -> Int64:
        """Return the entries (n,) that name the nearest event: those stored where they do, as several events may.

        Parameters
        ----------
        stored
            (n,) entries.
        left
            (n,) number of events earlier than each frame.
        """
        to_before, to_after = self._frames_ns - self._before, self._after - self._frames_ns
        is_before = (to_before <= to_after) & (stored < left) & (stored >= left - self._before_count)
        is_after = (to_after <= to_before) & (stored >= left) & (stored < left + self._after_count)
        return np.where(is_before | is_after, stored, np.where(to_before < to_after, left - 1, left))


def scan(sequence: SequenceRows, cell_ns: int) -> Scan:
    """Scan a sequence's timestamps and index maps: facts, cells of all rows, and an index of event times.

    Parameters
    ----------
    cell_ns
        Length of the windows that will be cut, on a grid that begins at the file's origin.
    """
    streams = set(sequence.layout.streams)
    absent = dict(sequence.layout.absent)
    clocks: dict[str, Clock] = {}
    for stream in sorted(stream for stream in streams - {"events"} if is_timed(stream)):
        key = timestamps_of(stream)
        try:
            timestamps = sequence.rows(key, 0, sequence.layout.bindings[key].rows)
        except UnreadableRowsError as error:
            streams.discard(stream)
            absent[stream] = f"its stamps cannot be read: {error.reason}"
            continue
        # Intervals of flow have a start and an end.
        starts, ends = (timestamps[:, 0], timestamps[:, 1]) if timestamps.ndim == 2 else (timestamps, None)
        clocks[stream] = clock_of(starts, ends)
    frame_timestamps = {
        name: clocks[frames].times_ns
        for name, frames in FRAMES_OF_MAP.items()
        if name in streams and frames in clocks and "events" in streams
    }
    definitions = {name: definition_of_map(sequence, name) for name in frame_timestamps}
    around = {
        name: _NearestEvents(frames_ns)
        for name, frames_ns in frame_timestamps.items()
        if definitions[name] == "nearest_event"
    }
    milliseconds = sequence.layout.bindings.get(MS_TO_EVENT) if "events" in streams else None
    instants_ns, zero_ns = dict(frame_timestamps), 0
    if milliseconds is not None:
        # Milliseconds count on the clock of the stored timestamps, to which an offset may belong.
        zero_ns = sequence.layout.bindings[timestamps_of("events")].offset_ns - sequence.origin_ns
        instants_ns[MS_TO_EVENT] = milliseconds_ns(milliseconds.rows, zero_ns)
    stored_maps = _stored_maps(sequence, instants_ns)
    pointed = {name: _PointedEvents(stored) for name, stored in stored_maps.items() if not definitions.get(name)}
    tally = _EventTally(cell_ns, instants_ns, around=around, pointed=pointed)
    events: EventScan | None = None
    if "events" in streams:
        key = timestamps_of("events")
        count = sequence.layout.bindings[key].rows
        for start in range(0, count, BLOCK_ROWS):
            stop = min(start + BLOCK_ROWS, count)
            try:
                tally.add(start, sequence.rows(key, start, stop))
            except UnreadableRowsError:
                tally.skip(start, stop)
        events = EventScan(
            count=tally.count,
            first_ns=tally.earliest_ns,
            last_ns=tally.latest_ns or 0,
            decreases=tally.decreases,
            first_decrease=tally.first_decrease,
            grid_ns=tally.grid_ns,
            unreadable=tuple(tally.unreadable),
            largest_decrease_ns=tally.largest_decrease_ns,
            behind=tally.behind,
            longest_steps=tally.longest_steps,
            unplaced=tally.unplaced,
            first_unplaced=tally.first_unplaced,
            instants=tally.instants,
            shortest_step_ns=tally.shortest_step_ns,
        )
    index_maps: dict[str, IndexMap] = {}
    millisecond_map: MillisecondMap | None = None
    for name, stored in stored_maps.items():
        none_before = np.zeros(len(instants_ns[name]), np.int64)
        left, right = tally.left.get(name, none_before), tally.right.get(name, none_before)
        pointed_ns = pointed[name].times_ns if name in pointed else None
        if name == MS_TO_EVENT:
            millisecond_map = MillisecondMap(IndexMap(stored, left, right, pointed_ns=pointed_ns), zero_ns)
        else:
            of_frames = _index_map(stored, left, right, tally.count, definitions[name], around.get(name))
            index_maps[name] = replace(of_frames, pointed_ns=pointed_ns)
    origin_ns = sequence.origin_ns
    facts = Facts(
        layout=sequence.layout,
        declared=sequence.declared,
        streams=frozenset(streams),
        absent=absent,
        # An int where it is whole, which is exact.
        origin_us=origin_ns // NS_PER_US if origin_ns % NS_PER_US == 0 else origin_ns / NS_PER_US,
        clocks=clocks,
        events=events,
        index_maps=index_maps,
        sizes={key: binding.rows for key, binding in sequence.layout.bindings.items()},
        millisecond_map=millisecond_map,
    )
    runs, cell_ns = _runs(facts, tally, cell_ns)
    return Scan(facts, runs, cell_ns, np.asarray(tally.block_first_ns, dtype=np.int64))


def _stored_maps(sequence: SequenceRows, names: Iterable[str]) -> dict[str, Int64]:
    """Return the entries of the maps that can be read, by name."""
    entries: dict[str, Int64] = {}
    for name in names:
        key = name if name == MS_TO_EVENT else f"metadata/{name}"
        with suppress(UnreadableRowsError):
            stored = sequence.rows(key, 0, sequence.layout.bindings[key].rows)
            entries[name] = np.clip(stored, -FARTHEST_INDEX, FARTHEST_INDEX)
    return entries


def definition_of_map(sequence: SequenceRows, name: str) -> str:
    """Return the definition of an index map (``conversions.MapDefinition``); empty for that of the layout."""
    conversion = sequence.layout.bindings[f"metadata/{name}"].conversion
    return conversion.name if conversion is not None else ""


def entries_by_definition(definition: str, left: Int64, right: Int64, event_count: int) -> Int64:
    """Return the correct entries (n,) of a map that is made by a definition; of ``nearest_event`` those of the layout.

    Parameters
    ----------
    definition
        One of ``conversions.MapDefinition``; empty for that of the layout.
    left, right
        (n,) number of events earlier than each frame, and not later.
    event_count
        Number of events.
    """
    return {
        "event_not_before": np.where(left < event_count, left, 0),
        "event_before": left - 1,
        "event_after": right,
    }.get(definition, left)


def _index_map(
    stored: Int64, left: Int64, right: Int64, count_of_events: int, definition: str, around: _NearestEvents | None
) -> IndexMap:
    """Return a map whose entries are moved by the difference between its own definition and that of the layout."""
    if not definition:
        return IndexMap(stored, left, right)
    # A view may have more or fewer entries than frames.
    count = min(len(stored), len(left))
    entries = np.full(len(left), -FARTHEST_INDEX)
    entries[:count] = stored[:count]
    by_definition = entries_by_definition(definition, left, right, count_of_events)
    if around is not None:
        by_definition = around.expected(entries, left)
    moved = stored.copy()
    moved[:count] += (left - by_definition)[:count]
    return IndexMap(moved, left, right, by_definition)


def _runs(facts: Facts, tally: _EventTally, cell_ns: int) -> tuple[dict[str, Runs], int]:
    """Return the cells of each stream's rows, and their length: cells are joined until there are few enough."""
    runs = {stream: _runs_of(clock.envelope_ns // cell_ns) for stream, clock in facts.clocks.items() if clock.usable}
    if tally.cells:
        count = facts.sizes[timestamps_of("events")]
        runs["events"] = Runs(np.concatenate(tally.cells), np.concatenate(tally.starts), count)
    cells = [run.cells for run in runs.values()]
    everywhere = np.unique(np.concatenate(cells)) if cells else np.zeros(1, np.int64)
    for stream, clock in facts.clocks.items():
        count = len(clock.times_ns)
        if not clock.usable and count:
            # Rows whose timestamps are not usable are given to the cells in turn, so that they are still decoded.
            runs[stream] = _runs_of(everywhere[np.arange(count) * len(everywhere) // count])
    # The sum is an upper bound of the number of distinct cells, without a union.
    if sum(len(run.cells) for run in runs.values()) <= MOST_CELLS:
        return runs, cell_ns
    # Cells are joined by two, four and so on, as timestamps may be a day apart each. Whole multiples of ``cell_ns``
    # keep all borders on the grid that begins at the origin.
    together = 1
    while len(np.unique(np.concatenate([run.cells // together for run in runs.values()]))) > MOST_CELLS:
        together *= 2
    for stream, run in runs.items():
        joined = run.cells // together
        first = np.flatnonzero(np.diff(joined, prepend=joined[0] - 1)) if len(joined) else joined
        runs[stream] = Runs(joined[first], run.starts[first], run.count)
    return runs, cell_ns * together


def _runs_of(cells: Int64) -> Runs:
    """Return the runs of equal cells; ``cells`` are those of all rows of a stream, (n,), not decreasing, n > 0."""
    starts = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1))
    return Runs(cells[starts], starts, len(cells))


def longest_steps(earlier: Iterable[EventStep], start: int, previous_ns: int, times_ns: Int64) -> tuple[EventStep, ...]:
    """Return the longest steps among known ones and those of a block, in the order of the file.

    Parameters
    ----------
    start
        First row of the block.
    previous_ns
        Timestamp before the block, ns from the file's origin.
    times_ns
        (n,) timestamps of the block, ns from the file's origin.

    Returns
    -------
    tuple
        Up to ``KEPT_STEPS`` of either direction.
    """
    longest = tuple(earlier)
    before_ns = np.concatenate([[previous_ns], times_ns[:-1]])
    steps_ns = times_ns - before_ns
    kept: list[EventStep] = []
    for sign in (1, -1):
        in_direction = [step for step in longest if sign * step.length_ns > 0]
        # Of equal steps the earlier one is kept, so that a block adds longer ones only.
        least = min(sign * step.length_ns for step in in_direction) if len(in_direction) == KEPT_STEPS else 0
        of_block = [
            EventStep(start + int(row), int(before_ns[row]), int(times_ns[row])) for row in _largest(steps_ns, least)
        ]
        np.negative(steps_ns, out=steps_ns)  # the other direction, without another array of 8 MiB
        kept += sorted((*in_direction, *of_block), key=lambda step: -abs(step.length_ns))[:KEPT_STEPS]
    return tuple(sorted(kept, key=lambda step: step.row))


def _largest(values: Int64, least: int) -> NDArray[np.intp]:
    """Return the positions of the largest values above ``least``; among equal values the earlier ones."""
    rows: NDArray[np.intp] = np.flatnonzero(values > least)
    if len(rows) > KEPT_STEPS:
        # Selection in linear time: a block holds 2^20 steps, of which eight are needed.
        least = int(np.partition(values[rows], -KEPT_STEPS)[-KEPT_STEPS])
        # Among equal steps the earliest is taken, so that the result does not depend on the borders of blocks.
        above, equal = rows[values[rows] > least], rows[values[rows] == least]
        rows = np.sort(np.concatenate([above, equal[: KEPT_STEPS - len(above)]]))
    return rows
