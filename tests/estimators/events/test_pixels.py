"""Compiled loops against plain NumPy."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.clocks.grid import are_crowded
from fedora_qa.estimators.events.pixels import (
    by_pixel,
    count_between_frames,
    count_repeats,
    find_repeats,
    mark_bursts,
    mark_repeats,
    survey_columns,
)
from fedora_qa.estimators.events.rates import PixelCounts, longest_silences
from tests.estimators.event_world import Stream

SHAPE = (3, 4)


@st.composite
def streams(draw: st.DrawFn) -> Stream:
    """Some events on a small sensor, many of them at one instant."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(0, 60))
    times_ns = np.sort(rng.integers(0, 30, count)) * 1000
    x, y = rng.integers(0, SHAPE[1], count), rng.integers(0, SHAPE[0], count)
    return Stream(x.astype(np.uint16), y.astype(np.uint16), times_ns, rng.integers(0, 2, count).astype(np.uint8))


@given(streams())
@settings(deadline=None)
def test_events_between_frames_are_counted_once(events: Stream) -> None:
    """Interval i holds the events later than frame i and not later than frame i + 1, by pixel and polarity."""
    frames_ns = np.array([5_000, 10_000, 22_000])
    counts = np.zeros((2, 2, *SHAPE), np.int32)
    count_between_frames(events.x, events.y, events.times_ns, events.p, frames_ns, counts)
    for i in range(2):
        within = (events.times_ns > frames_ns[i]) & (events.times_ns <= frames_ns[i + 1])
        expected = np.zeros((2, *SHAPE))
        np.add.at(expected, (events.p[within], events.y[within], events.x[within]), 1)
        assert np.array_equal(counts[i], expected)


@given(streams())
@settings(deadline=None)
def test_pixels_are_followed_one_by_one(events: Stream) -> None:
    """Every pixel gets its number of events and of runs of one polarity, its first and its last polarity."""
    tally = PixelCounts.of_nothing(SHAPE)
    tally.add(events.x, events.y, events.p)
    counts, runs, first, last = tally.events, tally.runs, tally.first, tally.last
    for row, column in np.ndindex(SHAPE):
        own = events.p[(events.x == column) & (events.y == row)].tolist()
        reversals = sum(one != other for one, other in pairwise(own))
        assert counts[row, column] == len(own)
        assert runs[row, column] == (reversals + 1 if own else 0)
        assert (first[row, column], last[row, column]) == ((own[0], own[-1]) if own else (-1, -1))


@given(streams())
@settings(deadline=None)
def test_repeats_are_events_of_a_pixel_at_one_timestamp(events: Stream) -> None:
    """The number of repeats is events less different (pixel, stamp); the first one is the first seen again."""
    places = list(zip(events.x.tolist(), events.y.tolist(), events.times_ns.tolist(), strict=True))
    repeats, first, _, _ = find_repeats(events.x, events.y, events.times_ns, events.p, SHAPE)
    assert repeats == len(places) - len(set(places))
    again = [i for i, place in enumerate(places) if place in places[:i]]
    assert first == (again[0] if again else -1)


@given(streams(), st.integers(0, 20))
@settings(deadline=None)
def test_doubled_ticks_hold_only_pairs(events: Stream, doubled_at: int) -> None:
    """A tick counts when eight or more events of it all occur an even number of times."""
    twice = events.keep(np.sort(np.concatenate([
        np.arange(len(events)), np.flatnonzero(events.times_ns == doubled_at * 1000)
    ])))  # fmt: skip
    expected = 0
    for tick in np.unique(twice.times_ns):
        at = twice.times_ns == tick
        counts = Counter(zip(twice.x[at].tolist(), twice.y[at].tolist(), twice.p[at].tolist(), strict=True))
        expected += at.sum() >= 8 and all(count % 2 == 0 for count in counts.values())
    assert find_repeats(twice.x, twice.y, twice.times_ns, twice.p, SHAPE)[2] == expected


@given(streams(), st.integers(1, 5_000))
@settings(deadline=None)
def test_bursts_are_pixels_with_close_events(events: Stream, least_gap_ns: int) -> None:
    """A pixel is marked when any two events of it lie closer than the dead time."""
    marked = np.zeros(SHAPE, np.bool_)
    mark_bursts(events.x, events.y, events.times_ns, least_gap_ns, marked)
    for row, column in np.ndindex(SHAPE):
        gaps = np.diff(events.times_ns[(events.x == column) & (events.y == row)])
        assert marked[row, column] == bool(np.any(gaps < least_gap_ns))


