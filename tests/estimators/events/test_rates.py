"""Loudness of event images."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fedora_qa.estimators.events.pixels import EVENT, RUN
from fedora_qa.estimators.events.rates import PixelCounts, neighbour_excess

SHAPE = (24, 36)
TEXTURE = gaussian_filter(np.random.default_rng(0).normal(0, 1, SHAPE), 1.5)
ALL = np.ones(SHAPE, np.bool_)


def tally(counts: NDArray[np.int64], runs: NDArray[np.int64]) -> PixelCounts:
    none = np.zeros_like(counts)
    return PixelCounts(counts * EVENT + runs * RUN, none, none)


@pytest.mark.parametrize("hot", [[(10, 12)], [(10, 12), (10, 13)], [(0, 0)]], ids=["one", "pair", "corner"])
def test_hot_pixels_are_loud(hot: list[tuple[int, int]]) -> None:
    """A pixel that fires 200 times beside ones that fire 20 times stands out, pairs as well, of any polarities."""
    counts = np.random.default_rng(0).poisson(20, SHAPE)
    for place in hot:
        counts[place] += 200
    for runs in (np.ones_like(counts), counts):
        z = neighbour_excess(tally(counts, np.minimum(runs, 20 + 200 * (counts > 100)))).z
        assert {(int(row), int(column)) for row, column in zip(*np.nonzero(z > 9), strict=True)} == set(hot)


def test_edges_and_textures_are_not_loud() -> None:
    """Counts that follow a texture or step at an edge stay below 5 sigma."""
    rate = 20 + 15 * np.abs(gaussian_filter(np.random.default_rng(1).normal(0, 6, SHAPE), 1.0))
    rate[:, 18:] *= 6
    counts = np.random.default_rng(2).poisson(rate)
    assert np.max(neighbour_excess(tally(counts, np.ones_like(counts))).z) < 5


def swinging(amplitudes: NDArray[np.float64], swings: int) -> PixelCounts:
    """Events of signals (h, w) that swing to and fro by so many thresholds: the sensor followed turn by turn."""
    counts = PixelCounts.of_nothing(amplitudes.shape)
    events: list[NDArray[np.int64]] = []
    reference = np.zeros(amplitudes.shape)
    for turn in range(swings):
        signal = amplitudes * (turn % 2 == 0)
        moved = np.trunc(signal - reference).astype(int)
        reference += moved
        for times in range(1, int(np.abs(moved).max()) + 1):
            y, x = np.nonzero(np.abs(moved) >= times)
            events.append(np.stack([x, y, moved[y, x] > 0]))
    x, y, p = np.concatenate(events, axis=1)
    counts.add(x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8))
    return counts


def test_pixels_that_just_pass_their_threshold_in_each_swing_are_not_hot() -> None:
    """Edges of 1.05 thresholds beside ones of 0.95, swung across 60 times, are honest; a hot pixel is not."""
    amplitudes = np.full(SHAPE, 0.95)
    amplitudes[5:8, 5:8] = 1.4
    amplitudes[20, 20] = amplitudes[18, 30] = 1.05
    counts = swinging(amplitudes, 60)
    found = neighbour_excess(counts)
    assert found.events[20, 20] == found.swings[20, 20] == counts.runs[20, 20] == 60
    assert found.z.max() < 1
    hot = np.full(200, 12, np.uint16)
    counts.add(hot, hot, (np.arange(200) % 2).astype(np.uint8))
    assert neighbour_excess(counts).z[12, 12] > 10


@pytest.mark.parametrize("thresholds", [2.5, 4.5])
def test_a_single_pixel_that_follows_the_swings_of_a_scene_is_not_hot(thresholds: float) -> None:
    """An edge swings in one pixel alone, by several thresholds; chance of the same rate and reversals is hot."""
    amplitudes = np.zeros(SHAPE)
    amplitudes[5, 4:9] = 1.5
    amplitudes[15, 20] = thresholds
    counts = swinging(amplitudes, 80)
    assert counts.events[15, 20] > 150
    assert neighbour_excess(counts).z.max() < 1
    hot = np.full(160, 12, np.uint16)
    counts.add(hot, hot, np.random.default_rng(5).integers(0, 2, 160).astype(np.uint8))
    persistent = np.full(160, 20, np.uint16)
    counts.add(persistent, persistent, np.ones(160, np.uint8))
    z = neighbour_excess(counts).z
    assert z[12, 12] > 7
    assert z[20, 20] > 10


def test_tallies_join_as_if_never_cut() -> None:
    """Runs of one polarity that a cut divides are one again, and pixels that fire on one side only lose nothing."""
    rng = np.random.default_rng(4)
    x, y, p = (rng.integers(0, top, 400).astype(kind) for top, kind in ((5, np.uint16), (4, np.uint16), (2, np.uint8)))
    whole = PixelCounts.of_nothing((4, 5))
    whole.add(x, y, p)
    joined = PixelCounts.of_nothing((4, 5))
    for part in np.split(np.arange(400), [3, 3, 10, 200]):
        later = PixelCounts.of_nothing((4, 5))
        later.add(x[part], y[part], p[part])
        joined = joined.then(later)
    np.testing.assert_array_equal(joined.packed, whole.packed)
    of_pixel = p[(x == 2) & (y == 1)].astype(int)
    assert whole.runs[1, 2] == 1 + np.count_nonzero(np.diff(of_pixel))
