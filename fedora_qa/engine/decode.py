"""Decoding as a component of its own: blocks of rows, each decoded once while it is needed.

Here it runs in the process that measures. Workers with shared memory and limits of their own can implement the same
interface (``RowSource``) without a change of any check.
"""

from bisect import bisect_left
from collections import OrderedDict
from math import inf, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.engine.block_memory import LEAST_BYTES, BlockMemory, is_looked_at, lies_in_pages
from fedora_qa.engine.memory_budget import MemoryBudget
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import DATASETS, TIMESTAMPS_OF
from fedora_qa.sequence.scan import BLOCK_ROWS, Scan
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.window import Span

Block = NDArray[Any] | UnreadableRowsError


class BlockDecoder:
    """Decodes stored blocks on demand and keeps some within a limit of bytes.

    Where not all fit, blocks before the window are dropped first, then those farthest beyond its end, then the least
    recently used. One check after another reads the images of a window, and the next window does the same with those
    that follow. So a block that one check has read beyond the end is needed again later than any block within, although
    it was used last. A block of which views exist is not dropped: that would free nothing.

    Of the blocks before the window, one of the size that is needed is dropped first, so that the new one takes its
    pages. Otherwise free pages lie in gaps too narrow, which are returned to the system for fresh pages elsewhere: at
    1440x1080 with 310 MB for all, a third of the decoded bytes went to fresh pages, now a seventh.

    With 80, 100, 120, 140 and 160 MB at 1440x1080 and all checks, 2.6, 2.0, 1.6, 1.4 and 1.2 times the file is decoded.
    If the least recently used were dropped first, it would be 3.4, 2.2, 1.7, 1.4 and 1.3 times; with knowledge of all
    later reads 2.1, 1.7, 1.5, 1.3 and 1.1 times.

    A block that cannot be decoded raises ``UnreadableRowsError`` at each read, and is tried only once.

    Parameters
    ----------
    sequence
        The open file whose stored rows are decoded.
    scan
        Its timestamps, of which the first of every block of events locates events in time.
    cache_bytes
        Most bytes that blocks may fill.
    memory_budget
        Limits blocks further to the bytes that are left at the time; no further limit where None.
    """

    def __init__(
        self, sequence: SequenceRows, scan: Scan, cache_bytes: int, memory_budget: MemoryBudget | None = None
    ) -> None:
        self._sequence = sequence
        self._block_first_ns = scan.block_first_ns
        self._event_count = scan.facts.events.count if scan.facts.events else 0
        self.cache_bytes = cache_bytes
        self.memory_budget = memory_budget
        self._memory = BlockMemory()
        self._cached: OrderedDict[tuple[str, int], Block] = OrderedDict()
        self._small_bytes = 0
        self._owned: dict[str, tuple[int, int]] = {}
        self.decoded_bytes = 0
        """Bytes decoded so far, for the record's run."""

    @property
    def held_bytes(self) -> int:
        """Bytes of blocks, dropped ones of which views exist included, and of pages that the next block may fill."""
        return self._memory.held_bytes + self._small_bytes

    def begin(self, span: Span) -> None:
        """Note which window is read from now on."""
        if self.memory_budget:
            self.memory_budget.begin_window()
        # A stream without rows in this window keeps its last ones, so that its older blocks still count as behind.
        self._owned |= span.owned

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows in canonical units, read-only; raises ``UnreadableRowsError``."""
        if stop <= start:
            return self._sequence.rows(key, 0, 0)
        rows = self._sequence.chunk_rows(key)
        blocks = range(start // rows, (stop - 1) // rows + 1)
        parts = [
            self._block(key, number, rows)[max(start - number * rows, 0) : stop - number * rows] for number in blocks
        ]
        # Rows within one block are returned as a view, without a copy.
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def forget(self) -> None:
        """Drop all blocks, and give their memory back."""
        self._cached.clear()
        self._small_bytes = 0
        self._memory.give_back_all()

    def event_index(self, time_ns: int) -> int:
        """Return the number of events earlier than ``time_ns``, exact where the timestamps are in order."""
        # The last block whose first event is earlier: the boundary lies within it, or at its end.
        block = int(np.searchsorted(self._block_first_ns, time_ns, "left")) - 1
        if block < 0:
            return 0
        start, stop = block * BLOCK_ROWS, min((block + 1) * BLOCK_ROWS, self._event_count)
        timestamps = TIMESTAMPS_OF["events"]
        # Bisection reads about twenty of up to a million timestamps; to concatenate them all would take longer.
        rows = range(start, stop)
        return start + bisect_left(rows, time_ns, key=lambda row: int(self.rows(timestamps, row, row + 1)[0]))

    def _block(self, key: str, number: int, rows: int) -> NDArray[Any]:
        block = self._cached.get((key, number))
        if block is None:
            block = self._cached[(key, number)] = self._decode(key, number, rows)
        else:
            self._cached.move_to_end((key, number))
        if isinstance(block, UnreadableRowsError):
            # Each raise extends the traceback, whose frames would keep their arrays alive for the rest of the run.
            raise block.with_traceback(None)
        return block

    def _decode(self, key: str, number: int, rows: int) -> Block:
        count = self._sequence.layout.bindings[key].rows
        try:
            block = self._sequence.rows(key, number * rows, min((number + 1) * rows, count), self._place)
        except UnreadableRowsError as error:
            # Cached like a block, so that damaged rows are decoded only once.
            return error
        self.decoded_bytes += block.nbytes
        if block.nbytes < LEAST_BYTES:
            # Compiled loops are specialised for contiguous rows.
            block = np.ascontiguousarray(block)
            self._make_space(block.nbytes)
            self._small_bytes += block.nbytes
        # Images whose units are converted come in an array of their own (``Sequence.rows``).
        elif not lies_in_pages(block):
            moved = self._place(block.shape, block.dtype)
            moved[...] = block
            block = moved
        # Several checks read the same block: none may change what the next one reads.
        block.flags.writeable = False
        return block

    def _place(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return an array to decode a block into, after making space for it where it is large."""
        size = prod(shape) * dtype.itemsize
        if size < LEAST_BYTES:
            return np.empty(shape, dtype)
        self._make_space(size)
        return self._memory.array(shape, dtype)

    def _make_space(self, size: int) -> None:
        """Drop blocks until another of this size fits, or until views exist of all that are left."""
        most = (
            self.cache_bytes
            if self.memory_budget is None
            else min(self.cache_bytes, self.memory_budget.for_blocks(self.held_bytes))
        )
        while self._memory.used_bytes + self._small_bytes + size > most:
            name = self._to_drop(size)
            if name is None:
                break
            # No name refers to the dropped block, so that its memory is free at once.
            dropped_bytes = _size(self._cached.pop(name))
            if dropped_bytes < LEAST_BYTES:
                self._small_bytes -= dropped_bytes
        # Pages of dropped blocks may fit no block of this size: what exceeds the limit goes back to the system.
        while (
            self.held_bytes + (size if size < LEAST_BYTES else self._memory.missing(size)) > most
            and self._memory.give_back()
        ):
            pass

    def _to_drop(self, wanted_bytes: int) -> tuple[str, int] | None:
        """Return the block to be dropped first; None where views exist of all that are left.

        A function of its own: what refers to blocks while it searches is gone when it returns.
        """
        # Before the window, one of the wanted size first: the new block takes its pages.
        if wanted_bytes >= LEAST_BYTES:
            for name, block in self._cached.items():
                if _size(block) == wanted_bytes and self._is_behind(*name) and not _is_held(block):
                    return name
        for name, block in self._cached.items():
            if self._is_behind(*name) and not _is_held(block):
                return name
        # Then the block that begins farthest beyond the window's end; within the window all are equal, and the first is
        # the least recently used, as the cache is in that order.
        farthest, longest = None, -inf
        for name, block in self._cached.items():
            if _is_held(block):
                continue
            key, number = name
            count = self._sequence.layout.bindings[key].rows
            _, stop = self._owned.get(DATASETS[key].stream, (0, count))
            beyond = number * self._sequence.chunk_rows(key) - stop
            # As a share of its stream, distances in streams of different rates compare as times.
            share = beyond / count if beyond >= 0 else -1.0
            if share > longest:
                farthest, longest = name, share
        return farthest

    def _is_behind(self, key: str, number: int) -> bool:
        start, _ = self._owned.get(DATASETS[key].stream, (0, 0))
        return (number + 1) * self._sequence.chunk_rows(key) <= start


def _is_held(block: Block) -> bool:
    """Whether to drop a block would free nothing: views of it exist, or it could not be decoded at all."""
    return isinstance(block, UnreadableRowsError) or is_looked_at(block)


def _size(block: Block) -> int:
    return 0 if isinstance(block, UnreadableRowsError) else block.nbytes
