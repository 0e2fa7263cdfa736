"""Coincidences on a grid of timestamps, against slow loops and against closed forms."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import binom, poisson

from fedora_qa.estimators.events.pixels import by_pixel, count_repeats
from fedora_qa.estimators.events.repeats import (
    AROUND,
    MOST_PER_TICK,
    NEAR,
    NEAR_US,
    TILE_PX,
    chance_of_coincidences,
    chance_of_doubled_ticks,
    chance_of_repeats,
    count_quiet_pairs,
    tally_ticks,
)

Columns = tuple[NDArray[np.uint16], NDArray[np.uint16], NDArray[np.int64], NDArray[np.uint8]]
TICK = 1000


def random_events(seed: int, count: int, shape: tuple[int, int], ticks: int) -> Columns:
    rng = np.random.default_rng(seed)
    return (
        rng.integers(0, shape[1], count).astype(np.uint16),
        rng.integers(0, shape[0], count).astype(np.uint16),
        np.sort(rng.integers(0, ticks, count)) * TICK,
        rng.integers(0, 2, count).astype(np.uint8),
    )


def quiet_pairs(events: Columns, shape: tuple[int, int], most: float = np.inf) -> NDArray[np.int64]:
    x, y, t, p = events
    pixels, pairs = by_pixel(x, y, t, p, shape), np.zeros(NEAR + 1, np.int64)
    count_quiet_pairs(pixels.starts, pixels.timestamped, shape, TICK, 0, 1 << 40, most, pairs)
    return pairs


def slow_quiet_pairs(events: Columns, shape: tuple[int, int]) -> list[int]:
    """Return the same, from a list of times of each pixel and polarity."""
    x, y, t, p = events
    times = {
        (r, c, s): t[(y == r) & (x == c) & (p == s)] for r in range(shape[0]) for c in range(shape[1]) for s in (0, 1)
    }
    pairs = [0] * (NEAR + 1)
    for (row, column, sign), of_pixel in times.items():
        if not (0 < row < shape[0] - 1 and 0 < column < shape[1] - 1):
            continue
        for earlier, later in pairwise(of_pixel.tolist()):
            if later - earlier > NEAR * TICK:
                continue
            loud = False
            for r, c in np.ndindex(3, 3):
                if (r, c) != (1, 1):
                    beside = times[row + r - 1, column + c - 1, sign]
                    near = beside[(beside >= earlier - AROUND * TICK) & (beside <= later + AROUND * TICK)]
                    loud = loud or bool((np.diff(near) <= NEAR * TICK).any())
            pairs[(later - earlier) // TICK] += not loud
    return pairs


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.integers(0, 400))
def test_quiet_pairs_are_those_of_a_slow_loop(seed: int, count: int) -> None:
    """Lists of the times of each pixel give the same numbers."""
    events = random_events(seed, count, (5, 6), 400)
    assert quiet_pairs(events, (5, 6)).tolist() == slow_quiet_pairs(events, (5, 6))


@pytest.mark.parametrize("per_tick", [0.001, 0.01, MOST_PER_TICK])
def test_poisson_events_stay_within_their_chance(per_tick: float) -> None:
    """Events at random, up to the highest rate that counts, repeat no more often than expected."""
    rng, excess = np.random.default_rng(0), []
    for _ in range(20):
        # One pixel of a sensor of 3 x 3 whose neighbours are silent.
        ticks = int(2000 / per_tick)
        t = np.sort(rng.integers(0, ticks, rng.poisson(2000))) * TICK
        one = np.ones(len(t), np.uint16)
        pairs = quiet_pairs((one, one, t, np.ones(len(t), np.uint8)), (3, 3))
        chance = chance_of_repeats(pairs)
        excess.append((pairs[0] - chance.expected) / chance.standard_error)
    assert max(excess) < 4
    assert np.mean(excess) < 1


@given(st.lists(st.integers(0, 200), min_size=NEAR + 1, max_size=NEAR + 1))
def test_scale_of_repeats_is_that_of_the_binomial_tail(counts: list[int]) -> None:
    """At expected + 5 standard errors the binomial tail of a constant density is below 1e-6, whatever was observed."""
    chance = chance_of_repeats(np.array(counts))
    limit = int(np.floor(chance.expected + 5 * chance.standard_error)) + 1
    # For a constant density n_0 : n_k = 1/2 : 1, the least share of all that are admitted.
    tails = [
        binom.sf(limit - 1, limit + apart, 0.5 / (0.5 + ticks))
        for ticks, apart in enumerate(np.cumsum(counts[1:]).tolist(), start=1)
    ]
    assert min(tails) < 1e-6


@given(st.integers(1, 5_000))
def test_scale_of_coincidences_is_that_of_the_binomial_tail(close: int) -> None:
    """The least count beyond expected + 5 standard errors has the probability of five deviates at most."""
    chance = chance_of_coincidences(close)
    limit = int(np.floor(chance.expected + 5 * chance.standard_error + 1e-9)) + 1
    assert chance.expected == close / (2 * NEAR_US)
    assert binom.sf(limit - 1, limit + close, 1 / (2 * NEAR_US + 1)) < 3e-7


@pytest.mark.parametrize("jitter_us", [50.0, 200.0, 1000.0])
def test_jittered_events_coincide_within_their_chance(jitter_us: float) -> None:
    """Pairs of events whose timestamps jitter coincide as often as their close pairs let expect; exact ones never."""
    rng, pixels, deviates = np.random.default_rng(1), 20_000, []
    x = np.tile(np.arange(pixels, dtype=np.uint16), 2)
    exact_us = np.repeat([0.0, 150.0], pixels)
    assert count_repeats(x, 0 * x, (1000 * exact_us).astype(np.int64), (1, pixels), NEAR_US * 1000) == (0, 0)
    for _ in range(20):
        t = np.rint(exact_us + rng.normal(0.0, jitter_us, 2 * pixels)).astype(np.int64) * 1000
        order = np.argsort(t, kind="stable")
        repeats, close = count_repeats(x[order], 0 * x, t[order], (1, pixels), NEAR_US * 1000)
        chance = chance_of_coincidences(close)
        deviates.append((repeats - chance.expected) / chance.standard_error)
    assert max(deviates) < 4
    assert np.mean(deviates) < 0.5


@given(st.floats(1e-9, 300))
def test_scale_of_doubled_ticks_is_that_of_the_poisson_tail(expected: float) -> None:
    """The least count beyond expected + 5 standard errors has a probability of at most that of five deviates."""
    chance = chance_of_doubled_ticks(expected)
    limit = int(np.floor(chance.expected + 5 * chance.standard_error + 1e-9)) + 1
    assert poisson.sf(limit - 1, expected) < 3e-7


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.integers(0, 300))
def test_even_tiles_are_those_of_a_slow_loop(seed: int, count: int) -> None:
    """Counters of each tick give the same numbers of tiles; a tick that is written twice is doubled."""
    shape = (20, 17)
    x, y, t, p = random_events(seed, count, shape, 12)
    # Some ticks twice, in the order of the file.
    times = np.repeat(np.arange(len(t)), 1 + (t // TICK % 3 == 0))
    x, y, t, p = x[times], y[times], t[times], p[times]
    doubled = np.zeros(33, np.int64)
    tiles, even = tally_ticks(x, y, t, p, shape, doubled)
    slow_doubled, slow_tiles, slow_even = Counter[int](), 0, 0
    for tick in np.unique(t):
        at = np.flatnonzero(t == tick)
        cells = Counter((int(y[i]), int(x[i]), int(p[i])) for i in at)
        is_even: dict[tuple[int, int], bool] = {}
        for (row, column, _), number in cells.items():
            tile = (row // TILE_PX, column // TILE_PX)
            is_even[tile] = is_even.get(tile, True) and number % 2 == 0
        if all(is_even.values()) and len(at) >= 8:
            slow_doubled[len(is_even)] += 1
        else:
            slow_tiles, slow_even = slow_tiles + len(is_even), slow_even + sum(is_even.values())
    assert (tiles, even) == (slow_tiles, slow_even)
    assert {i: int(n) for i, n in enumerate(doubled) if n} == dict(slow_doubled)
