"""A part of the pictures of a snapshot."""

import numpy as np

from fedora_qa.evidence.snapshot import Picture, Snapshot
from fedora_qa.evidence.worst_locations import WHOLE, busiest_box, cut_out


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
