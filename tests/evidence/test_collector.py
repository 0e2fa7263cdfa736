"""Everything that the pass keeps of a file: names, shapes, numbers, titles, size, and samples over time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.evidence.collector import EvidenceCollector, Timeline, stream_counts, timeline_of
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.evidence.worst_locations import images_of, keep_worst_locations
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span
from tests.evidence.memory import HEIGHT, SENSOR_HEIGHT, SENSOR_WIDTH, WIDTH, Memory, memory
from tests.support.facts import MS, clock, exact_facts, with_clock
from tests.support.identical import identical

MOMENTS = 4
OPTIONS = EvidenceOptions(snapshots=MOMENTS, timeline_bins=50)
SHAPES = {
    "moments/times_us": (MOMENTS,),
    "moments/rgb": (MOMENTS, HEIGHT, WIDTH, 3),
    "moments/rgb_times_us": (MOMENTS,),
    "moments/depth_m": (MOMENTS, HEIGHT, WIDTH),
    "moments/depth_times_us": (MOMENTS,),
    "moments/flow_px": (MOMENTS, HEIGHT, WIDTH, 2),
    "moments/flow_interval_us": (MOMENTS, 2),
    "moments/residual_dn": (MOMENTS, HEIGHT, WIDTH),
    "moments/brighter": (MOMENTS, SENSOR_HEIGHT, SENSOR_WIDTH),
    "moments/darker": (MOMENTS, SENSOR_HEIGHT, SENSOR_WIDTH),
    "moments/events_interval_us": (MOMENTS, 2),
}
TYPES = {"rgb": "u1", "depth_m": "f4", "flow_px": "f4", "residual_dn": "f2", "brighter": "u2", "darker": "u2"}


def collect(file: Memory, options: EvidenceOptions = OPTIONS, families: frozenset[str] | None = None) -> TitledArrays:
    """What is kept of all windows."""
    spans = file.spans
    collector = EvidenceCollector(spans, spans, options, families)
    state = collector.start(file.facts)
    for number in range(len(spans)):
        collector.update(state, file.window(number))
    return collector.conclude(state, file.facts)


def test_moments_are_as_the_contract_says() -> None:
    """Names, shapes and types of the moments."""
    arrays = collect(memory()).arrays
    assert {name: array.shape for name, array in arrays.items() if name.startswith("moments/")} == SHAPES
    for name, kind in TYPES.items():
        assert arrays[f"moments/{name}"].dtype == np.dtype(kind)


def test_every_array_has_a_title() -> None:
    """Titles are captions: none is empty, and pictures name their unit."""
    kept = collect(memory())
    assert kept.arrays.keys() == kept.titles.keys()
    assert all(kept.titles.values())
    assert "m" in kept.titles["moments/depth_m"].replace(",", " ").split()
    assert "px of the stored image" in kept.titles["moments/flow_px"]


def test_timeline_counts_every_sample() -> None:
    """Each stream's bins add up to its rows, events among them."""
    file = memory()
    arrays = collect(file).arrays
    for stream, one in file.facts.clocks.items():
        assert int(arrays[f"timeline/{stream}"].sum()) == len(one.times_ns)
    assert arrays["timeline/events"].tolist() == [20] * 50
    assert len(arrays["timeline/edges_us"]) == 51


def test_time_that_was_not_looked_at_is_kept() -> None:
    """Of all windows but the second and third, one segment; IMU and poses are read whole; of all windows, nothing."""
    file = memory()
    collector = EvidenceCollector(file.spans, file.spans, OPTIONS, frozenset({"rgb", "events"}))
    state = collector.start(file.facts)
    for number in (0, *range(3, len(file.spans))):
        collector.update(state, file.window(number))
    arrays = collector.conclude(state, file.facts).arrays
    segment_us = [[file.spans[1].start_ns / 1e3, file.spans[2].stop_ns / 1e3]]
    for stream in ("rgb", "events"):
        np.testing.assert_allclose(arrays[f"timeline/unmeasured/{stream}"] - file.facts.origin_us, segment_us)
    whole_us = [[file.spans[0].start_ns / 1e3, file.spans[-1].stop_ns / 1e3]]
    np.testing.assert_allclose(arrays["timeline/unmeasured/depth"] - file.facts.origin_us, whole_us)
    assert not any(name.startswith(("timeline/unmeasured/imu", "timeline/unmeasured/pose")) for name in arrays)
    assert not any("unmeasured" in name for name in collect(file).arrays)


