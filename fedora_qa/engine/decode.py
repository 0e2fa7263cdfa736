"""Decoding as a component of its own: blocks of rows, each decoded once while it is wanted.

Here it runs in the process that measures. Workers with shared memory and limits of their own can stand behind the same
interface (``RowSource``) without any check noticing.
"""

from collections import OrderedDict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import DATASETS, STAMPS_OF
from fedora_qa.sequence.scan import BLOCK_ROWS, Scan
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.window import Span

Block = NDArray[Any] | UnreadableRowsError


class BlockDecoder:
    """Decodes stored blocks on demand and keeps some within a limit of bytes.

    The checks ask for the blocks of a window one after the other. Where these do not all fit, to drop the one that was
    not used for longest would drop each just before it is asked for again. So what lies before the window goes first,
    and then what was used neither lately nor long ago: what a check goes on with is kept, and some of what comes next.

    A block that cannot be decoded raises ``UnreadableRowsError`` each time it is asked for, and is tried only once.
    """

    def __init__(self, sequence: SequenceRows, scan: Scan, cache_bytes: int) -> None:
        self._sequence = sequence
        self._block_first_ns = scan.block_first_ns
        self._event_count = scan.facts.events.count if scan.facts.events else 0
        self.cache_bytes = cache_bytes
        self._cached: OrderedDict[tuple[str, int], Block] = OrderedDict()
        self._cached_bytes = 0
        self._owned_from: dict[str, int] = {}
        self.decoded_bytes = 0
        """Bytes decoded so far, for the record's run."""

    def begin(self, span: Span) -> None:
        """Be told which window is looked at from now on."""
        self._owned_from |= {stream: start for stream, (start, _) in span.owned.items()}

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

    def event_index(self, time_ns: int) -> int:
        """Return the number of events earlier than ``time_ns``, exact where the stamps are in order."""
        block = int(np.searchsorted(self._block_first_ns, time_ns, "left")) - 1
        if block < 0:
            return 0
        start = block * BLOCK_ROWS
        stamps = self.rows(STAMPS_OF["events"], start, min(start + BLOCK_ROWS, self._event_count))
        return start + int(np.searchsorted(stamps, time_ns, "left"))

    def _block(self, key: str, number: int, rows: int) -> NDArray[Any]:
        found = self._cached.get((key, number))
        if found is None:
            found = self._decode(key, number, rows)
            self._keep((key, number), found)
        else:
            self._cached.move_to_end((key, number))
        if isinstance(found, UnreadableRowsError):
            raise found
        return found

    def _decode(self, key: str, number: int, rows: int) -> Block:
        count = self._sequence.layout.bindings[key].rows
        try:
            block = self._sequence.rows(key, number * rows, min((number + 1) * rows, count))
        except UnreadableRowsError as error:
            return error
        block.flags.writeable = False
        self.decoded_bytes += block.nbytes
        return block

    def _keep(self, name: tuple[str, int], block: Block) -> None:
        self._cached[name] = block
        self._cached_bytes += _size(block)
        while self._cached_bytes > self.cache_bytes and len(self._cached) > 1:
            self._cached_bytes -= _size(self._cached.pop(self._to_drop()))

    def _to_drop(self) -> tuple[str, int]:
        """Return a block to drop: never the one that was used last."""
        droppable = tuple(self._cached)[:-1]
        return next((name for name in droppable if self._is_behind(*name)), droppable[len(droppable) // 2])

    def _is_behind(self, key: str, number: int) -> bool:
        rows = self._sequence.chunk_rows(key)
        return (number + 1) * rows <= self._owned_from.get(DATASETS[key].stream, 0)


def _size(block: Block) -> int:
    return 0 if isinstance(block, UnreadableRowsError) else block.nbytes
