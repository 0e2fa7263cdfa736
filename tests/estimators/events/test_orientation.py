"""Moments of events and frames under the symmetries of the square."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from fedora_qa.estimators.events.block_means import add_events_beyond, event_blocks, level_blocks
from fedora_qa.estimators.events.orientation import (
    DEPENDENT,
    SYMMETRIES,
    ChangeMoments,
    implied_moments,
    most_reoriented,
    other_correlations,
    responding_shares,
    span_moments,
    step_moments,
    transformation,
)

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


def test_each_other_orientation_has_its_transform() -> None:
    """Inverted polarity negates the correlation: of the sixteen, all but the declared one, each once."""
    correlations = np.arange(1.0, 9.0)
    others = other_correlations(correlations)
    for number, value in enumerate(others):
        inverted, symmetry = transformation(number)
        assert value == (-1 if inverted else 1) * correlations[SYMMETRIES.index(symmetry)]
    assert len({transformation(number) for number in range(len(others))}) == 15
    assert (False, SYMMETRIES[0]) not in {transformation(number) for number in range(len(others))}


@pytest.mark.parametrize("size", [0.1, 1.0, 5.0])
def test_implied_events_are_whole_thresholds_of_the_change(size: float) -> None:
    """Moments are those of NumPy over blocks that are known throughout; none of a change below the thresholds."""
    change = size * TEXTURE / np.abs(TEXTURE).max()
    events = np.vectorize(lambda d: 0.2 * int(d / 0.2) if d > 0 else 0.3 * int(d / 0.3))(change)
    unknown = change.copy()
    unknown[0, 0] = np.nan
    d, e = block_means(change).ravel()[1:], block_means(events).ravel()[1:]
    due = [[len(d), d.sum(), e.sum(), d @ d, e @ e, d @ e]]
    np.testing.assert_allclose(implied_moments(unknown, 0.2, 0.3).sums, due, atol=1e-9)
    single = implied_moments(unknown.astype(np.float32), 0.2, 0.3)
    # Values of a block err by less than 1e-6 of the largest change, and products by its square.
    np.testing.assert_allclose(single.sums, due, atol=1e-6 * len(d) * max(size, 1.0) ** 2)
    assert (implied_moments(change, 0.2, 0.3).correlations()[0] > 0.9) == (size > 0.2)
    assert (implied_moments(change, 0.2, 0.3).correlations()[0] == 0) == (size < 0.2)


def test_pixels_respond_once_they_have_left_the_first_frame_by_a_threshold() -> None:
    """Of four known pixels one is brighter by C+ in the second window, one darker by C- in the third."""
    first = np.array([0.0, 1.0, 2.0, 3.0, np.nan])
    second = np.add(first, [0.2, -0.15, 0.1, 0.0, 0.0])
    third = np.add(first, [0.0, -0.3, 0.1, -0.2, 0.0])
    windows = [np.stack([level, level, level]) for level in (first, second, third)]
    np.testing.assert_allclose(responding_shares(np.array(windows), 0.2, 0.3), [0.0, 0.25, 0.5], atol=1e-9)
    np.testing.assert_allclose(responding_shares(np.full((2, 3, 4), np.nan), 0.2, 0.3), 1.0)


def moments(best: int | None, count: int = 400, correlation: float = 0.9) -> ChangeMoments:
    """Blocks of unit variance that correlate as declared, or, where a symmetry is named, under it instead."""
    sums = np.tile([count, 0.0, 0.0, count, count, 0.0], (8, 1))
    sums[0 if best is None else best, 5] = correlation * count
    return ChangeMoments(sums)


def test_parts_of_another_orientation_are_named() -> None:
    """Two of eight parts are mirrored; blocks too few, and without contrast beyond noise, are not compared."""
    parts = [*(moments(None) for _ in range(5)), moments(3), moments(3, count=900), moments(5, count=99)]
    found = most_reoriented(parts, noise=0.1)
    assert found is not None
    assert transformation(found.orientation) == (False, SYMMETRIES[3])
    assert found.parts.tolist() == [False] * 5 + [True, True, False]
    assert (found.declared, found.other, found.compared) == pytest.approx((0.0, 0.9, 7))
    assert found.standard_error == pytest.approx(DEPENDENT / np.sqrt(400))


def test_where_few_parts_agree_as_declared_none_is_an_outlier() -> None:
    """Two of eight parts are a quarter, three are more; half of the correlation that noise allows must be reached."""
    for upright, is_told in ((2, False), (3, True)):
        parts = [*(moments(None) for _ in range(upright)), *(moments(3) for _ in range(8 - upright))]
        assert (most_reoriented(parts, noise=0.1) is not None) == is_told
    # With as much noise as signal sqrt(1/2) is due.
    for correlation, is_told in ((0.36, True), (0.35, False)):
        parts = [moments(None, correlation=correlation) for _ in range(8)]
        assert (most_reoriented(parts, noise=1.0) is not None) == is_told
    # Noise that leaves less than 0.3 makes a part worthless: sqrt(1 / (1 + 10.2)) is less.
    assert most_reoriented([moments(None)] * 8, noise=10.2) is None
    assert most_reoriented([moments(None)] * 8, noise=10.0) is not None


@given(st.floats(-100, 100), st.integers(1, 50))
def test_equal_changes_have_no_variance(change: float, count: int) -> None:
    """Sums of rounded numbers may differ by their last digits, and never in the wrong direction."""
    numbers = np.full(count, change)
    sums = np.array([[count, numbers.sum(), 0.0, (numbers**2).sum(), 0.0, 0.0]])
    assert 0.0 <= ChangeMoments(sums).frame_variance() <= 1e-13 * change**2
