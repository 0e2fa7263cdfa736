"""Timestamps of a sequence on its own clock, in blocks of rows."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.sequence.sequence import SequenceRows

BLOCK_ROWS: Final = 1 << 18
"""Rows that are read together: a few MB of events."""


def row_blocks(count: int) -> Iterator[tuple[int, int]]:
    """Yield the first row of each block, and the row after its last."""
    for start in range(0, count, BLOCK_ROWS):
        yield start, min(start + BLOCK_ROWS, count)


def file_times_us(sequence: SequenceRows, key: str, start: int, stop: int) -> NDArray[np.int64]:
    """Return timestamps in us on the clock of the file, rounded down, so that their order stays."""
    times_ns: NDArray[np.int64] = sequence.rows(key, start, stop)
    # The origin may lie far away and need not be whole us: both parts are divided before they are added.
    whole_us, rest_ns = divmod(sequence.origin_ns, NS_PER_US)
    return whole_us + (times_ns + rest_ns) // NS_PER_US
