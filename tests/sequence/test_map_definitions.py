"""Maps from frames to events by other definitions than that of the layout are compared with their own."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.layout.conversions import Conversion, MapDefinition
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.facts import NEVER_NS, IndexMap
from tests.support.memory_sequence import MemorySequence, facts_of

TIMES = st.lists(st.integers(0, 30), min_size=1, max_size=20).map(sorted)


def read(entries: list[int], frames: list[int], events: list[int], definition: MapDefinition | None) -> IndexMap:
    """The map as it is read from a sequence of which the dialect states the definition, or that of the layout."""
    count = len(events)
    arrays = {
        "path/rgb": np.zeros((len(frames), 2, 2, 3), np.uint8),
        "path/rgb_ts": np.array(frames, np.int64),
        "path/events/t": np.array(events, np.int64),
        **{f"path/events/{name}": np.zeros(count, np.uint8) for name in "xyp"},
        "metadata/rgb_to_event": np.array(entries, np.int64),
    }
    sequence = MemorySequence(arrays, Declared())
    key = "metadata/rgb_to_event"
    bindings = {**sequence.layout.bindings}
    if definition is not None:
        bindings[key] = replace(bindings[key], conversion=Conversion(definition))
    sequence.layout = replace(sequence.layout, bindings=bindings)
    return facts_of(sequence).index_maps["rgb_to_event"]


@given(TIMES, TIMES, st.integers(-2, 2))
def test_constant_definitions(frames: list[int], events: list[int], off: int) -> None:
    """A correct map reads as that of the layout, and one that is off by a number of events as off by it."""
    left, right = (np.searchsorted(events, frames, side) for side in ("left", "right"))
    correct: dict[MapDefinition, np.ndarray] = {
        "event_not_before": np.where(left < len(events), left, 0),
        "event_before": left - 1,
        "event_after": right,
    }
    for definition, entries in correct.items():
        index_map = read((entries + off).tolist(), frames, events, definition)
        np.testing.assert_array_equal(index_map.stored - index_map.expected_left, off)
        np.testing.assert_array_equal(index_map.correct, entries)


@given(TIMES, TIMES, st.data())
def test_nearest_event(frames: list[int], events: list[int], data: st.DataObject) -> None:
    """Any of the events that are nearest is right, and every other is wrong."""
    entries = [data.draw(st.integers(0, len(events) - 1)) for _ in frames]
    index_map = read(entries, frames, events, "nearest_event")
    for row, (frame, entry) in enumerate(zip(frames, entries, strict=True)):
        distances = [abs(event - frame) for event in events]
        is_right = index_map.stored[row] == index_map.expected_left[row]
        assert is_right == (distances[entry] == min(distances))


@pytest.mark.parametrize("entry", [-1, 3, 10**12])
def test_nearest_of_no_event(entry: int) -> None:
    """An entry outside of the events is wrong."""
    index_map = read([entry], [5], [1, 4, 9], "nearest_event")
    assert index_map.stored[0] != index_map.expected_left[0]


@given(TIMES, TIMES, st.data())
def test_entries_have_the_timestamps_of_the_events_that_they_point_to(
    frames: list[int], events: list[int], data: st.DataObject
) -> None:
    """Those of the event itself and of the one before it; none beyond either end, and none by another definition."""
    entries = [data.draw(st.integers(-3, len(events) + 3)) for _ in frames]
    pointed_ns = read(entries, frames, events, None).pointed_ns
    assert pointed_ns is not None
    for (before_ns, at_ns), entry in zip(pointed_ns.tolist(), entries, strict=True):
        for time_ns, row, beyond_ns in ((before_ns, entry - 1, -NEVER_NS), (at_ns, entry, NEVER_NS)):
            is_event = 0 <= row < len(events)
            assert time_ns == (events[row] if is_event else beyond_ns)
    assert read(entries, frames, events, "event_after").pointed_ns is None
