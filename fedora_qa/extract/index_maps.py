"""Index maps of a piece: their entries deviate by as many events as those of the whole file."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.extract.rows import CutRows
from fedora_qa.sequence.facts import IndexMap

Int64 = NDArray[np.int64]


def entries_kept(index_map: IndexMap, frames: CutRows, events: CutRows) -> Int64:
    """Return the entries of the frames of a piece, which count from the first event of the piece.

    The error of an entry (events) is preserved: a cut must not correct a wrong map.
    """
    # A map with fewer entries than frames stays as short in the piece.
    rows = slice(frames.start, min(frames.stop, len(index_map.expected_left)))
    expected, stored = index_map.expected_left[rows], index_map.stored[rows]
    # entry = (events of the piece before the frame) + (stored - expected): the error in events, unchanged by the cut.
    return shifted(expected, events) + (stored - expected)


def shifted(entries: Int64, events: CutRows) -> Int64:
    """Return correct entries as they count from the first event of the piece, limited to its number of events."""
    return np.clip(entries - events.start, 0, events.stop - events.start)
