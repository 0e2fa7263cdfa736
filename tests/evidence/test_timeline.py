"""Samples over time, exact and undisturbed by broken clocks."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.evidence.timeline import Timeline, stream_counts, timeline_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span
from tests.support.facts import MS, clock, exact_facts, with_clock

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
