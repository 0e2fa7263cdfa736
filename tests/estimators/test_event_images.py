"""Orientation, shift and neighbours of event images."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift

from fedora_qa.estimators.events.orientation import (
    SYMMETRIES,
    ChangeMoments,
    add_events_beyond,
    event_blocks,
    level_blocks,
    span_moments,
    step_moments,
)
from fedora_qa.estimators.events.rates import PixelCounts, neighbour_excess
from fedora_qa.estimators.events.row_kernels import EVENT, RUN
from fedora_qa.estimators.events.shift import cross_correlation, peak

SHAPE = (24, 36)
TEXTURE = gaussian_filter(np.random.default_rng(0).normal(0, 1, SHAPE), 1.5)
ALL = np.ones(SHAPE, np.bool_)


def block_means(image: np.ndarray) -> np.ndarray:
    """Means over the blocks of 4 x 4 that fit into the middle."""
    rows, columns = image.shape[0] // 4, image.shape[1] // 4
    top, left = (image.shape[0] - 4 * rows) // 2, (image.shape[1] - 4 * columns) // 2
    return image[top : top + 4 * rows, left : left + 4 * columns].reshape(rows, 4, columns, 4).mean(axis=(1, 3))


def log_blocks(level: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Block means of the logarithm of light of such a level, less a little that is dark."""
    light = (np.exp(level) - 0.25).astype(np.float32)
    return level_blocks(light, np.where(known, 0, np.inf).astype(np.float32), 0.25)


def written(counts: np.ndarray, swap: bool, left: bool, up: bool) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns at which a writer that mirrors, then exchanges axes, leaves events of an image of counts."""
    rows, columns = np.nonzero(counts)
    rows = SHAPE[0] - 1 - rows if up else rows
    columns = SHAPE[1] - 1 - columns if left else columns
    return (columns, rows) if swap else (rows, columns)


@pytest.mark.parametrize("done", SYMMETRIES)
def test_each_symmetry_is_undone_by_its_own(done: tuple[bool, bool, bool]) -> None:
    """Among the eight candidates the one that undoes what was done correlates fully, the others hardly.

    Axes that were exchanged put events beyond the sensor; these count as well.
    """
    bright = (np.quantile(TEXTURE, 0.7) < TEXTURE).astype(np.int32)
    rows, columns = written(bright, *done)
    inside = (rows < SHAPE[0]) & (columns < SHAPE[1])
    counts = np.zeros((1, 2, *SHAPE), np.int32)
    counts[0, 1, rows[inside], columns[inside]] = 1
    events = event_blocks(counts, 0.2, 0.3)
    p, times_ns = np.ones(len(rows), np.uint8), np.full(len(rows), 5)
    add_events_beyond(events, columns, rows, times_ns, p, np.array([0, 10]), SHAPE, 0.2, 0.3)
    levels = np.stack([0 * bright, bright]).astype(np.float32)
    blocks = np.stack([log_blocks(level, ALL) for level in levels])
    correlations = ChangeMoments(step_moments(blocks, events, 4)[0].sum(axis=0)).correlations()
    assert correlations[SYMMETRIES.index(done)] == pytest.approx(1.0)
    assert np.sum(np.abs(correlations) > 0.6) == 1
    assert np.allclose(span_moments(blocks, events).correlations(), correlations)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_moments_are_those_of_numpy(seed: int) -> None:
    """Of blocks that are lit in both frames, tile by tile: the coefficient of np.corrcoef of block means."""
    rng = np.random.default_rng(seed)
    levels = rng.normal(5, 1, (2, *SHAPE)).astype(np.float32)
    lit = rng.uniform(size=levels.shape) < 0.99
    counts = rng.poisson(0.5, (1, 2, *SHAPE)).astype(np.int32)
    blocks = np.stack([log_blocks(level, known) for level, known in zip(levels, lit, strict=True)])
    sums = step_moments(blocks, event_blocks(counts, 0.2, 0.3), 1)
    d, e = block_means(levels[1] - levels[0]), block_means(0.2 * counts[0, 1] - 0.3 * counts[0, 0])
    whole = block_means((lit[0] & lit[1]).astype(float)) == 1
    assert ChangeMoments(sums[0, 0]).correlations()[0] == pytest.approx(np.corrcoef(d[whole], e[whole])[0, 1], abs=1e-5)
    assert ChangeMoments(sums[0, 0]).frame_variance() == pytest.approx(np.var(d[whole]), abs=1e-5)
    tiled = step_moments(blocks, event_blocks(counts, 0.2, 0.3), 4)
    assert np.allclose(tiled.sum(axis=1), sums[:, 0])
    assert ChangeMoments(np.zeros((1, 6))).correlations()[0] == 0


@pytest.mark.parametrize("dark", [None, 0.0, 0.5])
@pytest.mark.parametrize("shape", [(24, 36), (23, 37), (3, 9)])
def test_block_means_are_those_of_the_signal(shape: tuple[int, int], dark: float | None) -> None:
    """Light or its logarithm, from black to white; NaN where the light is not above twice its error anywhere."""
    light = np.random.default_rng(3).uniform(0, 255, shape).astype(np.float32)
    light[:, :3], error = 255, np.zeros(shape, np.float32)
    signal = light.astype(np.float64) if dark is None else np.log(light.astype(np.float64) + dark)
    side = min(4, *shape)
    top, left = (shape[0] % side) // 2, (shape[1] % side) // 2
    error[top, left] = 255
    rows, columns = shape[0] // side, shape[1] // side
    inside = signal[top : top + rows * side, left : left + columns * side]
    expected = inside.reshape(rows, side, columns, side).mean(axis=(1, 3))
    found = level_blocks(light, error, dark)
    assert np.isnan(found[0, 0])
    assert np.count_nonzero(np.isnan(found)) == 1
    assert found.ravel()[1:] == pytest.approx(expected.ravel()[1:], rel=1e-7)


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


def tally(counts: NDArray[np.int64], runs: NDArray[np.int64]) -> PixelCounts:
    return PixelCounts(counts * EVENT + runs * RUN)


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
    found = neighbour_excess(counts)
    assert found.events[20, 20] == found.swings[20, 20] == counts.runs[20, 20] == 60
    assert found.z.max() < 1
    hot = np.full(200, 12, np.uint16)
    counts.add(hot, hot, (np.arange(200) % 2).astype(np.uint8))
    assert neighbour_excess(counts).z[12, 12] > 10


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
