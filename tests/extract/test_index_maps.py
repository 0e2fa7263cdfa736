"""Index maps of a piece are right where they were right, and off by as much where they were wrong."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.extract.index_maps import entries_kept
from fedora_qa.extract.rows import CutRows
from fedora_qa.sequence.facts import IndexMap


@st.composite
def cuts(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, CutRows, CutRows]:
    """Stamps of events and frames, both in order, and rows of each to keep."""
    events = np.sort(np.array(draw(st.lists(st.integers(0, 50), max_size=30)), dtype=np.int64))
    frames = np.sort(np.array(draw(st.lists(st.integers(0, 50), min_size=1, max_size=10)), dtype=np.int64))

    def rows(count: int) -> CutRows:
        start = draw(st.integers(0, count))
        return CutRows(start, draw(st.integers(start, count)), count)

    return events, frames, rows(len(frames)), rows(len(events))


@given(cuts(), st.integers(-3, 3))
def test_what_an_entry_is_off_by_stays(cut: tuple[np.ndarray, np.ndarray, CutRows, CutRows], off: int) -> None:
    """By the format's own definition, counted in the piece: the earliest kept event not before the frame."""
    events, frames, kept_frames, kept_events = cut
    left = np.searchsorted(events, frames, "left")
    index_map = IndexMap(left + off, left, np.searchsorted(events, frames, "right"))
    piece = events[kept_events.start : kept_events.stop]
    defined = [int(np.sum(piece < frame)) for frame in frames[kept_frames.start : kept_frames.stop]]
    assert list(entries_kept(index_map, kept_frames, kept_events) - off) == defined