@pytest.mark.parametrize("timestamp_ns", [20_000, 20_001])
def test_an_event_at_a_frame_belongs_before_it(timestamp_ns: int) -> None:
    """The stamp is the first tick not before the crossing: at the frame's own time the level was reached already."""
    counts = np.zeros((2, 2, 1, 1), np.int32)
    zero = np.zeros(1, np.uint16)
    frames_ns = np.array([0, 20_000, 40_000])
    count_between_frames(zero, zero, np.array([timestamp_ns]), np.ones(1, np.uint8), frames_ns, counts)
    assert counts[:, 1, 0, 0].tolist() == ([1, 0] if timestamp_ns == 20_000 else [0, 1])


@given(streams())
@settings(deadline=None)
def test_repeats_are_counted_before_they_are_searched(events: Stream) -> None:
    """The count is that of the search that also names the first one, and of the marks."""
    columns = events.x, events.y, events.times_ns, events.p
    repeats, first, _, _ = find_repeats(*columns, SHAPE)
    marked = mark_repeats(*columns[:3], SHAPE)
    assert count_repeats(*columns[:3], SHAPE, 0) == (repeats, 0)
    assert (int(np.count_nonzero(marked)), int(np.argmax(marked)) if repeats else -1) == (repeats, first)


@given(streams(), st.integers(0, 9_000))
@settings(deadline=None)
def test_close_events_follow_one_of_their_pixel(events: Stream, near_ns: int) -> None:
    """An event is close where the event before at its pixel is earlier by the interval at most, and not at once."""
    expected = 0
    for row, column in np.ndindex(SHAPE):
        gaps = np.diff(events.times_ns[(events.x == column) & (events.y == row)])
        expected += int(np.count_nonzero((gaps > 0) & (gaps <= near_ns)))
    assert count_repeats(events.x, events.y, events.times_ns, SHAPE, near_ns)[1] == expected


@given(streams(), st.integers(1, 40))
@settings(deadline=None)
def test_events_are_sorted_by_pixel(events: Stream, height: int) -> None:
    """As NumPy's stable sort has it."""
    shape = height, (1 << 12) + 1
    y = (events.y * 13 % height).astype(np.uint16)
    found = by_pixel(events.x, y, events.times_ns, events.p, shape)
    pixels = y.astype(np.int64) * shape[1] + events.x
    order = np.argsort(pixels, kind="stable")
    assert np.array_equal(found.timestamped, 2 * events.times_ns[order] + events.p[order])
    assert np.array_equal(found.starts, np.searchsorted(pixels[order], np.arange(height * shape[1] + 1)))
    within = (events.times_ns > 5_000) & (events.times_ns <= 20_000)
    assert found.later_than(5_000, 20_000) == np.count_nonzero(within)


@given(streams())
@settings(deadline=None)
def test_events_beyond_the_sensor_are_surveyed(events: Stream) -> None:
    """Counts, the first of each kind, the farthest place and both polarities, on a sensor that is too small."""
    found, p = np.empty(8, np.int64), events.p * 2
    survey_columns(events.x, events.y, p, (2, 3), found)
    outside, strange = (events.x >= 3) | (events.y >= 2), p > 1
    expected = [outside.sum(), strange.sum()]
    expected += [int(np.argmax(kind)) if kind.any() else -1 for kind in (outside, strange)]
    expected += [max(column.tolist(), default=0) for column in (events.x, events.y)]
    assert found.tolist() == [*expected, np.sum(p == 0), 0]


@given(streams(), st.integers(0, 30), st.integers(1, 6))
@settings(deadline=None)
def test_silences_are_the_longest_distances_of_timestamps(events: Stream, start: int, wanted: int) -> None:
    """Longest first, of equal ones the earlier, of those that end in the window."""
    timestamps = np.unique(events.times_ns)
    ends, lengths = timestamps[1:], np.diff(timestamps)
    own = (ends >= start * 1000) & (ends < 25_000)
    order = np.argsort(-lengths[own], kind="stable")[:wanted]
    found_lengths, found_ends = np.zeros((2, wanted), np.int64)
    count, silences = longest_silences(events.times_ns, start * 1000, 25_000, found_lengths, found_ends)
    assert silences == np.count_nonzero(own)
    assert found_lengths[:count].tolist() == lengths[own][order].tolist()
    assert found_ends[:count].tolist() == ends[own][order].tolist()


@given(streams(), st.integers(1, 4), st.sampled_from([0.0, 0.3, 0.5, 0.9]))
@settings(deadline=None)
def test_timestamps_are_crowded_where_most_events_share_theirs(events: Stream, crowd: int, share: float) -> None:
    """So many stamps have so many events, and these are a share of all."""
    counts = np.unique(events.times_ns, return_counts=True)[1]
    crowds = counts[counts >= crowd]
    expected = len(crowds) >= crowd and crowds.sum() >= share * len(events.times_ns)
    assert are_crowded(events.times_ns, crowd, share) == expected
