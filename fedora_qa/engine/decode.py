"""Decoding as a component of its own: blocks of rows, each decoded once while it is wanted.

Here it runs in the process that measures. Workers with shared memory and limits of their own can stand behind the same
interface (``RowSource``) without any check noticing.
"""

from bisect import bisect_left
from collections import OrderedDict
from math import prod
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

    Where not all fit, what lies before the window goes first, then what lies farthest beyond its end, and then what
    was not used for longest. One check after another goes through the images of a window, and the next window does the
    same with those that follow. So what one check has fetched from beyond the end is wanted again later than anything
    within, although it was used last. What somebody looks at stays: to drop it would free nothing.

    Of what lies before the window, a block as large as the one that is wanted goes first, and leaves its pages to it.
    Otherwise what becomes free lies in places too narrow, which are given back for fresh pages elsewhere: at 1440x1080
    with 310 MB for all, a third of what is decoded went to fresh pages, now a seventh, with as much decoded.

    With 80, 100, 120, 140 and 160 MB at 1440x1080, all checks, 2.6, 2.0, 1.6, 1.4 and 1.2 times the file is decoded;
    were the longest unused to go first, 3.4, 2.2, 1.7, 1.4 and 1.3 times; did one know the future, 2.1, 1.7, 1.5, 1.3
    and 1.1 times.

    A block that cannot be decoded raises ``UnreadableRowsError`` each time it is asked for, and is tried only once.

    Parameters
    ----------
    cache_bytes
        What blocks may fill at most.
    room
        What is left for them at the time; all of that where None.
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
        """What blocks fill, those included that only somebody looks at, and what the next may fill."""
        return self._memory.held_bytes + self._small_bytes

    def begin(self, span: Span) -> None:
        """Be told which window is looked at from now on."""
        if self.memory_budget:
            self.memory_budget.begin_window()
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
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def forget(self) -> None:
        """Drop all blocks, and give their memory back."""
        self._cached.clear()
        self._small_bytes = 0
        self._memory.give_back_all()

    def event_index(self, time_ns: int) -> int:
        """Return the number of events earlier than ``time_ns``, exact where the stamps are in order."""
        block = int(np.searchsorted(self._block_first_ns, time_ns, "left")) - 1
        if block < 0:
            return 0
        start, stop = block * BLOCK_ROWS, min((block + 1) * BLOCK_ROWS, self._event_count)
        timestamps = TIMESTAMPS_OF["events"]
        rows = range(start, stop)  # to join the blocks of a million of them takes longer than to look at twenty
        return start + bisect_left(rows, time_ns, key=lambda row: int(self.rows(timestamps, row, row + 1)[0]))

    def _block(self, key: str, number: int, rows: int) -> NDArray[Any]:
        block = self._cached.get((key, number))
        if block is None:
            block = self._cached[(key, number)] = self._decode(key, number, rows)
        else:
            self._cached.move_to_end((key, number))
        if isinstance(block, UnreadableRowsError):
            raise block.with_traceback(None)  # or each time would add to what the last one has kept alive
        return block

    def _decode(self, key: str, number: int, rows: int) -> Block:
        count = self._sequence.layout.bindings[key].rows
        try:
            block = self._sequence.rows(key, number * rows, min((number + 1) * rows, count), self._place)
        except UnreadableRowsError as error:
            return error
        self.decoded_bytes += block.nbytes
        if block.nbytes < LEAST_BYTES:
            block = np.ascontiguousarray(block)  # compiled loops are made for rows that lie one after another
            self._make_space(block.nbytes)
            self._small_bytes += block.nbytes
        elif not lies_in_pages(block):
            block = self._moved(block)
        block.flags.writeable = False
        return block

    def _place(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return an array to decode a block into, after making room for it where it is large."""
        size = prod(shape) * dtype.itemsize
        if size < LEAST_BYTES:
            return np.empty(shape, dtype)
        self._make_space(size)
        return self._memory.array(shape, dtype)

    def _moved(self, block: NDArray[Any]) -> NDArray[Any]:
        moved = self._place(block.shape, block.dtype)
        moved[...] = block
        return moved

    def _make_space(self, size: int) -> None:
        """Drop blocks until another of this size fits, or all that are left are looked at."""
        most = (
            self.cache_bytes
            if self.memory_budget is None
            else min(self.cache_bytes, self.memory_budget.for_blocks(self.held_bytes))
        )
        while self._memory.used_bytes + self._small_bytes + size > most and self._drop_one(size):
            pass
        while self.held_bytes + self._missing(size) > most and self._memory.give_back():
            pass

    def _missing(self, size: int) -> int:
        return size if size < LEAST_BYTES else self._memory.missing(size)

    def _drop_one(self, wanted_bytes: int) -> bool:
        name = self._to_drop(wanted_bytes)
        if name is None:
            return False
        dropped = self._cached.pop(name)
        if _size(dropped) < LEAST_BYTES:
            self._small_bytes -= _size(dropped)
        return True

    def _to_drop(self, wanted_bytes: int) -> tuple[str, int] | None:
        behind = (name for name, block in self._cached.items() if self._is_behind(*name) and not _is_held(block))
        unseen = (name for name, block in self._cached.items() if not _is_held(block))
        fitting = self._behind_of_size(wanted_bytes) if wanted_bytes >= LEAST_BYTES else None
        return fitting or next(behind, None) or max(unseen, key=self._ahead, default=None)

    def _behind_of_size(self, size: int) -> tuple[str, int] | None:
        blocks = ((name, block) for name, block in self._cached.items() if _size(block) == size)
        return next((name for name, block in blocks if self._is_behind(*name) and not _is_held(block)), None)

    def _is_behind(self, key: str, number: int) -> bool:
        start, _ = self._owned.get(DATASETS[key].stream, (0, 0))
        return (number + 1) * self._sequence.chunk_rows(key) <= start

    def _ahead(self, name: tuple[str, int]) -> float:
        """Return how far beyond the window's end a block begins, as a share of its stream; -1 where it does not."""
        key, number = name
        count = self._sequence.layout.bindings[key].rows
        _, stop = self._owned.get(DATASETS[key].stream, (0, count))
        beyond = number * self._sequence.chunk_rows(key) - stop
        return beyond / count if beyond >= 0 else -1.0


def _is_held(block: Block) -> bool:
    """Whether to drop a block would free nothing: somebody looks at it, or it could not be decoded at all."""
    return isinstance(block, UnreadableRowsError) or is_looked_at(block)


def _size(block: Block) -> int:
    return 0 if isinstance(block, UnreadableRowsError) else block.nbytes
