"""Faults of which rows a stream holds, and in which order: unsorted, repeated, exchanged."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.faults.fault import (
    Alteration,
    Fault,
    InapplicableError,
    Read,
    RowRange,
    row_keys,
    rows_from,
    streams_in,
    value_keys,
    within,
)
from fedora_qa.faults.index_maps import with_following_maps
from fedora_qa.layout.binding import FARTHEST_TIMESTAMP_NS
from fedora_qa.layout.canonical import FRAMES_OF_MAP, timestamps_of
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.facts import Facts, has_place
from fedora_qa.sequence.scan import BLOCK_ROWS
from fedora_qa.sequence.sequence import SequenceRows

Int64 = NDArray[np.int64]
Source = Callable[[Int64], Int64]
"""Maps row numbers (n,) to the numbers (n,) of the rows that replace them."""

_LONGEST_RUN: Final = 1 << 22
"""Most events that are sorted together: their timestamps and their order take 64 MiB."""

_EVENT_COLUMNS: Final = tuple(f"path/events/{name}" for name in "txyp")


@dataclass(frozen=True, slots=True)
class Unsorted:
    """Samples are not in the order of time.

    Planted, successive samples are written in reverse. Undone, all samples of the stream are sorted by time; samples
    of equal timestamps keep their order, and samples whose timestamp has no place in time keep their row.

    Attributes
    ----------
    stream
        With timestamps.
    first_row, count
        The samples that are reversed. They do not limit what is sorted.
    timestamps_only
        Whether timestamps alone are in the wrong order, so that values stay where they are.
    """

    stream: str
    first_row: int
    count: int
    timestamps_only: bool = False
    cause: ClassVar[str] = "unsorted"

    @property
    def magnitude(self) -> float:
        """Number of samples."""
        return self.count

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Reverse the samples."""
        first, stop = self.first_row, self.first_row + self.count

        def reversed_rows(rows: Int64) -> Int64:
            return np.where((rows >= first) & (rows < stop), first + stop - 1 - rows, rows)

        description = f"{self.stream} rows {first} to {stop - 1} are reversed"
        return self._moved(facts, description, dict.fromkeys(streams_in(facts, self.stream), reversed_rows))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Sort by time.

        Raises
        ------
        InapplicableError
            Events have to move so far that more than 2^22 would have to be sorted together.
        """
        sources = {}
        for name in streams_in(facts, self.stream):
            if name == "events":
                sources[name] = _sorted_events(facts, sequence)
            else:
                order = _order_of_time(facts.clocks[name].times_ns)
                sources[name] = _looked_up(order)
        return with_following_maps(facts, sequence, self._moved(facts, f"{self.stream} sorted by time", sources))

    def _moved(self, facts: Facts, description: str, sources: dict[str, Source]) -> Fault:
        rows: dict[str, Alteration] = {}
        for name, source in sources.items():
            keys = [timestamps_of(name)] if self.timestamps_only else row_keys(facts, name)
            rows |= dict.fromkeys(keys, rows_from(source, facts.sizes[timestamps_of(name)]))
        return Fault(description, rows)


@dataclass(frozen=True, slots=True)
class DuplicatedSamples:
    """Samples are written twice.

    Undone, rows that repeat an earlier row of the same timestamp in every value are dropped. Of events, which may
    repeat each other in a correct file, half of the equal rows is dropped, and only within the repeated rows.

    Attributes
    ----------
    stream
        With timestamps.
    first_row, count
        The samples that are written twice; a count of None: all from the first one on.
    as_packet
        Whether the copies follow all together, and not each its sample.
    """

    stream: str
    first_row: int = 0
    count: int | None = None
    as_packet: bool = False
    cause: ClassVar[str] = "duplicated_samples"

    @property
    def magnitude(self) -> float | None:
        """Number of samples."""
        return self.count

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Insert the copies."""
        rows: dict[str, Alteration] = {}
        layout = sequence.layout
        for name in streams_in(facts, self.stream):
            size, first = facts.sizes[timestamps_of(name)], self.first_row
            count = size - first if self.count is None else self.count

            def source(numbers: Int64, first: int = first, count: int = count) -> Int64:
                copied = numbers - first
                doubled = copied % max(count, 1) if self.as_packet else copied // 2
                return np.where(copied < 0, numbers, np.where(copied < 2 * count, first + doubled, numbers - count))

            keys = _keys_of_rows(facts, name)
            rows |= dict.fromkeys(keys, rows_from(source, size))
            layout = _with_more_rows(layout, keys, count)
        return Fault(f"samples of {self.stream} occur twice", rows, layout=layout)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Drop the copies."""
        rows: dict[str, Alteration] = {}
        layout = sequence.layout
        for name in streams_in(facts, self.stream):
            size = facts.sizes[timestamps_of(name)]
            if name == "events":
                stop = size if self.count is None else min(self.first_row + 2 * self.count, size)
                dropped = _repeated_events(sequence, self.first_row, stop)
            else:
                dropped = _repeated_samples(facts, sequence, name)
            keys = _keys_of_rows(facts, name)
            rows |= dict.fromkeys(keys, rows_from(_without(dropped), size))
            layout = _with_more_rows(layout, keys, -len(dropped))
        fault = Fault(f"repeated samples of {self.stream} dropped", rows, layout=layout)
        return with_following_maps(facts, sequence, fault)


@dataclass(frozen=True, slots=True)
class SwappedFrames:
    """Values of samples are exchanged; their timestamps stay.

    Attributes
    ----------
    stream
        Of images.
    pairs
        Pairs of rows, each row in one pair at most.
    """

    stream: str
    pairs: tuple[tuple[int, int], ...]
    cause: ClassVar[str] = "swapped_frames"

    @property
    def magnitude(self) -> float:
        """Distance between the rows of a pair, samples; the largest of all pairs."""
        return max((abs(second - first) for first, second in self.pairs), default=0)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange the values of both rows of each pair."""
        rows = {}
        for key in value_keys(facts, self.stream):
            source = np.arange(facts.sizes[key])
            for first, second in self.pairs:
                if max(first, second) < len(source):
                    source[first], source[second] = second, first
            rows[key] = rows_from(_looked_up(source), len(source))
        return Fault(f"{len(self.pairs)} pairs of {self.stream} rows are exchanged", rows)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange them again: the exchange is its own inverse."""
        return self.plant(facts, sequence)


@dataclass(frozen=True, slots=True)
class RotatedFrames:
    """Frames of a range of rows are in the order of a ring buffer that is read from another frame than the oldest.

    All frames are there; their timestamps stay.

    Attributes
    ----------
    stream
        Of images.
    rows
        The frames of the ring.
    frames
        Number of rows by which values are late; those that leave the range at its end are at its beginning.
    """

    stream: str
    rows: RowRange
    frames: int
    cause: ClassVar[str] = "swapped_frames"

    @property
    def magnitude(self) -> float:
        """Largest distance of a value from its row, samples.

        Of a ring up to the last frame, whose row is not known here, that of all values but those at its seam.
        """
        start, stop = self.rows
        return abs(self.frames) if stop is None else max(abs(self.frames), stop - start - abs(self.frames))

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Rotate the values of the range."""
        return self._rotated(facts, self.frames, f"{self.stream} frames are in the order of a ring")

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Rotate them back."""
        until = "the end" if self.rows[1] is None else self.rows[1] - 1
        description = f"{self.stream} of rows {self.rows[0]} to {until} rotated by {-self.frames} frames"
        return self._rotated(facts, -self.frames, description)

    def _rotated(self, facts: Facts, frames: int, description: str) -> Fault:
        rows = {}
        for key in value_keys(facts, self.stream):
            source = np.arange(facts.sizes[key])
            source[slice(*self.rows)] = np.roll(source[slice(*self.rows)], frames)
            rows[key] = rows_from(_looked_up(source), len(source))
        return Fault(description, rows)


@dataclass(frozen=True, slots=True)
class DelayedFrames:
    """Frames of a range of rows hold the values of other frames, some rows before or after them.

    Attributes
    ----------
    frames
        By which values are late; negative: early.
    offset_ms
        The same, ms.
    rows
        The frames. Those that the values of others have replaced, at one end of them, are lost.
    stream
        ``depth`` or ``rgb``.
    """

    frames: int
    offset_ms: float
    rows: RowRange
    stream: str = "depth"
    cause: ClassVar[str] = "time_offset"

    @property
    def magnitude(self) -> float:
        """Offset, ms."""
        return self.offset_ms

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Replace the values; where the file has no frame so far away, they stay."""
        key, count = self._key_and_count(facts)
        description = f"{self.stream} frames hold the values of row n {-self.frames:+d}"
        return Fault(description, {key: rows_from(self._moved_by(-self.frames), count)})

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Return the values to their frames.

        Lost ones become NaN, which colour does not have: there they pass evenly from the frame before to the one after.
        """
        key, count = self._key_and_count(facts)
        restore = rows_from(self._moved_by(self.frames), count)
        start, stop = self.rows[0], count if self.rows[1] is None else self.rows[1]
        lost = (max(stop - self.frames, start), stop) if self.frames > 0 else (start, min(start - self.frames, stop))
        # The rows, as they are stored, of the frames before and after those that are lost.
        before, after = (stop - 1, min(stop, count - 1)) if self.frames > 0 else (max(start - 1, 0), start)

        def alter(read: Read, first: int, last: int) -> NDArray[Any]:
            frames, rows = restore(read, first, last), np.arange(first, last)
            inside = within(rows, lost)
            if np.issubdtype(frames.dtype, np.floating):
                return np.where(inside.reshape(-1, *(1,) * (frames.ndim - 1)), frames.dtype.type(np.nan), frames)
            for place in np.flatnonzero(inside).tolist():
                share = (first + place - lost[0] + 1) / (lost[1] - lost[0] + 1)
                faded = (1 - share) * read(before, before + 1)[0] + share * read(after, after + 1)[0]
                frames = np.concatenate([frames[:place], np.rint(faded)[np.newaxis].astype(frames.dtype),
                                         frames[place + 1 :]])  # fmt: skip
            return frames

        until = "the end" if self.rows[1] is None else self.rows[1] - 1
        description = f"{self.stream} of rows {self.rows[0]} to {until} {self.offset_ms:.4g} ms earlier"
        return Fault(description, {key: alter})

    def _key_and_count(self, facts: Facts) -> tuple[str, int]:
        streams_in(facts, self.stream)
        (key,) = value_keys(facts, self.stream)
        return key, facts.sizes[key]

    def _moved_by(self, frames: int) -> Source:
        return lambda rows: np.where(within(rows, self.rows), rows + frames, rows)


def _looked_up(source: Int64) -> Source:
    return lambda rows: source[rows]


def _order_of_time(times_ns: Int64) -> Int64:
    """Return the row (n,) that comes at each place in the order of time; equal and unplaced timestamps keep theirs."""
    placed = np.flatnonzero(has_place(times_ns))
    order = np.arange(len(times_ns))
    order[placed] = placed[np.argsort(times_ns[placed], kind="stable")]
    return order


def _sorted_events(facts: Facts, sequence: SequenceRows) -> Source:
    """Return the order of time of events; only runs of rows that sorting moves are ever sorted."""
    key, count = timestamps_of("events"), facts.sizes[timestamps_of("events")]
    runs = _disordered_runs(sequence, key, count)
    longest = max((stop - start for start, stop in runs), default=0)
    if longest > _LONGEST_RUN:
        raise InapplicableError(
            f"Expected events that are sorted within {_LONGEST_RUN} rows, got {longest} to sort together"
        )
    starts, stops = (np.array(ends, dtype=np.int64) for ends in (zip(*runs, strict=True) if runs else ([], [])))

    @lru_cache(maxsize=2)
    def order_of(run: int) -> Int64:
        start, stop = int(starts[run]), int(stops[run])
        return start + _order_of_time(sequence.rows(key, start, stop))

    def source(rows: Int64) -> Int64:
        moved = rows.copy()
        # Rows are successive, so that the runs between the first and the last of them are successive too.
        first, last = np.searchsorted(stops, rows[0], "right"), np.searchsorted(starts, rows[-1], "right")
        for run in range(int(first), int(last)):
            inside = (rows >= starts[run]) & (rows < stops[run])
            moved[inside] = order_of(run)[rows[inside] - starts[run]]
        return moved

    return source


def _disordered_runs(sequence: SequenceRows, key: str, count: int) -> list[tuple[int, int]]:
    """Return the shortest runs of rows (start, stop) within which timestamps must be sorted, in order.

    The order of time may be cut behind a row where no timestamp up to it is later than any behind it.
    """
    blocks = [(start, min(start + BLOCK_ROWS, count)) for start in range(0, count, BLOCK_ROWS)]
    lowest, highest = -FARTHEST_TIMESTAMP_NS, FARTHEST_TIMESTAMP_NS

    def extremes(start: int, stop: int) -> tuple[Int64, Int64]:
        """Return timestamps twice; those without a place in time are earlier than all, and later than all."""
        try:
            times_ns = sequence.rows(key, start, stop)
        except UnreadableRowsError:
            return np.full(stop - start, lowest), np.full(stop - start, highest)
        placed = has_place(times_ns)
        return np.where(placed, times_ns, lowest), np.where(placed, times_ns, highest)

    latest, earliest, is_sorted = (np.empty(len(blocks), dtype) for dtype in (np.int64, np.int64, np.bool_))
    for number, block in enumerate(blocks):
        late, early = extremes(*block)
        latest[number], earliest[number] = late.max(), early.min()
        is_sorted[number] = np.all(np.maximum.accumulate(late)[:-1] <= early[1:])
    # Of each block: the latest timestamp before it, and the earliest behind it.
    before = np.concatenate([[lowest], np.maximum.accumulate(latest)[:-1]]) if blocks else latest
    behind = np.concatenate([np.minimum.accumulate(earliest[::-1])[::-1][1:], [highest]]) if blocks else earliest
    runs: list[tuple[int, int]] = []
    for number, block in enumerate(blocks):
        if is_sorted[number] and before[number] <= earliest[number] and latest[number] <= behind[number]:
            continue
        late, early = extremes(*block)
        up_to = np.maximum(np.maximum.accumulate(late), before[number])
        from_on = np.minimum(np.minimum.accumulate(early[::-1])[::-1], behind[number])
        # Rows of the block behind which the order cannot be cut.
        joined = np.concatenate([up_to[:-1] > from_on[1:], [up_to[-1] > behind[number]]])
        edges = np.flatnonzero(np.diff(joined, prepend=False, append=False))
        for first, stop in zip(edges[::2], edges[1::2], strict=True):
            start, end = block[0] + int(first), block[0] + int(stop) + 1
            if runs and runs[-1][1] > start:
                start = runs.pop()[0]
            runs.append((start, end))
    return runs


def _keys_of_rows(facts: Facts, stream: str) -> tuple[str, ...]:
    """Return the datasets with a row for each row of the stream: its own, and the index map of frames."""
    maps = (f"metadata/{name}" for name, frames in FRAMES_OF_MAP.items() if frames == stream)
    return (*row_keys(facts, stream), *(key for key in maps if key in facts.layout.bindings))


def _with_more_rows(layout: Layout, keys: Iterable[str], more: int) -> Layout:
    bindings = dict(layout.bindings)
    for key in keys:
        binding = bindings[key]
        rows = binding.rows + more
        bindings[key] = replace(binding, rows=rows, shape=(rows, *binding.shape[1:]))
    return replace(layout, bindings=bindings)


def _without(dropped: Int64) -> Source:
    """Return the rows that are left without the dropped ones (m,), which are in order."""
    # Before the dropped row d_i lie d_i - i rows that are kept.
    kept_before = dropped - np.arange(len(dropped))
    return lambda rows: rows + np.searchsorted(kept_before, rows, side="right")


def _repeated_samples(facts: Facts, sequence: SequenceRows, stream: str) -> Int64:
    """Return the rows (m,) that equal the first row of the same timestamp in all values, where both can be read."""
    clock = facts.clocks[stream]
    _, first, inverse = np.unique(clock.times_ns, return_index=True, return_inverse=True)
    original = first[inverse]
    # Samples without a place in time share no timestamp.
    candidates = np.flatnonzero((original != np.arange(len(original))) & has_place(clock.times_ns))
    keys = row_keys(facts, stream)

    def is_repeat(row: int) -> bool:
        earlier = int(original[row])
        try:
            return all(
                _equal(sequence.rows(key, row, row + 1), sequence.rows(key, earlier, earlier + 1)) for key in keys
            )
        except UnreadableRowsError:
            return False

    return np.array([row for row in candidates if is_repeat(int(row))], dtype=np.int64)


def _equal(first: NDArray[Any], second: NDArray[Any]) -> bool:
    return bool(np.array_equal(first, second, equal_nan=first.dtype.kind == "f"))


def _repeated_events(sequence: SequenceRows, start: int, stop: int) -> Int64:
    """Return the rows (m,) of ``start`` to ``stop`` that are copies, in order: every second of equal rows.

    Rows are compared in blocks, which end where the timestamp changes. Copies that lie farther from their event than
    a block are kept.
    """
    dropped = []
    while start < stop:
        end = min(start + BLOCK_ROWS, stop)
        try:
            columns = [sequence.rows(key, start, end).astype(np.int64) for key in _EVENT_COLUMNS]
        except UnreadableRowsError:
            start = end
            continue
        if end < stop:
            # The last timestamp goes on in the next block, unless it fills this one.
            last = int(np.searchsorted(columns[0], columns[0][-1]))
            end = start + last if 0 < last < end - start else end
            columns = [column[: end - start] for column in columns]
        order = np.lexsort(columns)
        ordered = [column[order] for column in columns]
        is_new = np.any([np.diff(column, prepend=column[0] - 1) != 0 for column in ordered], axis=0)
        # Place of each row among its equals: even ones are kept.
        begins = np.flatnonzero(is_new)
        place = np.arange(len(order)) - begins[np.cumsum(is_new) - 1]
        dropped.append(start + np.sort(order[place % 2 == 1]))
        start = end
    return np.concatenate(dropped) if dropped else np.zeros(0, np.int64)