def test_histograms_count_every_sampled_pixel() -> None:
    """Small images are counted whole: depths of frame i are i metres; events come at 1000/12 Hz a pixel."""
    arrays = collect(memory()).arrays
    assert int(arrays["histograms/depth_m/counts"].sum()) == 51 * HEIGHT * WIDTH
    assert int(arrays["histograms/flow_10hz/counts"].sum()) == 10 * HEIGHT * WIDTH
    counts, edges = arrays["histograms/event_rate_hz/counts"], arrays["histograms/event_rate_hz/edges"]
    assert int(counts.sum()) == SENSOR_HEIGHT * SENSOR_WIDTH
    assert edges[np.argmax(counts)] <= 1000 / 12 <= edges[np.argmax(counts) + 1]


def test_unreadable_rows_cost_their_own_arrays() -> None:
    """Depth that cannot be decoded leaves its pictures, histogram and points out, and nothing else."""
    clean, file = collect(memory()).arrays, memory()
    file.unreadable = {"path/depth"}
    left = collect(file).arrays
    lost = {"moments/depth_m", "moments/depth_times_us", "histograms/depth_m/edges", "histograms/depth_m/counts"}
    lost |= {f"point_cloud/{name}" for name in ("times_us", "origin_world_m", "offsets_m", "rgb")}
    assert clean.keys() - left.keys() == lost
    assert all(identical(left[name], clean[name]) for name in left)


def test_moments_without_a_picture_are_nan() -> None:
    """A stream that shows nothing in one window is NaN, or 0, in that moment, and its instant is NaN."""
    file = memory()
    spans = tuple(replace(s, owned={k: r for k, r in s.owned.items() if k != "depth" or s.index}) for s in file.spans)
    collector = EvidenceCollector(spans, spans, OPTIONS)
    state = collector.start(file.facts)
    for span in spans:
        window = file.window(span.index)
        window.span = span
        collector.update(state, window)
    arrays = collector.conclude(state, file.facts).arrays
    missing = np.isnan(arrays["moments/depth_times_us"])
    assert missing.tolist() == [True, False, False, False]
    assert np.isnan(arrays["moments/depth_m"][missing]).all()
    assert np.isfinite(arrays["moments/depth_m"][~missing]).all()


@pytest.mark.parametrize(
    ("families", "shown"),
    [
        ({"pose"}, set()),
        ({"flow"}, {"flow_px", "flow_interval_us"}),
        ({"rgb", "events"}, {"rgb", "rgb_times_us", "brighter", "darker", "events_interval_us"}),
        ({"rgb", "flow"}, {"rgb", "rgb_times_us", "flow_px", "flow_interval_us", "residual_dn"}),
    ],
)
def test_moments_of_some_streams(families: set[str], shown: set[str]) -> None:
    """Moments show the streams that were asked for, with the instants where there is any picture, and no other."""
    kept = collect(memory(), families=frozenset(families)).arrays
    moments = {name.removeprefix("moments/") for name in kept if name.startswith("moments/")}
    assert moments == (shown | {"times_us"} if shown else set())


@pytest.mark.parametrize("cut", range(1, 6))
def test_merging_changes_no_bit(cut: int) -> None:
    """Two segments of windows, kept apart and merged, are what one segment keeps."""
    file = memory()
    spans = file.spans
    collector = EvidenceCollector(spans, spans, OPTIONS)
    parts = []
    for numbers in (range(cut), range(cut, len(spans))):
        state = collector.start(file.facts)
        for number in numbers:
            collector.update(state, file.window(number))
        parts.append(state)
    merged = collector.conclude(collector.merge(*parts), file.facts)
    whole = collect(file)
    assert merged.titles == whole.titles
    assert all(identical(merged.arrays[name], whole.arrays[name]) for name in whole.arrays)


