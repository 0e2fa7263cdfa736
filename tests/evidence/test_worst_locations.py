"""From what a finding says of its place to the window, the instant, the images and the box."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fedora_qa.evidence.snapshot import Picture, Snapshot
from fedora_qa.evidence.worst_locations import WHOLE, box_of, busiest_box, cut_out, location_of, worst_locations
from fedora_qa.record.types import Finding, Severity, Where
from tests.evidence.memory import memory
from tests.support.facts import MS, clock, with_clock

CASES: dict[str, tuple[Where, tuple[int, int, dict[str, int]]]] = {
    "a colour frame": (Where("rgb", frame=16), (1, 320 * MS, {"rgb": 16})),
    "a depth frame by its row": (Where("depth", index_start=16), (1, 320 * MS, {"depth": 16})),
    "events between two frames": (Where("events", 320_000, 340_000, frame=16), (1, 320 * MS, {"rgb": 16})),
    "one field": (Where("flow/10hz", 300_000, 400_000, 3, 4), (1, 300 * MS, {"flow/10hz": 3})),
    "a field with its frame": (
        Where("flow/25hz", 320_000, 360_000, 8, 9, 16),
        (1, 320 * MS, {"rgb": 16, "flow/25hz": 8}),
    ),
    "the worst of many fields": (Where("flow/50hz", 0, 1e6, 0, 50, 16), (1, 320 * MS, {"rgb": 16, "flow/50hz": 16})),
    "many fields": (Where("flow/10hz", 0, 1e6, 0, 10), (2, 500 * MS, {"flow/10hz": 5})),
    "an instant": (Where("imu", 310_000), (1, 310 * MS, {})),
    "a gap": (Where("pose", 310_000, 330_000), (1, 320 * MS, {})),
    "a sample by its row": (Where("imu", index_start=310, index_stop=312), (1, 310 * MS, {})),
    "an event by its row": (Where("events", index_start=310), (1, 300 * MS, {})),
    "a pixel of the whole file": (Where("events", pixel=(1, 2)), (2, 500 * MS, {})),
    "a tile of the whole file": (Where("events", tile=(0, 0, 2, 2)), (2, 500 * MS, {})),
    "beyond the end": (Where("imu", 9_000_000), (5, 9000 * MS, {})),
}
NOWHERE = {
    "nothing": Where(),
    "a stream": Where("events"),
    "a frame that is not there": Where("metadata", frame=99),
    "a row of what has no clock": Where("metadata", index_start=3),
}


def finding(where: Where, severity: Severity = "error", name: str = "F1") -> Finding:
    """A finding at a place."""
    return Finding(name, "test.rule", severity, "Something is wrong.", where)


@pytest.mark.parametrize(("where", "expected"), CASES.values(), ids=CASES.keys())
def test_places(where: Where, expected: tuple[int, int, dict[str, int]]) -> None:
    """Window, instant and images follow from what the finding names."""
    file = memory()
    place = location_of(finding(where), file.spans, file.facts)
    assert place is not None
    assert (place.span.index, place.time_ns, dict(place.rows)) == expected


@pytest.mark.parametrize("where", NOWHERE.values(), ids=NOWHERE.keys())
def test_findings_without_a_place(where: Where) -> None:
    """What is of the whole file, or of nothing that is there, has no place."""
    file = memory()
    assert location_of(finding(where), file.spans, file.facts) is None


def test_times_are_of_the_files_own_clock() -> None:
    """An origin at an epoch is taken off."""
    file = memory()
    facts = replace(file.facts, origin_us=1.7e15)
    place = location_of(finding(Where("imu", 1.7e15 + 310_000)), file.spans, facts)
    assert place is not None
    assert place.time_ns == 310 * MS


def test_frames_lead_to_their_window_where_clocks_are_dead() -> None:
    """A frame is looked up by its row, not by a stamp that says nothing."""
    file = memory()
    facts = with_clock(file.facts, "rgb", clock(np.zeros(51, np.int64)))
    place = location_of(finding(Where("rgb", 0.0, frame=16)), file.spans, facts)
    assert place is not None
    assert (place.span.index, dict(place.rows)) == (1, {"rgb": 16})


@example(Where(stream="flow/10hz", start_us=9.3e15, index_start=0))
@given(st.builds(
    Where,
    stream=st.sampled_from([None, "rgb", "depth", "events", "imu", "flow/10hz", "metadata", "rgb_to_event", "else"]),
    start_us=st.none() | st.floats(-1e12, 1e18),
    stop_us=st.none() | st.floats(-1e12, 1e18),
    index_start=st.none() | st.integers(-5, 10**12),
    index_stop=st.none() | st.integers(-5, 10**12),
    frame=st.none() | st.integers(-5, 10**6),
    pixel=st.none() | st.tuples(st.integers(-5, 5000), st.integers(-5, 5000)),
    tile=st.none() | st.tuples(*[st.integers(-5, 5000)] * 4),
))  # fmt: skip
def test_no_place_is_too_strange(where: Where) -> None:
    """Whatever a check says, there is a place within the file or none, and a box within the picture."""
    file = memory()
    place = location_of(finding(where), file.spans, file.facts)
    if place is not None:
        assert place.span in file.spans
        assert all(row in range(*place.span.owned[stream]) for stream, row in place.rows.items())
    left, top, right, bottom = box_of(where, 480, 640)
    assert 0 <= left < right <= 1
    assert 0 <= top < bottom <= 1


BOXES: dict[str, tuple[dict[str, Any], tuple[float, float, float, float]]] = {
    "a tile": ({"tile": (32, 24, 64, 48)}, (0.5, 0.5, 1.0, 1.0)),
    "a pixel": ({"pixel": (0, 47)}, (0.0, 47 / 48, 1 / 64, 1.0)),
    "a tile that juts out": ({"tile": (48, 36, 80, 68)}, (0.75, 0.75, 1.0, 1.0)),
    "a pixel outside": ({"pixel": (70, 3)}, WHOLE),
    "nothing": ({}, WHOLE),
}


@pytest.mark.parametrize(("where", "box"), BOXES.values(), ids=BOXES.keys())
def test_boxes(where: dict[str, Any], box: tuple[float, float, float, float]) -> None:
    """Tiles and pixels as shares of an image of 64x48, clipped to it."""
    assert box_of(Where("rgb", **where), 48, 64) == box


def test_the_gravest_come_first_and_each_place_once() -> None:
    """Of findings at one place the gravest is shown; no more than asked."""
    file = memory()
    there, elsewhere, third = Where("rgb", frame=16), Where("rgb", frame=4), Where("rgb", frame=30)
    found = [
        finding(there, "warning", "F1"), finding(elsewhere, "error", "F2"), finding(there, "critical", "F3"),
        finding(Where(), "critical", "F4"), finding(third, "info", "F5"),
    ]  # fmt: skip
    places = worst_locations(found, file.spans, file.facts, 2)
    assert [place.finding.id for place in places] == ["F3", "F2"]


def snapshot(column: int, row: int) -> Snapshot:
    """A frame of 80 x 60 px and a sensor of 40 x 30 px, with events at one of its pixels."""
    events = np.zeros((2, 30, 40), np.uint16)
    events[1, row, column] = 9
    frame = np.arange(60 * 80 * 3).reshape(60, 80, 3).astype(np.uint8)
    return Snapshot(0, {"rgb": Picture(frame, "rgb", 0, 1, 0, 0), "events": Picture(events, "events", 0, 1, 0, 0)})


def test_the_box_lies_where_events_are() -> None:
    """A quarter of the width, and the events within; the same part of all pictures."""
    whole = snapshot(25, 12)
    box = busiest_box(whole, 20)
    left, top, right, bottom = box
    assert np.allclose([right - left, bottom - top], 0.25)
    part = cut_out(whole, box)
    assert part.pictures["rgb"].image.shape == (15, 20, 3)
    assert part.pictures["events"].image.shape[2] == 10
    assert part.pictures["events"].image.sum() == 9
    # Pixels are those of the whole picture.
    row, column = round(60 * top), round(80 * left)
    np.testing.assert_array_equal(part.pictures["rgb"].image[0, 0], whole.pictures["rgb"].image[row, column])


def test_a_box_at_the_rim_lies_within() -> None:
    """Events in the corner."""
    left, top, right, bottom = busiest_box(snapshot(39, 29), 20)
    assert (right, bottom) == (1.0, 1.0)
    assert (left, top) == (0.75, 0.75)


def test_small_pictures_stay_whole() -> None:
    """A picture that is no wider than the box."""
    whole = snapshot(0, 0)
    assert busiest_box(whole, 80) == WHOLE
    np.testing.assert_array_equal(cut_out(whole, WHOLE).pictures["rgb"].image, whole.pictures["rgb"].image)
