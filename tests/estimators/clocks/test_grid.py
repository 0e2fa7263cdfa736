"""Grids of timestamps: of single precision, combs that a part of them meets, ticks that many share."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, norm

from fedora_qa.estimators.clocks.grid import (
    STEPS,
    _hits_by_tick,
    _hits_by_timestamp,
    comb_counts,
    crowded_step_ns,
    crowded_timestamps,
    is_on_comb,
    moved_together,
    single_precision_spacing_us,
    surely_no_chance,
)


def in_single_precision(times_us: np.ndarray) -> np.ndarray:
    return np.rint((times_us / 1e6).astype(np.float32).astype(np.float64) * 1e6)


@given(st.integers(40_000_000, 10**12), st.integers(1_000, 50_000))
def test_single_precision_is_told(origin_us: int, period_us: int) -> None:
    """Any regular stream later than 40 s betrays float32 seconds, and their spacing is that of the latest stamp."""
    times_us = in_single_precision(origin_us + period_us * np.arange(50.0))
    expected_us = float(np.spacing(np.float32(times_us[-1] / 1e6))) * 1e6
    assert single_precision_spacing_us(times_us) == pytest.approx(expected_us)


@given(st.integers(40_000_000, 10**12), st.integers(0, 2**32 - 1))
def test_whole_microseconds_are_not_taken_for_it(origin_us: int, seed: int) -> None:
    """Stamps at random microseconds are not single-precision seconds."""
    times_us = origin_us + np.cumsum(np.random.default_rng(seed).integers(500, 1500, 50)).astype(float)
    assert single_precision_spacing_us(times_us) == 0.0


def test_early_timestamps_tell_nothing() -> None:
    """Below 16 s single precision is as fine as a microsecond."""
    assert single_precision_spacing_us(np.arange(0.0, 15e6, 1e5)) == 0.0


@pytest.mark.parametrize(("grid_us", "fewest"), [(2.0, 20), (10.0, 7), (1000.0, 3)])
def test_chance_is_excluded_below_one_in_a_million(grid_us: float, fewest: int) -> None:
    """Of n timestamps all lie on a grid of g us with the chance g^-n, which 1e-6 itself does not exclude."""
    assert surely_no_chance(np.full(fewest, grid_us))
    assert not surely_no_chance(np.full(fewest - 1, grid_us))


def test_as_many_timestamps_are_needed_as_chance_asks_for() -> None:
    """At 64 s the spacing is 7.6 us: six such timestamps have the chance 5e-6, and seven the chance 7e-7."""
    times_us = in_single_precision(64_000_000 + 5_000 * np.arange(7.0))
    assert single_precision_spacing_us(times_us[:6]) == 0.0
    assert single_precision_spacing_us(times_us) == pytest.approx(1e6 * 2.0**-17)
    # Timestamps before 16 s are on every grid, and say nothing for or against.
    early_us = np.arange(100.0, 1e6, 1e5)
    assert single_precision_spacing_us(np.append(early_us, times_us)) == pytest.approx(1e6 * 2.0**-17)
    assert single_precision_spacing_us(np.append(early_us, times_us[:6])) == 0.0


WINDOW_US = 200_000


def random_timestamps(seed: int, count: int, first_us: int = 0) -> np.ndarray:
    return np.sort(np.random.default_rng(seed).integers(first_us, first_us + WINDOW_US, count))


@given(st.integers(0, 2**32 - 1), st.sampled_from([200, 5000, 60_000]), st.integers(0, 2**53))
@settings(max_examples=20, deadline=None)
def test_timestamps_without_a_grid_keep_to_chance(seed: int, count: int, first_us: int) -> None:
    """At no density, and at no epoch, does any of 2000 combs stand out by seven deviations."""
    assert comb_counts(random_timestamps(seed, count, first_us)).deviates().max() < 7.0


@pytest.mark.parametrize("step", [7, 100, 300, 1000])
def test_a_grid_of_a_quarter_is_seen(step: int) -> None:
    """A quarter of the stamps, rounded, stands out by more than twenty deviations at its own step."""
    timestamps = random_timestamps(3, 8000, 5_000_000_123)
    timestamps[::4] = timestamps[::4] // step * step
    assert comb_counts(np.sort(timestamps)).deviates()[STEPS.index(step)] > 20


@given(st.integers(0, 2**32 - 1), st.sampled_from([7.0, 300.0, 1e6 * 2.0**-17]))
@settings(max_examples=20, deadline=None)
def test_timestamps_on_a_comb_are_those_that_it_hits(seed: int, step: float) -> None:
    """Distinct timestamps on a comb are as many as its occupied teeth, but for teeth rounded past an end."""
    timestamps = random_timestamps(seed, 3000, 5_000_000_123)
    timestamps[::3] = np.rint(np.rint(timestamps[::3] / step) * step).astype(np.int64)
    timestamps = np.unique(timestamps)
    beyond_ends = np.count_nonzero(is_on_comb(timestamps, step)) - comb_counts(timestamps).hits[STEPS.index(step)]
    assert 0 <= beyond_ends <= (0 if step.is_integer() else 2)
    assert is_on_comb(np.array([3 * 2**60, 3 * 2**60 + 1]), 3.0).tolist() == [True, False]


def test_float32_seconds_are_seen() -> None:
    """Seconds that went through float32 at 100 s lie on steps of 2^-17 s."""
    seconds = (random_timestamps(4, 8000, 100_000_000) * 1e-6).astype(np.float32).astype(np.float64)
    timestamps = np.rint(seconds * 1e6).astype(np.int64)
    assert comb_counts(timestamps).deviates()[STEPS.index(1e6 * 2.0**-17)] > 20


def test_events_of_one_tick_count_once() -> None:
    """Thousand events at one stamp are one occupied tick; without stamps there is nothing."""
    timestamps = random_timestamps(5, 500)
    crowded = np.sort(np.concatenate([timestamps, np.full(1000, timestamps[10])]))
    assert np.array_equal(comb_counts(crowded).hits, comb_counts(timestamps).hits)
    assert comb_counts(timestamps[:0]).deviates().max() == 0


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 40]), st.sampled_from([1, 2000, 10**6]), st.integers(0, 2**52))
@settings(max_examples=40, deadline=None)
def test_far_apart_counts_as_close_together(seed: int, count: int, length_us: int, first_us: int) -> None:
    """Counting at every stamp gives what counting at every tick gives."""
    random = np.random.default_rng(seed)
    timestamps = np.unique(np.append(random.integers(first_us, first_us + length_us, count), first_us // 2000 * 2000))
    assert np.array_equal(_hits_by_timestamp(timestamps), _hits_by_tick(timestamps))
    assert np.all(comb_counts(timestamps).hits <= comb_counts(timestamps).teeth)


def test_years_between_timestamps_cost_nothing() -> None:
    """No tick is looked at of thirty-six thousand years; teeth are the multiples in between, by exact division."""
    counts = comb_counts(np.array([-7, 2**60]))
    assert counts.ticks == 2**60 + 8
    assert counts.teeth[STEPS.index(3.0)] == 2**60 // 3 + 3
    assert counts.hits[STEPS.index(1024.0)] == 1
    assert np.isfinite(counts.deviates()).all()


@pytest.mark.parametrize("count", [1, 30, 300, 3000])
def test_deviates_are_those_of_the_binomial_distribution(count: int) -> None:
    """Of every comb, also of those that are met so seldom that it is not asked."""
    counts = comb_counts(random_timestamps(3, count, 1))
    chances = binom.sf(counts.hits - 1, counts.teeth, counts.occupied / counts.ticks)
    expected = np.maximum(norm.isf(chances), 0.0)
    found = counts.deviates()
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("tick_ns", [100_000, 333_000, 1_000_000])
def test_packets_have_the_distance_of_their_timestamps(tick_ns: int) -> None:
    """Twenty packets of ten events each lie on the tick, one event in twenty beside it."""
    packets = np.repeat(np.arange(20, dtype=np.int64) * tick_ns, 10)
    alone = np.arange(10, dtype=np.int64) * tick_ns + 7
    assert crowded_step_ns(np.sort(np.concatenate([packets, alone]))) == tick_ns


def test_events_with_timestamps_of_their_own_have_no_tick() -> None:
    """Timestamps that differ, and a single burst, are no tick."""
    times_ns = np.arange(500, dtype=np.int64) * 1_000
    assert crowded_step_ns(times_ns) == 0
    assert crowded_step_ns(np.sort(np.concatenate([times_ns, np.full(400, 77_000, np.int64)]))) == 0
    assert crowded_step_ns(np.empty(0, np.int64)) == 0


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("step_us", "share"), [(1_000, 0.2), (10_000, 0.02), (20_000, 0.5)])
def test_events_are_moved_to_a_grid(seed: int, step_us: int, share: float) -> None:
    """Events that are moved up to multiples of a step crowd these; events at random, and columns at once, do not."""
    rng = np.random.default_rng(seed)
    times_ns = np.sort(rng.integers(0, 200_000, 10_000)) * 1000
    grid_ns = np.arange(step_us, 200_000, step_us) * 1000
    assert not moved_together(grid_ns, times_ns).any()
    columns_ns = np.repeat(rng.integers(1, 200_000, 50), 20) * 1000
    at_once_ns = np.sort(np.concatenate([[0, 200_000_000], times_ns, columns_ns]))
    assert not moved_together(columns_ns, at_once_ns).any()
    moved = rng.random(len(times_ns)) < share
    # The last timestamp is that of the stream, which lies on no grid.
    moved_ns = np.sort(
        np.where(moved, np.minimum(-(-times_ns // step_us // 1000) * step_us * 1000, 199_997_000), times_ns)
    )
    assert moved_together(grid_ns, moved_ns).all()
    assert not moved_together(grid_ns + 1000, moved_ns).any()


def test_a_timestamp_that_many_events_have_is_crowded() -> None:
    """Events at random crowd none."""
    times_ns = np.sort(np.random.default_rng(0).integers(0, 200_000, 10_000)) * 1000
    assert not len(crowded_timestamps(times_ns))
    held_ns = np.sort(np.concatenate([times_ns, np.full(30, 77_000_000)]))
    assert crowded_timestamps(held_ns).tolist() == [77_000_000]


def test_events_are_moved_to_the_ends() -> None:
    """Timestamps that are limited to those of the stream crowd its ends, and no other timestamp."""
    times_ns = np.sort(np.random.default_rng(0).integers(-1_000, 201_000, 10_000)) * 1000
    limited_ns = np.clip(times_ns, 0, 200_000_000)
    assert moved_together(np.array([0, 1_000, 199_999_000, 200_000_000]), limited_ns).tolist() == [
        True,
        False,
        False,
        True,
    ]
