"""Fits of the event response from normal equations whose solution is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.events.threshold_fit import (
    FEWEST_BLOCKS,
    FEWEST_PAIRS,
    FEWEST_TIMES,
    NormalBlocks,
    concatenate,
    fit_interpolation,
    fit_response,
    normal_blocks,
)
from fedora_qa.estimators.fitting.tails import student_factor

Floats = NDArray[np.float64]
THETA = np.array([0.21, 0.19, 2e-3, -3e-4])
PER_BLOCK = 50.0


def blocks_of(thetas: Floats, times_s: Floats | None = None, variance: float = 0.0) -> NormalBlocks:
    """Blocks of 50 samples each with orthogonal regressors, on which block i has the parameters ``thetas[i]``."""
    count = len(thetas)
    every = np.full(count, PER_BLOCK)
    return NormalBlocks(
        matrices=PER_BLOCK * np.tile(np.eye(4), (count, 1, 1)),
        vectors=PER_BLOCK * thetas,
        squares=PER_BLOCK * (np.sum(thetas**2, axis=1) + variance),
        weights=every,
        counts=every,
        times_s=np.zeros(count) if times_s is None else times_s,
    )


def test_exact_blocks_give_every_parameter() -> None:
    """The delay is that at the mean time of the blocks, and changes at its rate."""
    times_s = 3.0 + np.arange(12.0)
    thetas = np.tile(THETA, (12, 1))
    thetas[:, 2] += 1e-4 * (times_s - times_s.mean())
    fit = fit_interpolation(blocks_of(thetas, times_s))
    assert fit is not None
    found = fit.threshold_on, fit.threshold_off, fit.delay_s, fit.kappa_s, fit.delay_rate, fit.middle_s
    assert found == pytest.approx((*THETA, 1e-4, times_s.mean()))
    assert fit.sigma == pytest.approx(0.0, abs=1e-7)


def test_formal_errors_are_those_of_the_residuals() -> None:
    """With n orthogonal regressors of unit square each, the variance of a parameter is that of the residuals over n."""
    fit = fit_interpolation(blocks_of(np.tile(THETA, (12, 1)), variance=0.09))
    assert fit is not None
    assert fit.sigma == pytest.approx(0.3)
    errors = fit.standard_errors
    assert (errors.threshold_on, errors.delay_s) == pytest.approx((0.3 / np.sqrt(12 * PER_BLOCK),) * 2)
    # A residual that lies along the slope wholly, of unit square, is a delay as large as itself.
    assert fit.coherent_delay_s == pytest.approx(0.3)
    assert errors.delay_rate == np.inf


@pytest.mark.parametrize("times", [FEWEST_TIMES - 1, FEWEST_TIMES])
def test_a_rate_needs_several_times(times: int) -> None:
    thetas = np.tile(THETA, (12, 1))
    thetas[:, 2] += 1e-4 * np.arange(12)
    fit = fit_interpolation(blocks_of(thetas, np.arange(12.0) % times))
    assert fit is not None
    assert np.isfinite(fit.standard_errors.delay_rate) == (times >= FEWEST_TIMES)


@pytest.mark.parametrize("late", [False, True], ids=["thresholds", "delay"])
def test_blocks_that_share_errors_with_their_group_count_as_one(late: bool) -> None:
    """The error is the standard error of six groups, widened as Student's; by blocks alone it is far smaller."""
    column = 2 if late else 0
    of_group = 1e-3 * np.random.default_rng(1).normal(size=6)
    group = np.repeat(np.arange(6), 10)
    thetas = np.tile(THETA, (60, 1))
    thetas[:, column] += of_group[group]
    blocks = blocks_of(thetas)
    other = np.arange(60) % 7
    fits = [fit_interpolation(blocks, groups) for groups in ((), (other, 5 + 3 * group))]
    alone, grouped = (
        (fit.standard_errors.delay_s if late else fit.standard_errors.threshold_on) for fit in fits if fit is not None
    )
    scatter = thetas[:, column].std(ddof=1) / np.sqrt(60)
    assert alone == pytest.approx(scatter)
    assert grouped == pytest.approx(of_group.std(ddof=1) / np.sqrt(6) * student_factor(5))


