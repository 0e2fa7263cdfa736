"""Orientation, shift and loudness of event images."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift

from fedora_qa.estimators.event_orientation import SYMMETRIES, Moments, block_means, moments, undone
from fedora_qa.estimators.event_rates import Tally, loudness
from fedora_qa.estimators.event_shift import cross_correlation, peak

SHAPE = (24, 36)
TEXTURE = gaussian_filter(np.random.default_rng(0).normal(0, 1, SHAPE), 1.5)
ALL = np.ones(SHAPE, np.bool_)


def as_written(image: np.ndarray, swap: bool, left: bool, up: bool) -> np.ndarray:
    """What a writer that mirrors, then exchanges axes, leaves on a square that holds any of it."""
    done = image[:: -1 if up else 1, :: -1 if left else 1]
    square = np.zeros((max(SHAPE), max(SHAPE)))
    done = done.T if swap else done
    square[: done.shape[0], : done.shape[1]] = done
    return square


@pytest.mark.parametrize("done", SYMMETRIES)
def test_each_symmetry_is_undone_by_its_own(done: tuple[bool, bool, bool]) -> None:
    """Among the eight candidates the one that undoes what was done correlates fully, the others hardly."""
    candidates = undone(as_written(TEXTURE, *done), SHAPE)
    means = block_means(TEXTURE)
    correlations = moments(means, candidates, np.ones(means.shape, np.bool_)).correlations()
    assert correlations[SYMMETRIES.index(done)] == pytest.approx(1.0)
    assert np.sum(np.abs(correlations) > 0.6) == 1


@given(st.integers(0, 2**32 - 1))
def test_correlation_is_that_of_numpy(seed: int) -> None:
    """Moments over the usable blocks give the coefficient of np.corrcoef, and add."""
    rng = np.random.default_rng(seed)
    d, e, whole = rng.normal(2, 1, (5, 7)), rng.normal(0, 3, (5, 7)), rng.uniform(0, 1, (5, 7)) < 0.7
    whole[0, :3] = True
    found = moments(d, [e], whole)
    expected = np.corrcoef(d[whole], e[whole])[0, 1]
    assert found.correlations()[0] == pytest.approx(expected, abs=1e-9)
    left, right = (moments(d[:, part], [e[:, part]], whole[:, part]) for part in (slice(3), slice(3, 7)))
    assert np.allclose(left.sums + right.sums, found.sums)
    assert Moments(np.zeros((1, 6))).correlations()[0] == 0


@pytest.mark.parametrize("count", [1, 2, 35])
def test_frame_variance_is_that_of_numpy(count: int) -> None:
    """The variance of the frame's change over the usable blocks; of a single block 0."""
    change = np.random.default_rng(count).normal(2, 1, (5, 7))
    whole = np.arange(35).reshape(5, 7) < count
    assert moments(change, [change], whole).frame_variance() == pytest.approx(np.var(change[whole]), abs=1e-12)


@pytest.mark.parametrize(("right", "down"), [(0, 0), (3, -2), (-7, 5)])
def test_whole_shifts_are_read_exactly(right: int, down: int) -> None:
    """A pattern in the middle, moved by whole pixels, is found there; its negative as well, with its own sign."""
    image = np.zeros((40, 50))
    image[12:28, 15:35] = TEXTURE[:16, :20]
    moved = np.roll(image, (down, right), axis=(0, 1))
    found = peak(cross_correlation(image, moved, np.ones(image.shape, np.bool_)))
    assert found is not None
    assert found.right_px == pytest.approx(right, abs=0.1)
    assert found.down_px == pytest.approx(down, abs=0.1)


def test_fractions_of_a_pixel_are_read_to_a_twentieth() -> None:
    """A smooth pattern moved by (0.4, -0.25) px by splines is read to 0.05 px."""
    image = gaussian_filter(np.pad(TEXTURE, 12), 1.0)
    moved = shift(image, (-0.25, 0.4), order=5)
    found = peak(cross_correlation(image, moved, np.ones(image.shape, np.bool_)))
    assert found is not None
    assert (found.right_px, found.down_px) == pytest.approx((0.4, -0.25), abs=0.05)


