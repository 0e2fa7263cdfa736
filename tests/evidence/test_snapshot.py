"""What the streams show at one instant, stream by stream."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.snapshot import fitting_width_px, nearest_row, snapshot_bytes, snapshot_times_ns, take_snapshot
from fedora_qa.layout.binding import Binding
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.facts import Facts
from tests.evidence.memory import SENSOR_HEIGHT, SENSOR_WIDTH, WIDTH, memory
from tests.support.facts import MS, clock, exact_facts, with_clock


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


def test_moments_lie_where_every_rate_begins() -> None:
    """Six moments of a second of 10 Hz flow are starts of its fields, each in the window that owns it."""
    file = memory()
    instants = snapshot_times_ns(file.spans, file.facts, 6)
    times_ms = [time_ns // MS for window in instants.values() for time_ns in window]
    assert times_ms == [0, 200, 400, 500, 700, 900]
    assert all(
        file.spans[number].start_ns <= t < file.spans[number].stop_ns for number, ts in instants.items() for t in ts
    )


def test_moments_are_of_the_windows_looked_at() -> None:
    """Sampled windows alone hold moments, all of them where there are fewer images than moments."""
    file = memory()
    assert set(snapshot_times_ns(file.spans[2:4], file.facts, 3)) == {2, 3}
    few = snapshot_times_ns(file.spans[-1:], file.facts, 6)
    assert few == {5: (1000 * MS,)}


def test_files_without_images_show_the_middle_of_windows() -> None:
    """Events and motion alone have moments as well."""
    file = memory()
    motion = {name: file.facts.clocks[name] for name in ("imu", "pose")}
    instants = snapshot_times_ns(file.spans, replace(file.facts, clocks=motion), 2)
    assert instants == {1: (300 * MS,), 4: (900 * MS,)}
    assert snapshot_times_ns((), file.facts, 6) == {}


def test_dead_clocks_place_no_moment() -> None:
    """Stamps that stand still are passed over for those of another stream."""
    file = memory()
    dead = {name: clock(np.zeros(len(one.times_ns), np.int64)) for name, one in file.facts.clocks.items()}
    facts = replace(file.facts, clocks={**dead, "depth": file.facts.clocks["depth"]})
    times = [t for window in snapshot_times_ns(file.spans, facts, 3).values() for t in window]
    assert times == [160 * MS, 500 * MS, 840 * MS]


def with_shapes(height: int, width: int) -> Facts:
    """Facts of a file whose images have this size."""
    facts = exact_facts()
    shapes = {
        "path/rgb": (9, height, width, 3),
        "path/depth": (9, height, width),
        "path/flow/50hz": (9, height, width, 2),
    }
    bindings = {key: Binding(key, key, 9, shape, np.dtype("f4")) for key, shape in shapes.items()}
    return replace(facts, layout=Layout("fedora", bindings, frozenset(shapes), {}))


@given(st.integers(1, 4000), st.integers(1, 4000), st.integers(1, 12))
def test_pictures_fit_into_the_size(height: int, width: int, snapshots: int) -> None:
    """Whatever the images, so many glimpses stay within the size, unless even the least pictures do not."""
    facts, options = with_shapes(height, width), EvidenceOptions(size_bytes=1 << 20)
    chosen = fitting_width_px(facts, options, snapshots)
    assert chosen <= 360
    assert snapshots * snapshot_bytes(facts, chosen) <= options.size_bytes or chosen == 16


@pytest.mark.parametrize(("width", "height", "expected"), [(270, 200, 270), (1440, 1080, 288)])
def test_usual_images(width: int, height: int, expected: int) -> None:
    """With the default size small images stay whole and the paper's become 288 px wide."""
    chosen = fitting_width_px(with_shapes(height, width), EvidenceOptions(), EvidenceOptions().snapshots)
    assert width // -(-width // chosen) == expected