def test_nothing_to_keep() -> None:
    """A file without streams leaves an empty timeline."""
    file = memory()
    empty = replace(file.facts, clocks={}, events=None, streams=frozenset())
    collector = EvidenceCollector((), (), OPTIONS)
    assert set(collector.conclude(collector.start(empty), empty).arrays) == {"timeline/edges_us"}


def places(file: Memory, *findings: Finding, images: int = 100) -> TitledArrays:
    """What is kept of the places of findings."""
    return keep_worst_locations(findings, file.spans, file.facts, file, OPTIONS, images)


def test_a_place_is_a_moment_with_a_box() -> None:
    """The arrays of a moment without their first axis, under the finding's identifier, and the box of the tile."""
    found = Finding(
        "F7", "test.rule", "error", "Off.", Where("flow/10hz", 300_000, 400_000, 3, 4, 15, tile=(4, 3, 8, 6))
    )
    kept = places(memory(), found)
    expected = {name.replace("moments", "places/F7"): shape[1:] for name, shape in SHAPES.items()}
    beside = ("places/F7/before/", "places/F7/after/")
    own = {name: array.shape for name, array in kept.arrays.items() if not name.startswith(beside)}
    assert own == expected | {"places/F7/box": (4,)}
    np.testing.assert_array_equal(kept.arrays["places/F7/box"], [0.5, 0.5, 1.0, 1.0])
    assert np.unique(kept.arrays["places/F7/flow_px"][..., 0]).tolist() == [3.0]
    assert "flow/10hz" in kept.titles["places/F7/flow_px"]
    assert "tile (4, 3) to (8, 6)" in kept.titles["places/F7/box"]


def test_boxes_are_in_the_pixels_of_the_stream_named() -> None:
    """A pixel of the event camera is a share of its own image."""
    kept = places(memory(), Finding("F1", "test.rule", "error", "Hot.", Where("events", pixel=(1, 2))))
    np.testing.assert_array_equal(kept.arrays["places/F1/box"], [1 / 4, 2 / 3, 2 / 4, 1])


def test_frames_beside_a_place_are_kept() -> None:
    """The frame before and the one after it, with the arrays of a place but its box; at an end only one of them."""
    kept = places(memory(), Finding("F1", "test.rule", "error", "Off.", Where("rgb", frame=15))).arrays
    assert {name: int(kept[f"places/F1{name}/rgb"].max()) for name in ("", "/before", "/after")} == {
        "": 15,
        "/before": 14,
        "/after": 16,
    }
    assert kept["places/F1/after/depth_m"].max() == 16.0
    first = places(memory(), Finding("F1", "test.rule", "error", "Off.", Where("rgb", frame=0))).arrays
    assert {name.split("/")[2] for name in first if name.count("/") == 3} == {"after"}


def test_named_flow_stays_of_its_rate_beside_a_place() -> None:
    """Beside a place of slow flow the nearest field of that rate is shown, not one of another."""
    where = Where("flow/10hz", 300_000, 400_000, 3, 4, 15)
    kept = places(memory(), Finding("F1", "test.rule", "error", "Off.", where)).arrays
    spans_us = {name: np.ptp(kept[f"places/F1{name}/flow_interval_us"]) for name in ("", "/before", "/after")}
    assert set(spans_us.values()) == {100_000.0}


def test_places_keep_to_their_budget() -> None:
    """One place needs four images; with nine there are two, with three none; what is left goes to frames beside."""
    found = [Finding(f"F{i}", "test.rule", "error", "Off.", Where("rgb", frame=5 * i)) for i in range(1, 5)]
    for images, expected in ((9, {"F1", "F2"}), (3, set())):
        assert {name.split("/")[1] for name in places(memory(), *found, images=images).arrays} == expected
    kept = places(memory(), *found, images=4 * (4 + 2)).arrays
    assert {name.split("/")[1] for name in kept if "/after/" in name} == {"F1"}
    assert images_of(memory().spans[:1]) == 10 + 10 + 2 + 5 + 10