def test_few_groups_say_nothing() -> None:
    """Two halves of the time that differ are no scatter: the errors stay those of the blocks."""
    thetas = np.tile(THETA, (60, 1))
    thetas[:30, 0] += 1e-3
    blocks = blocks_of(thetas)
    halves = (np.arange(60) < 30).astype(np.intp)
    alone, grouped = (fit_interpolation(blocks, groups) for groups in ((), (halves,)))
    assert alone is not None
    assert grouped is not None
    assert grouped.standard_errors.threshold_on <= alone.standard_errors.threshold_on * student_factor(59)


def test_few_samples_and_few_blocks_are_not_fitted() -> None:
    """Three blocks, and two samples in sum below the least number, have no fit; one more has."""
    thetas = np.tile(THETA, (FEWEST_BLOCKS, 1))
    assert fit_interpolation(blocks_of(thetas)) is not None
    assert fit_interpolation(blocks_of(thetas[1:])) is None
    for missing in (0, 1):
        counts = np.full(FEWEST_BLOCKS, FEWEST_PAIRS / FEWEST_BLOCKS)
        counts[0] -= missing
        blocks = blocks_of(thetas)
        few = NormalBlocks(blocks.matrices, blocks.vectors, blocks.squares, blocks.weights, counts, blocks.times_s)
        assert (fit_interpolation(few) is None) == bool(missing)


def test_one_polarity_is_not_fitted() -> None:
    """Without darker events C- is not identifiable."""
    blocks = blocks_of(np.tile(THETA, (12, 1)))
    matrices = blocks.matrices.copy()
    matrices[:, 1] = matrices[:, :, 1] = 0.0
    single = NormalBlocks(matrices, blocks.vectors, blocks.squares, blocks.weights, blocks.counts, blocks.times_s)
    assert fit_interpolation(single) is None


def test_blocks_hold_the_equations_of_their_rows() -> None:
    """By NumPy's products of the rows of each block; blocks without rows are dropped where sums are joined."""
    rng = np.random.default_rng(2)
    X, y, weights, times_s = rng.normal(size=(60, 4)), rng.normal(size=60), rng.random(60), rng.random(60)
    block_of_row = rng.choice([0, 2], 60)
    found = normal_blocks(X, y, weights, block_of_row, 3, times_s)
    assert found.counts[1] == found.weights[1] == found.times_s[1] == 0.0
    for block in (0, 2):
        rows = block_of_row == block
        W = np.diag(weights[rows])
        np.testing.assert_allclose(found.matrices[block], X[rows].T @ W @ X[rows])
        np.testing.assert_allclose(found.vectors[block], X[rows].T @ W @ y[rows])
        assert found.squares[block] == pytest.approx(y[rows] @ W @ y[rows])
        assert (found.weights[block], found.counts[block]) == pytest.approx((weights[rows].sum(), rows.sum()))
        assert found.times_s[block] == pytest.approx(times_s[rows].mean())
    joined = concatenate([found, found])
    np.testing.assert_array_equal(joined.matrices, found.matrices[[0, 2, 0, 2]])
    np.testing.assert_array_equal(joined.times_s, found.times_s[[0, 2, 0, 2]])


def test_residuals_of_a_block_are_those_of_its_pairs() -> None:
    """Of level pairs, whose rates count with the delay at the time of the block."""
    rng = np.random.default_rng(3)
    X, times_s, block_of_row = rng.normal(size=(4000, 4)), np.repeat(np.arange(8.0), 500), np.repeat(np.arange(8), 500)
    steps, delay_s = np.array([0.21, 0.19]), 0.05 + 0.01 * (times_s - 3.5)
    sizes = 0.02 * (1 + block_of_row)
    y = X[:, :2] @ steps + delay_s * (X[:, 2:] @ steps) + sizes * rng.normal(size=4000)
    blocks = normal_blocks(X, y, np.ones(4000), block_of_row, 8, times_s)
    fit = fit_response(blocks)
    assert fit is not None
    assert (fit.delay_s, fit.delay_rate) == pytest.approx((0.05, 0.01), abs=0.02)
    exact = replace(fit, threshold_on=0.21, threshold_off=0.19, delay_s=0.05, delay_rate=0.01, middle_s=3.5)
    residuals = (y - X[:, :2] @ steps - delay_s * (X[:, 2:] @ steps)).reshape(8, 500)
    np.testing.assert_allclose(exact.block_sigmas(blocks), np.sqrt(np.mean(residuals**2, axis=1)))
    assert (fit.threshold, fit.relative_sigma) == pytest.approx((0.2, fit.sigma / 0.2), abs=0.05)