def test_no_peak_where_nothing_agrees() -> None:
    """Blank images, or opposite ones, have none within reach."""
    assert peak(cross_correlation(0 * TEXTURE, TEXTURE, ALL)) is None
    assert peak(cross_correlation(TEXTURE, TEXTURE, ~ALL)) is None


def tally(counts: NDArray[np.int64], runs: NDArray[np.int64]) -> Tally:
    none = np.full(counts.shape, -1, np.int8)
    return Tally(counts, runs, none, none)


@pytest.mark.parametrize("hot", [[(10, 12)], [(10, 12), (10, 13)], [(0, 0)]], ids=["one", "pair", "corner"])
def test_hot_pixels_are_loud(hot: list[tuple[int, int]]) -> None:
    """A pixel that fires 200 times beside ones that fire 20 times stands out, pairs as well, of any polarities."""
    counts = np.random.default_rng(0).poisson(20, SHAPE)
    for place in hot:
        counts[place] += 200
    for runs in (np.ones_like(counts), counts):
        z = loudness(tally(counts, np.minimum(runs, 20 + 200 * (counts > 100)))).z
        assert {(int(row), int(column)) for row, column in zip(*np.nonzero(z > 9), strict=True)} == set(hot)


def test_edges_and_textures_are_not_loud() -> None:
    """Counts that follow a texture or step at an edge stay below 5 sigma."""
    rate = 20 + 15 * np.abs(gaussian_filter(np.random.default_rng(1).normal(0, 6, SHAPE), 1.0))
    rate[:, 18:] *= 6
    counts = np.random.default_rng(2).poisson(rate)
    assert np.max(loudness(tally(counts, np.ones_like(counts))).z) < 5


def swinging(amplitudes: NDArray[np.float64], swings: int) -> Tally:
    """Events of signals (h, w) that swing to and fro by so many thresholds: the sensor followed turn by turn."""
    counts = Tally.of_nothing(amplitudes.shape)
    reference = np.zeros(amplitudes.shape)
    for turn in range(swings):
        signal = amplitudes * (turn % 2 == 0)
        moved = np.trunc(signal - reference).astype(int)
        reference += moved
        for times in range(1, int(np.abs(moved).max()) + 1):
            y, x = np.nonzero(np.abs(moved) >= times)
            counts.add(x.astype(np.uint16), y.astype(np.uint16), (moved[y, x] > 0).astype(np.uint8))
    return counts


def test_pixels_that_just_pass_their_threshold_in_each_swing_are_not_hot() -> None:
    """Edges of 1.05 thresholds beside ones of 0.95, swung across 60 times, are honest; a hot pixel is not."""
    amplitudes = np.full(SHAPE, 0.95)
    amplitudes[5:8, 5:8] = 1.4
    amplitudes[20, 20] = amplitudes[18, 30] = 1.05
    counts = swinging(amplitudes, 60)
    found = loudness(counts)
    assert found.excess[20, 20] == found.swings[20, 20] == counts.runs[20, 20] == 60
    assert found.z.max() < 1
    hot = np.full(200, 12, np.uint16)
    counts.add(hot, hot, (np.arange(200) % 2).astype(np.uint8))
    assert loudness(counts).z[12, 12] > 10


def test_tallies_join_as_if_never_cut() -> None:
    """Runs of one polarity that a cut divides are one again, and pixels that fire on one side only lose nothing."""
    rng = np.random.default_rng(4)
    x, y, p = (rng.integers(0, top, 400).astype(kind) for top, kind in ((5, np.uint16), (4, np.uint16), (2, np.uint8)))
    whole = Tally.of_nothing((4, 5))
    whole.add(x, y, p)
    joined = Tally.of_nothing((4, 5))
    for part in np.split(np.arange(400), [3, 3, 10, 200]):
        later = Tally.of_nothing((4, 5))
        later.add(x[part], y[part], p[part])
        joined = joined.then(later)
    for name in Tally.__slots__:
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))
    of_pixel = p[(x == 2) & (y == 1)].astype(int)
    assert whole.runs[1, 2] == 1 + np.count_nonzero(np.diff(of_pixel))
