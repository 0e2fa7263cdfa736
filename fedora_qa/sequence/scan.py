"""Timestamps first: one cheap pass over all timestamps and index maps, before windows are cut.

Broken clocks can then not break the windows: every item is given a place on the grid by its *envelope*, the latest
timestamp up to it, which never decreases.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import TIMESTAMPS_OF
from fedora_qa.sequence.event_steps import longest_steps
from fedora_qa.sequence.facts import Clock, EventScan, EventStep, Facts, IndexMap
from fedora_qa.sequence.sequence import SequenceRows

Int64 = NDArray[np.int64]

BLOCK_ROWS = 1 << 20
"""Event timestamps looked at together."""

MOST_CELLS: Final = 1 << 14
"""Cells that become windows: 54 minutes of 0.2 s. Longer sequences, and timestamps far apart, get longer cells."""

FARTHEST_INDEX: Final = 1 << 53
"""Stored indices saturate here, so that differences of two fit int64, and float64 holds them."""

FRAMES_OF_MAP = {"rgb_to_event": "rgb", "depth_to_event": "depth"}


@dataclass(frozen=True, slots=True)
class Runs:
    """Which grid cell each row of a stream falls into: cell ``cells[i]`` begins at row ``starts[i]``."""

    cells: Int64
    starts: Int64
    count: int


@dataclass(frozen=True, slots=True)
class Scan:
    """What the scan found: the facts, each stream's place on the grid, and an index of event times.

    ``block_first_ns[i]`` is the latest timestamp up to the first event of block i.
    """

    facts: Facts
    runs: Mapping[str, Runs]
    cell_ns: int
    block_first_ns: Int64


@dataclass
class _EventTally:
    """Counts over the blocks of event timestamps seen so far."""

    cell_ns: int
    frame_timestamps: Mapping[str, Int64]
    latest: int | None = None
    earliest: int = 0
    count: int = 0
    decreases: int = 0
    first_decrease: int = -1
    largest_decrease: int = 0
    behind: int = 0
    longest_steps: tuple[EventStep, ...] = ()
    grid: int = 0
    previous: int | None = None
    cells: list[Int64] = field(default_factory=list)
    starts: list[Int64] = field(default_factory=list)
    block_first: list[int] = field(default_factory=list)
    left: dict[str, Int64] = field(default_factory=dict)
    right: dict[str, Int64] = field(default_factory=dict)
    unreadable: list[tuple[int, int]] = field(default_factory=list)

    def add(self, start: int, times_ns: Int64) -> None:
        """Take in the timestamps of one block, whose first row is ``start``."""
        # The step between two blocks counts too. The first event of a file gets a step of 0, which alters no count.
        previous = int(times_ns[0]) if self.previous is None else self.previous
        steps = np.diff(times_ns, prepend=previous)
        backwards = np.flatnonzero(steps < 0)
        if len(backwards) and self.first_decrease < 0:
            self.first_decrease = start + int(backwards[0])
        self.decreases += len(backwards)
        self.largest_decrease = max(self.largest_decrease, -int(steps.min()))
        self.longest_steps = longest_steps(self.longest_steps, start, previous, times_ns)
        # gcd(g, 0) = g, so that repeated timestamps do not alter the grid.
        self.grid = int(np.gcd(self.grid, np.gcd.reduce(np.abs(steps))))
        low, high = int(times_ns.min()), int(times_ns.max())
        self.earliest = low if self.latest is None else min(self.earliest, low)
        floor = low if self.latest is None else self.latest
        self.block_first.append(max(floor, int(times_ns[0])))
        # Running maximum from the first block on: the envelope of the module docstring.
        envelope = np.maximum(np.maximum.accumulate(times_ns), floor)
        self.behind += int(np.count_nonzero(times_ns < envelope))
        self._place(start, envelope)
        # Add, for each frame, the events of this block that are earlier (left) and not later (right).
        ordered: Int64 | None = None
        for name, frames in self.frame_timestamps.items():
            left = self.left.setdefault(name, np.zeros(len(frames), np.int64))
            right = self.right.setdefault(name, np.zeros(len(frames), np.int64))
            # A frame after the block counts all its events, a frame before it none; only frames within need a search.
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
        self.latest = max(floor, high)
        self.previous = int(times_ns[-1])
        self.count += len(times_ns)

    def skip(self, start: int, stop: int) -> None:
        """Note a block that cannot be decoded; its events have no place in time."""
        self.unreadable.append((start, stop))
        self.block_first.append(self.latest or 0)

    def _place(self, start: int, envelope: Int64) -> None:
        cells = envelope // self.cell_ns
        changes = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1))
        # The first run continues a cell that the previous block began.
        if self.cells and self.cells[-1][-1] == cells[0]:
            changes = changes[1:]
        if len(changes):
            self.cells.append(cells[changes])
            self.starts.append(changes + start)


def scan(sequence: SequenceRows, cell_ns: int) -> Scan:
    """Scan a sequence's timestamps and index maps.

    Parameters
    ----------
    sequence
        The open file.
    cell_ns
        Length of the windows that will be cut, on a grid that begins at the file's origin.
    """
    streams = set(sequence.layout.streams)
    absent = dict(sequence.layout.absent)
    clocks: dict[str, Clock] = {}
    for stream in sorted(streams & set(TIMESTAMPS_OF) - {"events"}):
        try:
            clocks[stream] = _read_clock(sequence, stream)
        except UnreadableRowsError as error:
            streams.discard(stream)
            absent[stream] = f"its stamps cannot be read: {error.reason}"
    frame_timestamps = {
        name: clocks[frames].times_ns
        for name, frames in FRAMES_OF_MAP.items()
        if name in streams and frames in clocks and "events" in streams
    }
    tally = _EventTally(cell_ns, frame_timestamps)
    if "events" in streams:
        _tally_events(sequence, tally)
    facts = Facts(
        layout=sequence.layout,
        declared=sequence.declared,
        streams=frozenset(streams),
        absent=absent,
        origin_us=_exact_us(sequence.origin_ns),
        clocks=clocks,
        events=_event_scan(tally) if "events" in streams else None,
        index_maps=_index_maps(sequence, tally),
        sizes={key: binding.rows for key, binding in sequence.layout.bindings.items()},
    )
    runs, cell_ns = _few_cells(_runs(facts, tally, cell_ns), cell_ns)
    return Scan(facts, runs, cell_ns, np.asarray(tally.block_first, dtype=np.int64))


def _read_clock(sequence: SequenceRows, stream: str) -> Clock:
    key = TIMESTAMPS_OF[stream]
    timestamps = sequence.rows(key, 0, sequence.layout.bindings[key].rows)
    starts, ends = (timestamps[:, 0], timestamps[:, 1]) if timestamps.ndim == 2 else (timestamps, None)
    # Against the running maximum, not the neighbour: after a jump forwards and back, timestamps are behind until they
    # exceed the jump.
    before = np.maximum.accumulate(starts[:-1]) if len(starts) else starts
    advancing = np.ones(len(starts), dtype=bool)
    advancing[1:] = starts[1:] > before
    return Clock(starts, ends, advancing)


def _tally_events(sequence: SequenceRows, tally: _EventTally) -> None:
    key = TIMESTAMPS_OF["events"]
    count = sequence.layout.bindings[key].rows
    for start in range(0, count, BLOCK_ROWS):
        stop = min(start + BLOCK_ROWS, count)
        try:
            tally.add(start, sequence.rows(key, start, stop))
        except UnreadableRowsError:
            tally.skip(start, stop)


def _event_scan(tally: _EventTally) -> EventScan:
    return EventScan(
        count=tally.count,
        first_ns=tally.earliest,
        last_ns=tally.latest or 0,
        decreases=tally.decreases,
        first_decrease=tally.first_decrease,
        grid_ns=tally.grid,
        unreadable=tuple(tally.unreadable),
        largest_decrease_ns=tally.largest_decrease,
        behind=tally.behind,
        longest_steps=tally.longest_steps,
    )


def _index_maps(sequence: SequenceRows, tally: _EventTally) -> dict[str, IndexMap]:
    maps: dict[str, IndexMap] = {}
    for name, frames in tally.frame_timestamps.items():
        key = f"metadata/{name}"
        try:
            stored = sequence.rows(key, 0, sequence.layout.bindings[key].rows)
        except UnreadableRowsError:
            continue
        none_before = np.zeros(len(frames), np.int64)
        stored = np.clip(stored, -FARTHEST_INDEX, FARTHEST_INDEX)
        maps[name] = IndexMap(stored, tally.left.get(name, none_before), tally.right.get(name, none_before))
    return maps


def _runs(facts: Facts, tally: _EventTally, cell_ns: int) -> dict[str, Runs]:
    runs = {stream: _runs_of(clock, cell_ns) for stream, clock in facts.clocks.items() if clock.usable}
    if tally.cells:
        count = facts.sizes[TIMESTAMPS_OF["events"]]
        runs["events"] = Runs(np.concatenate(tally.cells), np.concatenate(tally.starts), count)
    cells = [run.cells for run in runs.values()]
    everywhere = np.unique(np.concatenate(cells)) if cells else np.zeros(1, np.int64)
    for stream, clock in facts.clocks.items():
        if not clock.usable and len(clock.times_ns):
            runs[stream] = _spread_evenly(len(clock.times_ns), everywhere)
    return runs


def _runs_of(clock: Clock, cell_ns: int) -> Runs:
    cells = np.maximum.accumulate(clock.times_ns) // cell_ns
    starts = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1))
    return Runs(cells[starts], starts, len(cells))


def _spread_evenly(count: int, cells: Int64) -> Runs:
    """Give the rows of a stream whose timestamps say nothing to the cells in turn, so that they are still decoded."""
    cell_of_row = cells[np.arange(count) * len(cells) // count]
    starts = np.flatnonzero(np.diff(cell_of_row, prepend=cell_of_row[0] - 1))
    return Runs(cell_of_row[starts], starts, count)


def _few_cells(runs: Mapping[str, Runs], cell_ns: int) -> tuple[Mapping[str, Runs], int]:
    """Join cells by two, four and so on until at most ``MOST_CELLS`` are left: timestamps may be a day apart each."""
    # The sum is an upper bound of the distinct cells and needs no union.
    if sum(len(stream_runs.cells) for stream_runs in runs.values()) <= MOST_CELLS:
        return runs, cell_ns
    together = 1
    # Whole multiples of ``cell_ns`` keep all borders on the grid that begins at the origin.
    while len(np.unique(np.concatenate([stream_runs.cells // together for stream_runs in runs.values()]))) > MOST_CELLS:
        together *= 2
    return {stream: _joined(stream_runs, together) for stream, stream_runs in runs.items()}, cell_ns * together


def _joined(runs: Runs, together: int) -> Runs:
    cells = runs.cells // together
    first = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1)) if len(cells) else cells
    return Runs(cells[first], runs.starts[first], runs.count)


def _exact_us(origin_ns: int) -> float:
    return origin_ns // 1000 if origin_ns % 1000 == 0 else origin_ns / 1000