WINDOW_NS = 200 * MS


def spans_of(facts: Facts) -> list[Span]:
    """Windows of a fifth of a second in which streams own the rows whose stamps lie there."""
    timestamps = {name: np.maximum.accumulate(one.times_ns) for name, one in facts.clocks.items()}
    cells = np.unique(np.concatenate(list(timestamps.values())) // WINDOW_NS)
    spans = []
    for number, cell in enumerate(cells):
        bounds = [int(cell) * WINDOW_NS, (int(cell) + 1) * WINDOW_NS]
        owned = {name: tuple(np.searchsorted(times, bounds).tolist()) for name, times in timestamps.items()}
        spans.append(Span(number, *bounds, {name: rows for name, rows in owned.items() if rows[0] < rows[1]}))
    return spans


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=300), st.integers(1, 50))
def test_counts_are_those_of_numpy(times: list[int], bins: int) -> None:
    """Each stamp falls into the bin that it belongs to, the last instant into the last bin."""
    timeline = Timeline(0, bins * 1000, bins)
    expected = np.histogram([t for t in times if t <= bins * 1000], timeline.edges_ns)[0]
    np.testing.assert_array_equal(timeline.count(np.array(times)), expected)


def test_every_sample_of_clean_clocks_is_counted() -> None:
    """Bins begin with the first sample and end with the last."""
    facts = exact_facts()
    timeline = timeline_of(facts, spans_of(facts), 200)
    assert (timeline.start_ns, timeline.stop_ns) == (0, 2000 * MS)
    counts = stream_counts(timeline, facts, [], {})
    for stream, one in facts.clocks.items():
        assert int(counts[stream].sum()) == len(one.times_ns)


@pytest.mark.parametrize("shift_ns", [10**18, 3 * 10**13])
def test_one_stream_elsewhere_does_not_squeeze_the_others(shift_ns: int) -> None:
    """The timeline spans what most streams share; a stream on another clock has no sample in it."""
    facts = exact_facts()
    facts = with_clock(facts, "imu", clock(facts.clocks["imu"].times_ns + shift_ns))
    timeline = timeline_of(facts, spans_of(facts), 200)
    assert (timeline.start_ns, timeline.stop_ns) == (0, 2000 * MS)
    assert not stream_counts(timeline, facts, [], {})["imu"].any()


def test_a_lone_timestamp_in_the_future_is_left_out() -> None:
    """One jump to the far future and back costs one sample."""
    facts = exact_facts()
    times_ns = facts.clocks["rgb"].times_ns.copy()
    times_ns[-1] = 10**17
    facts = with_clock(facts, "rgb", clock(times_ns))
    timeline = timeline_of(facts, spans_of(facts), 200)
    assert timeline.stop_ns == 2000 * MS
    assert int(stream_counts(timeline, facts, [], {})["rgb"].sum()) == len(times_ns) - 1


def test_events_of_windows_not_seen_are_spread_evenly() -> None:
    """Seen windows count exactly, of others the known number is spread; together they are all."""
    facts = exact_facts()
    timeline = timeline_of(facts, spans_of(facts), 100)
    first, second = Span(0, 0, 1000 * MS, {"events": (0, 700)}), Span(1, 1000 * MS, 2000 * MS, {"events": (700, 1701)})
    counts = stream_counts(timeline, facts, [first, second], {0: timeline.count(np.full(700, 5 * MS))})["events"]
    assert counts[0] == 700
    assert int(counts.sum()) == 1701
    assert set(counts[50:].tolist()) <= {20, 21}


def test_nothing_to_show() -> None:
    """A file without any stamp, or with a single instant, has a timeline of one bin."""
    facts = replace(exact_facts(), clocks={}, events=None, streams=frozenset())
    assert timeline_of(facts, [], 200).bins == 1
    single = replace(facts, clocks={"rgb": clock(np.array([7 * MS]))})
    timeline = timeline_of(single, spans_of(single), 200)
    assert timeline.bins == 1
    assert stream_counts(timeline, single, [], {})["rgb"].tolist() == [1]
