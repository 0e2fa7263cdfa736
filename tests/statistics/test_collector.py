"""Statistics of windows against closed forms, however the windows were dealt out."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.sequence.facts import EventScan, Facts
from fedora_qa.sequence.window import Sampling, Span, Window
from fedora_qa.statistics.collector import StatisticsCollector, WindowStatistics
from tests.support.facts import MS, clock, exact_facts
from tests.support.identical import identical

WINDOW_NS = 200 * MS
HEIGHT, WIDTH = 6, 8
COLLECTOR = StatisticsCollector()


class Rows:
    """Arrays as a decoder hands them out; some keys cannot be decoded."""

    def __init__(self, arrays: Mapping[str, NDArray[Any]], unreadable: tuple[str, ...] = ()) -> None:
        self.arrays = arrays
        self.unreadable = unreadable

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        if key in self.unreadable:
            raise UnreadableRowsError(key, start, stop, "damaged")
        return self.arrays[key][start:stop]

    def event_index(self, time_ns: int) -> int:
        return int(np.searchsorted(self.arrays["path/events/t"], time_ns))


def flight(seconds: int = 1) -> tuple[Facts, dict[str, NDArray[Any]]]:
    """A straight flight at 3 m/s before a wall, half of it 2 m and half 4 m away, a corner of it invalid."""
    facts = exact_facts(seconds)
    poses, frames = len(facts.clocks["pose"].times_ns), len(facts.clocks["rgb"].times_ns)
    times_s = facts.clocks["pose"].times_ns / 1e9
    depth_mm = np.full((HEIGHT, WIDTH), 2000, np.float32)
    depth_mm[:, WIDTH // 2 :] = 4000
    depth_mm[0, 0] = np.nan
    flow_px = np.empty((HEIGHT, WIDTH, 2), np.float32)
    flow_px[:, : WIDTH // 2], flow_px[:, WIDTH // 2 :] = (3, 4), (0, -1)
    events = np.arange(0, seconds * 1000 * MS, MS)
    arrays: dict[str, NDArray[Any]] = {
        "path/rgb": np.broadcast_to(np.array([100, 50, 200], np.uint8), (frames, HEIGHT, WIDTH, 3)),
        "path/depth": np.broadcast_to(depth_mm, (frames, HEIGHT, WIDTH)),
        "path/events/t": events,
        "path/events/p": (np.arange(len(events)) % 4 == 0).astype(np.uint8),
        "path/pose/position": np.outer(times_s, [1.0, 2.0, 2.0]),
        "path/pose/orientation": np.tile([0.0, 0.0, 0.0, 1.0], (poses, 1)),
    }
    for stream in facts.flow_streams:
        arrays[f"path/{stream}"] = np.broadcast_to(flow_px, (100, HEIGHT, WIDTH, 2))
    scan = EventScan(len(events), 0, int(events[-1]), decreases=0, first_decrease=-1, grid_ns=MS)
    return replace(facts, events=scan), arrays


def windows(facts: Facts, source: Rows) -> list[Window]:
    last_ns = max(int(one.times_ns[-1]) for one in facts.clocks.values())
    timestamps = {name: one.times_ns for name, one in facts.clocks.items()} | {"events": source.arrays["path/events/t"]}
    cut = []
    for index, start_ns in enumerate(range(0, last_ns + 1, WINDOW_NS)):
        stop_ns = start_ns + WINDOW_NS
        owned = {name: tuple(np.searchsorted(t, [start_ns, stop_ns]).tolist()) for name, t in timestamps.items()}
        cut.append(Window(Span(index, start_ns, stop_ns, owned), facts, source, Sampling()))
    return cut


def collect(facts: Facts, shown: list[Window]) -> list[WindowStatistics]:
    state = COLLECTOR.start(facts)
    for window in shown:
        COLLECTOR.update(state, window)
    return state


def test_closed_forms() -> None:
    """Every number of a simple flight is what can be worked out by hand."""
    facts, arrays = flight()
    found = COLLECTOR.conclude(collect(facts, windows(facts, Rows(arrays))), facts)
    assert found["sequence"]["duration_s"] == 1.0
    assert found["sequence"]["event_rate_mean_per_s"] == 1000.0
    assert found["motion"]["distance_m"] == pytest.approx(3.0, rel=1e-6)
    assert found["motion"]["speed_max_m_s"] == pytest.approx(3.0, rel=1e-6)
    assert found["motion"]["angular_speed_max_rad_s"] == pytest.approx(0.0, abs=1e-9)
    assert found["events"]["brighter_share"] == 0.25
    for stream in ("flow/10hz", "flow/25hz", "flow/50hz"):
        assert found[stream]["mean_px"] == pytest.approx(3.0)
        assert found[stream]["variance_px2"] == pytest.approx(4.0)
    assert found["depth"]["min_m"] == 2.0
    assert found["depth"]["max_m"] == 4.0
    assert found["depth"]["disparity_mean_per_m"] == pytest.approx((23 / 2 + 24 / 4) / 47)
    assert found["depth"]["valid_share"] == pytest.approx(47 / 48)
    assert found["rgb"]["brightness_mean_dn"] == pytest.approx(0.299 * 100 + 0.587 * 50 + 0.114 * 200)
    assert found["rates"]["imu_hz"] == 1000.0


@settings(max_examples=25, deadline=None)
@given(st.sets(st.integers(1, 5)))
def test_cuts_do_not_matter(cuts: set[int]) -> None:
    """Windows dealt out in any contiguous shares, merged in order, give the same result to the last bit."""
    facts, arrays = flight()
    shown = windows(facts, Rows(arrays))
    whole = COLLECTOR.conclude(collect(facts, shown), facts)
    bounds = [0, *sorted(cuts), len(shown)]
    merged = COLLECTOR.start(facts)
    for start, stop in pairwise(bounds):
        merged = COLLECTOR.merge(merged, collect(facts, shown[start:stop]))
    assert identical(COLLECTOR.conclude(merged, facts), whole)


def test_distance_needs_every_pose() -> None:
    """A sample of the windows tells nothing of the distance; what it tells of the flow stays."""
    facts, arrays = flight()
    found = COLLECTOR.conclude(collect(facts, windows(facts, Rows(arrays))[::2]), facts)
    assert found["motion"]["distance_m"] is None
    assert found["motion"]["speed_max_m_s"] is None
    assert found["flow/10hz"]["mean_px"] == pytest.approx(3.0)


def test_poses_that_are_not_finite_are_left_out() -> None:
    """One NaN costs one pose, not the distance."""
    facts, arrays = flight()
    arrays["path/pose/position"][70, 1] = np.nan
    arrays["path/pose/orientation"][90] = 0.0
    found = COLLECTOR.conclude(collect(facts, windows(facts, Rows(arrays))), facts)
    assert found["motion"]["distance_m"] == pytest.approx(3.0, rel=1e-6)


def test_damage_stays_where_it_is() -> None:
    """Depth and poses that cannot be decoded are left out; everything else is as before."""
    facts, arrays = flight()
    damaged = Rows(arrays, unreadable=("path/depth", "path/pose/position", "path/events/p"))
    found = COLLECTOR.conclude(collect(facts, windows(facts, damaged)), facts)
    assert found["depth"]["mean_m"] is None
    assert found["motion"]["distance_m"] is None
    assert found["events"]["brighter_share"] is None
    assert found["events"]["count"] == 1000
    assert found["flow/50hz"]["mean_px"] == pytest.approx(3.0)


def test_a_file_with_nothing_in_it() -> None:
    """Without streams there are no numbers, and no crash."""
    facts = replace(exact_facts(), streams=frozenset(), clocks={}, events=None)
    found = COLLECTOR.conclude(COLLECTOR.start(facts), facts)
    assert found["sequence"]["duration_s"] is None
    assert found["motion"]["distance_m"] is None
    assert set(found) == {"sequence", "motion", "rates"}


def test_one_pose_and_one_frame() -> None:
    """One sample has no rate, no duration and no distance."""
    facts, arrays = flight()
    single = {name: clock(facts.clocks[name].times_ns[:1]) for name in ("rgb", "pose")}
    facts = replace(facts, streams=frozenset(single), clocks=single, events=None)
    found = COLLECTOR.conclude(collect(facts, windows(facts, Rows(arrays))), facts)
    assert found["rates"] == {"pose_hz": None, "rgb_hz": None}
    assert found["sequence"]["duration_s"] is None
    assert found["motion"]["distance_m"] is None
    assert found["rgb"]["brightness_mean_dn"] is not None
