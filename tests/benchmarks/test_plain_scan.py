"""The comparator gives the yardstick's events, bit for bit; the benchmark would say if it did not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.events.keys import EventBatch
from tests.benchmarks.event_throughput import comparator_from, dense_sinusoid, measure, require_identical, sparse_edge
from tests.benchmarks.plain_scan_kernels import PlainScan


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 21), st.sampled_from([1, 999, 1_000_000, 10**11]))
@settings(max_examples=60, deadline=None)
def test_events_are_identical(seed: int, height: int, width: int, step_us: int) -> None:
    """Random walks, some pixels at rest, any width beside whole words, intervals of one to three digits."""
    rng = np.random.default_rng(seed)
    frames = np.cumsum(rng.normal(0, 0.25, (6, height, width)) * (rng.random((6, height, width)) < 0.4), axis=0)
    comparator, plain = comparator_from(frames[0]), PlainScan(0.2, frames[0].copy())
    for k in range(5):
        interval = (frames[k], frames[k + 1], k * step_us * 1_000, (k + 1) * step_us * 1_000)
        require_identical(comparator(*interval), plain.advance(*interval))


def test_nothing_is_lost_where_room_runs_out() -> None:
    """20 400 events at once, five times the first room of the comparator, which goes on in the midst of a pixel."""
    rng = np.random.default_rng(2)
    before = rng.normal(0, 1, (80, 85))
    after = before + rng.choice([-0.75, 0.75], before.shape)
    ours, plain = (
        comparator_from(before)(before, after, 0, 10**6),
        PlainScan(0.2, before.copy()).advance(before, after, 0, 10**6),
    )
    require_identical(ours, plain)
    assert len(ours) == 3 * before.size


@pytest.mark.parametrize(("movie", "a_pixel_a_second"), [(dense_sinusoid, 35), (sparse_edge, 32.5)])
def test_benchmark_movies_hold_what_they_say(movie, a_pixel_a_second: float) -> None:
    """Both contenders agree on them, and the mean event rate is what their description gives.

    An amplitude of 0.92 at 2 Hz crosses 9.2 levels in each of 4 half periods a second, and half a level less where it
    turns back. The edge passes 6 of 64 columns in 20 ms, with ln 4 / 0.2 events each.
    """
    measured = measure(movie, 21, 48, 64)
    assert measured.events * 1_000 / (48 * 64) == pytest.approx(a_pixel_a_second, rel=0.15)
    assert measured.ratio > 0


def test_a_different_event_is_an_error() -> None:
    """One polarity changed, and the comparison raises."""
    one, other = (EventBatch(*(np.array([value]) for value in (3, 4, 5, p))) for p in (0, 1))
    with pytest.raises(ValueError, match="others in p"):
        require_identical(one, other)
