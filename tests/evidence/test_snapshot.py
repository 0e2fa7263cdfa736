"""What the streams show at one instant, stream by stream."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.evidence.snapshot import nearest_row, take_snapshot
from tests.evidence.memory import SENSOR_HEIGHT, SENSOR_WIDTH, WIDTH, memory
from tests.support.facts import MS, clock, with_clock


def test_each_stream_shows_its_image_there() -> None:
    """At 0.32 s: frames 16, the field of the fastest rate that begins there, events of 10 ms to both sides."""
    file = memory()
    pictures = take_snapshot(file.window(1), 320 * MS, WIDTH).pictures
    assert {name: picture.row for name, picture in pictures.items()} == {
        "rgb": 16,
        "depth": 16,
        "flow": 16,
        "residual": 16,
        "events": 0,
    }
    assert (pictures["flow"].stream, pictures["flow"].stop_ns - pictures["flow"].start_ns) == ("flow/50hz", 20 * MS)
    assert np.unique(pictures["rgb"].image).tolist() == [16]
    assert np.unique(pictures["depth"].image).tolist() == [16.0]
    assert np.unique(pictures["flow"].image[..., 1]).tolist() == [-16.0]
    shown = np.arange(310, 330)
    expected = np.zeros((2, SENSOR_HEIGHT, SENSOR_WIDTH), int)
    np.add.at(expected, ((shown % 3 == 0).astype(int), shown // SENSOR_WIDTH % SENSOR_HEIGHT, shown % SENSOR_WIDTH), 1)
    np.testing.assert_array_equal(pictures["events"].image, expected)


def test_events_of_the_neighbouring_window_are_shown() -> None:
    """At a window's edge events come from both sides of it."""
    file = memory()
    assert int(take_snapshot(file.window(1), 200 * MS, WIDTH).pictures["events"].image.sum()) == 20


@pytest.mark.parametrize(
    ("key", "lost"),
    [
        ("path/rgb", {"rgb", "residual"}),
        ("path/flow/50hz", {"flow", "residual"}),
        ("path/events/p", {"events"}),
        ("path/depth", {"depth"}),
    ],
)
def test_unreadable_rows_cost_their_own_picture(key: str, lost: set[str]) -> None:
    """What cannot be decoded is left out, with what is made of it, and the rest is shown."""
    file = memory()
    file.unreadable = {key}
    every = {"rgb", "depth", "flow", "residual", "events"}
    assert set(take_snapshot(file.window(1), 320 * MS, WIDTH).pictures) == every - lost


def test_missing_streams_are_left_out() -> None:
    """A file without depth and events shows the rest."""
    file = memory()
    clocks = {name: one for name, one in file.facts.clocks.items() if name != "depth"}
    file.facts = replace(file.facts, clocks=clocks, streams=file.facts.streams - {"depth", "events"})
    assert set(take_snapshot(file.window(1), 320 * MS, WIDTH).pictures) == {"rgb", "flow", "residual"}


def test_flow_that_begins_elsewhere_is_not_shown() -> None:
    """With only the rate of 10 Hz a field is shown near its start, not in the middle of another."""
    file = memory()
    slow = {name: one for name, one in file.facts.clocks.items() if name not in {"flow/25hz", "flow/50hz"}}
    file.facts = replace(file.facts, clocks=slow, streams=file.facts.streams - {"flow/25hz", "flow/50hz"})
    assert take_snapshot(file.window(1), 320 * MS, WIDTH).pictures["flow"].row == 3
    assert "flow" not in take_snapshot(file.window(1), 380 * MS, WIDTH).pictures


def test_named_images_are_shown() -> None:
    """A finding's own frame and field are shown, wherever the instant lies."""
    pictures = take_snapshot(memory().window(1), 320 * MS, WIDTH, {"rgb": 12, "flow/25hz": 6}).pictures
    assert (pictures["rgb"].row, pictures["flow"].stream, pictures["flow"].row) == (12, "flow/25hz", 6)


def test_rows_of_a_dead_clock_are_taken_in_turn() -> None:
    """Where stamps say nothing the middle of a window shows its middle row."""
    file = memory()
    window = file.window(1)
    window.facts = with_clock(file.facts, "rgb", clock(np.zeros(51, np.int64)))
    assert nearest_row(window, "rgb", 300 * MS) == 15


def test_undeclared_sensor_reaches_as_far_as_its_events() -> None:
    """Without a declared event camera the picture holds all events; strays far outside do not make it huge."""
    file = memory()
    file.facts = replace(file.facts, declared=replace(file.facts.declared, cameras={}))
    image = take_snapshot(file.window(1), 320 * MS, WIDTH).pictures["events"].image
    assert image.shape == (2, SENSOR_HEIGHT, SENSOR_WIDTH)
    file.columns["path/events/x"][320] = 65_535
    image = take_snapshot(file.window(1), 320 * MS, WIDTH).pictures["events"].image
    assert image.shape[2] <= 4096
    assert int(image.sum()) == 19
