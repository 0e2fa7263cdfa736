"""Distributions by block of time: counted as they should be, however windows are dealt out."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.comparison.subjects import paired_blocks, sampled_counts_of
from fedora_qa.evidence.distributions import Blocks, DistributionsCollector, pixel_intervals_ms
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from tests.statistics.test_collector import Rows, flight, windows
from tests.support.facts import MS
from tests.support.identical import identical


def eventful(seconds: int = 1) -> tuple[Facts, dict[str, np.ndarray]]:
    """The flight of the statistics, whose event of each ms is of one of 10 pixels in turn."""
    facts, arrays = flight(seconds)
    count = len(arrays["path/events/t"])
    arrays |= {"path/events/x": np.arange(count) % 10, "path/events/y": np.zeros(count, np.int64)}
    return facts, arrays


def shown(facts: Facts, arrays: dict[str, np.ndarray], unreadable: tuple[str, ...] = ()) -> list[Window]:
    return windows(facts, Rows(arrays, unreadable))


def collector(some: list[Window]) -> DistributionsCollector:
    return DistributionsCollector([window.span for window in some])


def collect(gather: DistributionsCollector, facts: Facts, some: list[Window]) -> Blocks:
    state = gather.start(facts)
    for window in some:
        gather.update(state, window)
    return state


def test_closed_forms() -> None:
    """Every quantity of a simple flight has the mean that can be worked out by hand, to the width of a bin."""
    facts, arrays = eventful()
    some = shown(facts, arrays)
    kept = collector(some).conclude(collect(collector(some), facts, some), facts)
    sampled = sampled_counts_of(kept.arrays)
    assert sampled is not None
    assert sampled.block_ns == 200 * MS
    expected = {
        "flow_50hz": 3.0,
        "depth_m": (23 * 2 + 24 * 4) / 47,
        "event_rate_per_ms": 1.0,
        "pixel_interval_ms": 10.0,
    }
    for quantity, mean in expected.items():
        counts, edges = kept.arrays[f"distributions/{quantity}/counts"], kept.arrays[f"distributions/{quantity}/edges"]
        assert np.average((edges[1:] + edges[:-1]) / 2, weights=counts.sum(axis=0)) == pytest.approx(mean, rel=0.04)
    assert sampled.total("pixel_interval_ms").sum() == len(arrays["path/events/t"]) - 10
    assert set(kept.titles) == set(kept.arrays)


@settings(max_examples=15, deadline=None)
@given(st.sets(st.integers(1, 5)))
def test_cuts_do_not_matter(cuts: set[int]) -> None:
    """Windows dealt out in any contiguous shares, merged in order, give the same arrays to the last bit."""
    facts, arrays = eventful()
    some = shown(facts, arrays)
    gather = collector(some)
    whole = gather.conclude(collect(gather, facts, some), facts)
    merged = gather.start(facts)
    for start, stop in pairwise([0, *sorted(cuts), len(some)]):
        merged = gather.merge(merged, collect(gather, facts, some[start:stop]))
    assert identical(gather.conclude(merged, facts).arrays, whole.arrays)


def test_long_sequences_have_longer_blocks() -> None:
    """Never more than 128 blocks, each a power of two of windows, so that blocks of two files nest."""
    facts, arrays = eventful()
    some = shown(facts, arrays)
    spans = [replace(some[0].span, index=k, start_ns=k * 200 * MS, stop_ns=(k + 1) * 200 * MS) for k in range(300)]
    kept = DistributionsCollector(spans).conclude(collect(DistributionsCollector(spans), facts, some), facts)
    long, short = (
        sampled_counts_of(kept.arrays),
        sampled_counts_of(collector(some).conclude(collect(collector(some), facts, some), facts).arrays),
    )
    assert long is not None
    assert short is not None
    assert long.block_ns == 4 * short.block_ns
    before, after = paired_blocks(long, short, "flow_10hz")
    assert len(before) == 2
    assert np.array_equal(before, after)


def test_unreadable_events_cost_the_events_only() -> None:
    """Where events cannot be decoded, images still are."""
    facts, arrays = eventful()
    some = shown(facts, arrays, unreadable=("path/events/x",))
    kept = collector(some).conclude(collect(collector(some), facts, some), facts)
    assert "distributions/depth_m/counts" in kept.arrays
    assert "distributions/pixel_interval_ms/counts" not in kept.arrays


def test_nothing_to_count_keeps_nothing() -> None:
    """A file without windows has no distributions."""
    facts, _ = eventful()
    assert not collector([]).conclude({}, facts).arrays


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 40)), max_size=30), st.integers(0, 500))
def test_intervals_of_each_pixel(events: list[tuple[int, int]], start_ms: int) -> None:
    """Against going through the events one by one."""
    pixels = np.array([pixel for pixel, _ in events], np.int64)
    times_ns = np.cumsum([step for _, step in events]).astype(np.int64) * MS
    expected, last = [], {}
    for pixel, time_ns in zip(pixels.tolist(), times_ns.tolist(), strict=True):
        if pixel in last and time_ns >= start_ms * MS and time_ns - last[pixel] <= 100 * MS:
            expected.append((time_ns - last[pixel]) / MS)
        last[pixel] = time_ns
    assert sorted(pixel_intervals_ms(pixels, times_ns, start_ms * MS)) == pytest.approx(sorted(expected))


@pytest.mark.parametrize(
    "damage",
    [
        {"distributions/blocks_ns": np.zeros((2, 2))},
        {"distributions/blocks_ns": np.array([[0, 0], [5, 5]])},
        {"distributions/blocks_ns": np.array([[5, 9], [0, 4]])},
        {"distributions/depth_m/edges": np.array([1.0, 2.0])},
        {"distributions/depth_m/counts": np.array([["a"]])},
    ],
    ids=["floats", "no time", "backwards", "other edges", "words"],
)
def test_damaged_arrays_are_not_taken_for_numbers(damage: dict[str, np.ndarray]) -> None:
    """What is not what the record says is left out."""
    facts, arrays = eventful()
    some = shown(facts, arrays)
    kept = collector(some).conclude(collect(collector(some), facts, some), facts)
    found = sampled_counts_of({**kept.arrays, **damage})
    assert found is None or "depth_m" not in found.counts
