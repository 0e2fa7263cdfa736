"""Decode stored blocks of rows, each of them once while neighbouring windows lease it."""

from bisect import bisect_left
from collections.abc import Hashable
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import is_dataset_key, spec_of, timestamps_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.scan import BLOCK_ROWS, Scan
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.window import Leases, Sampling, Span, Window

Block = NDArray[Any] | UnreadableRowsError


class BlockDecoder:
    """Rows of a sequence, decoded in the blocks in which they are stored. Implements ``RowSource``.

    A block that cannot be decoded raises ``UnreadableRowsError`` at each read, and is tried once while it is leased.

    Parameters
    ----------
    sequence
        The open file, or a view of it, whose stored rows are decoded.
    scan
        Its timestamps, of which the first of every block of events locates events in time.
    limit_bytes
        Most bytes of decoded blocks, and of what is computed of single images, to keep for other windows.
    """

    def __init__(self, sequence: SequenceRows, scan: Scan, limit_bytes: int) -> None:
        self._sequence = sequence
        self._block_first_ns = scan.block_first_ns
        self._event_count = scan.facts.events.count if scan.facts.events else 0
        self.leases = Leases(limit_bytes)
        # Of each stream, the first row that the latest window with rows of it owns.
        self._first_rows: dict[str, int] = {}
        self.decoded_bytes = 0
        """Bytes decoded so far, for the record's run."""

    def window(self, span: Span, facts: Facts, sampling: Sampling) -> Window:
        """Begin a window: leases of what the window before did not request end, but of rows that lie ahead."""
        # A window shorter than the interval of a stream can own none of its rows: the first row of the last one counts.
        self._first_rows |= {stream: rows[0] for stream, rows in span.owned.items()}
        self.leases.begin_window(self._is_ahead)
        return Window(span, facts, self, sampling, self.leases)

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows in canonical units, read-only; raises ``UnreadableRowsError``."""
        if stop <= start:
            return self._sequence.rows(key, 0, 0)
        rows = self._sequence.chunk_rows(key)
        parts: list[NDArray[Any]] = []
        for number in range(start // rows, (stop - 1) // rows + 1):
            block = self.leases.get((key, number), partial(self._decode, key, number, rows))
            if isinstance(block, UnreadableRowsError):
                # Each raise extends the traceback, whose frames would keep their arrays alive for the rest of the run.
                raise block.with_traceback(None)
            parts.append(block[max(start - number * rows, 0) : stop - number * rows])
        # Rows within one block are returned as a view, without a copy.
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def event_index(self, time_ns: int) -> int:
        """Return the number of events earlier than ``time_ns``, exact where the timestamps are in order."""
        # The last block whose first event is earlier: the boundary lies within it, or at its end.
        block = int(np.searchsorted(self._block_first_ns, time_ns, "left")) - 1
        if block < 0:
            return 0
        start, stop = block * BLOCK_ROWS, min((block + 1) * BLOCK_ROWS, self._event_count)
        timestamps = timestamps_of("events")
        # Bisection reads about twenty of up to a million timestamps; to concatenate them all would take longer.
        rows = range(start, stop)
        return start + bisect_left(rows, time_ns, key=lambda row: int(self.rows(timestamps, row, row + 1)[0]))

    def _is_ahead(self, key: Hashable) -> bool:
        """Whether a block holds rows of the latest window or of later ones; False for a result of an image."""
        name, number = cast("tuple[Hashable, int]", key)
        if not isinstance(name, str) or not is_dataset_key(name):
            return False
        first = self._first_rows.get(spec_of(name).stream)
        return first is not None and (number + 1) * self._sequence.chunk_rows(name) > first

    def _decode(self, key: str, number: int, rows: int) -> Block:
        count = self._sequence.layout.bindings[key].rows
        try:
            # Compiled loops are specialised for contiguous rows.
            block = np.ascontiguousarray(self._sequence.rows(key, number * rows, min((number + 1) * rows, count)))
        except UnreadableRowsError as error:
            # Leased like a block, so that damaged rows are decoded only once.
            return error
        self.decoded_bytes += block.nbytes
        # Several checks read the same block: none may change what the next one reads.
        block.flags.writeable = False
        return block
