"""Index maps of a piece: right where they were right, and wrong by as much where they were wrong."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.extract.rows import CutRows
from fedora_qa.sequence.facts import IndexMap

Int64 = NDArray[np.int64]


def entries_kept(index_map: IndexMap, frames: CutRows, events: CutRows) -> Int64:
    """Return the entries of the kept frames, that count from the first kept event.

    What an entry is off by stays as it was: a wrong map must not be mended by being cut.
    """
    rows = slice(frames.start, min(frames.stop, len(index_map.expected_left)))
    expected, stored = index_map.expected_left[rows], index_map.stored[rows]
    return shifted(expected, events) + (stored - expected)


def shifted(entries: Int64, events: CutRows) -> Int64:
    """Return right entries as they count from the first kept event; their number where none is left."""
    return np.clip(entries - events.start, 0, events.stop - events.start)
