"""False alarms come as often as stated, differences are detected, and segments are as long as the correlation asks."""

from itertools import combinations, product

import numpy as np
import pytest
from scipy.stats import binom

from fedora_qa.comparison.distances import (
    Sides,
    chance_of,
    correlation_time,
    enough_units,
    independent_segments,
    standard_errors,
)
from fedora_qa.comparison.subjects import shares_of, wasserstein
from tests.comparison.processes import EDGES, autoregression, blocks_around

LEVEL = 0.05
TRIALS = 200


def chance(before: np.ndarray, after: np.ndarray, *, paired: bool) -> float:
    return chance_of(Sides(before, after, EDGES, paired), LEVEL, np.random.default_rng(3)).of_distance


def surely_more_than(rate: float, count: int) -> bool:
    return bool(binom.sf(count - 1, TRIALS, rate) < 1e-3)


def test_chance_is_the_share_of_all_relabellings() -> None:
    """Against every way to exchange units, one by one."""
    random = np.random.default_rng(1)
    before, after = blocks_around(np.zeros(4), random), blocks_around(np.full(4, 0.1), random)
    pooled = np.concatenate([before, after])
    ways = [pooled[list(chosen)].sum(axis=0) for chosen in combinations(range(8), 4)]
    distances = [wasserstein(shares_of(way), shares_of(pooled.sum(axis=0) - way), EDGES) for way in ways]
    sides = Sides(before, after, EDGES, paired=False)
    share = np.mean(np.array(distances) >= sides.distance * (1 - 1e-9))
    assert chance_of(sides, 1e-3, np.random.default_rng(0)).of_distance == pytest.approx(share, rel=0.3, abs=2e-3)


def test_chance_of_pairs_is_the_share_of_all_exchanges() -> None:
    """Against every way to exchange within pairs, one by one."""
    random = np.random.default_rng(2)
    before, after = blocks_around(np.zeros(6), random), blocks_around(np.full(6, 0.06), random)
    distances = []
    for exchanged in product((False, True), repeat=6):
        side = np.where(np.array(exchanged)[:, None], after, before).sum(axis=0)
        distances.append(wasserstein(shares_of(side), shares_of((before + after).sum(axis=0) - side), EDGES))
    sides = Sides(before, after, EDGES, paired=True)
    share = np.mean(np.array(distances) >= sides.distance * (1 - 1e-9))
    assert chance_of(sides, 1e-3, np.random.default_rng(0)).of_distance == pytest.approx(share, rel=0.3, abs=2e-3)


@pytest.mark.parametrize("paired", [False, True])
def test_false_alarms_of_independent_units(paired: bool) -> None:
    """Of two sides of one process, no more are told apart than the level allows."""
    random = np.random.default_rng(5)
    alarms = 0
    for _ in range(TRIALS):
        centres = random.standard_normal(10)
        others = centres if paired else random.standard_normal(10)
        before, after = blocks_around(centres, random), blocks_around(others, random)
        alarms += chance(before, after, paired=paired) <= LEVEL
    assert not surely_more_than(LEVEL, alarms)


def test_false_alarms_of_two_flights() -> None:
    """Two segments of one process that remembers: as blocks they alarm far too often, as segments they do not."""
    random = np.random.default_rng(6)
    as_blocks = as_segments = 0
    for _ in range(TRIALS):
        before, after = (blocks_around(autoregression(128, 0.7, random), random) for _ in range(2))
        as_blocks += chance(before, after, paired=False) <= LEVEL
        as_segments += chance(independent_segments(before), independent_segments(after), paired=False) <= LEVEL
    assert surely_more_than(4 * LEVEL, as_blocks)
    assert not surely_more_than(1.5 * LEVEL, as_segments)  # the memory that is left between segments, as derived


def test_a_real_difference_is_seen() -> None:
    """Three standard errors beyond what the level asks for are found nearly always."""
    random = np.random.default_rng(7)
    found = 0
    for _ in range(40):
        before, after = (blocks_around(shift + random.standard_normal(16), random) for shift in (0.0, 1.8))
        found += chance(before, after, paired=False) <= LEVEL
    assert found >= 38


def test_standard_errors_are_the_spread_over_repetitions() -> None:
    """What one comparison says of its shift is how shifts scatter over many."""
    random = np.random.default_rng(8)
    shifts, stated = [], []
    for _ in range(60):
        before, after = (blocks_around(random.standard_normal(16), random) for _ in range(2))
        sides = Sides(before, after, EDGES, paired=False)
        middles = (EDGES[1:] + EDGES[:-1]) / 2
        shifts.append(shares_of(after.sum(axis=0)) @ middles - shares_of(before.sum(axis=0)) @ middles)
        stated.append(standard_errors(sides, random)[1])
    assert np.mean([error for error in stated if error]) == pytest.approx(np.std(shifts), rel=0.3)


def test_too_few_units_can_tell_nothing() -> None:
    """Three against three cannot reach one in a hundred; it takes five, or eight pairs. Few units have no spread."""
    counts = np.ones((3, 64), np.int64)
    assert Sides(counts, counts, EDGES, paired=False).least_chance == pytest.approx(2 / 20)
    assert Sides(counts, counts, EDGES, paired=True).least_chance == pytest.approx(2 / 8)
    assert Sides(counts, counts[:1], EDGES, paired=False).least_chance == pytest.approx(1 / 4)
    assert (enough_units(0.01, paired=False), enough_units(0.01, paired=True)) == (5, 8)
    assert standard_errors(Sides(counts, counts, EDGES, paired=True), np.random.default_rng(0)) == (None, None)


def test_nothing_differs_from_itself() -> None:
    """The distance of a side from itself is 0, and chance gives it always."""
    counts = blocks_around(np.zeros(12), np.random.default_rng(9))
    found = chance_of(Sides(counts, counts, EDGES, paired=True), 1e-3, np.random.default_rng(0))
    assert (found.of_distance, found.distance_95) == (1.0, 0.0)


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.8])
def test_correlation_time_of_an_autoregression(memory: float) -> None:
    """It is (1 + a) / (1 - a) blocks for neighbours correlated by a, and somewhat more for its error."""
    random = np.random.default_rng(11)
    times = [correlation_time(blocks_around(3 * autoregression(512, memory, random), random)) for _ in range(8)]
    assert 0.8 < np.mean(times) * (1 - memory) / (1 + memory) < 2.0


def test_nothing_is_lost_between_segments() -> None:
    """Segments hold what the blocks held, at most 16 of them; blocks without values are no time at all."""
    counts = blocks_around(np.zeros(70), np.random.default_rng(12))
    counts[::7] = 0
    segments = independent_segments(counts)
    assert len(segments) in range(8, 17)
    assert np.array_equal(segments.sum(axis=0), counts.sum(axis=0))


def test_a_steady_drift_is_one_segment() -> None:
    """What changes all along the sequence shows one sample of how it changes."""
    drift = np.linspace(-3.0, 3.0, 64)
    assert len(independent_segments(blocks_around(drift, np.random.default_rng(13)))) == 1


def test_one_block_is_one_segment() -> None:
    """A sequence of one block, or of blocks that are all the same, needs no correlation."""
    counts = np.ones((1, 64), np.int64)
    assert np.array_equal(independent_segments(counts), counts)
    assert len(independent_segments(np.ones((64, 64), np.int64))) == 16
