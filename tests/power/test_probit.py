"""The fitted curve is the likeliest, and its intervals hold the truth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import norm

from fedora_qa.power.probit import fit_probit

Floats = NDArray[np.float64]
Answers = NDArray[np.bool_]

HALF, SLOPE = 0.3, 2.5


def trials(number: int, seed: int, slope: float = SLOPE) -> tuple[Floats, Answers]:
    """ln sizes over a range of 80, and whether each was found."""
    rng = np.random.default_rng(seed)
    log_sizes = rng.uniform(-2.2, 2.2, number)
    return log_sizes, rng.random(number) < norm.cdf(slope * (log_sizes - HALF))


def test_agrees_with_maximum_likelihood_of_many() -> None:
    """Of 3000 trials, the fit is the maximum of the plain likelihood, found by another optimiser, to a percent."""
    log_sizes, found = trials(3000, seed=1)
    signs = np.where(found, 1.0, -1.0)
    best = minimize(lambda at: -norm.logcdf(signs * (at[0] + at[1] * log_sizes)).sum(), [0.0, 1.0], method="BFGS").x
    fit = fit_probit(log_sizes, found)
    assert fit.log_half == pytest.approx(-best[0] / best[1], abs=0.01)
    assert np.exp(fit.log_slope) == pytest.approx(best[1], rel=0.01)
    assert not fit.separated


def test_intervals_cover_the_truth() -> None:
    """Of 60 trials, the intervals of the sizes found 50% and 95% of the time hold the truth in 95% of 120 studies.

    120 studies of which 95% do have fewer than 107 with a probability of 1e-3.
    """
    covered = {0.50: 0, 0.95: 0}
    for seed in range(120):
        fit = fit_probit(*trials(60, seed))
        for probability in covered:
            _, low, high = fit.log_size_at(probability)
            truth = HALF + norm.ppf(probability) / SLOPE
            covered[probability] += (low is None or low <= truth) and (high is None or truth <= high)
    assert min(covered.values()) >= 107


def test_band_holds_the_estimate_and_rises() -> None:
    """The curve lies within its band, and all three rise with size."""
    fit = fit_probit(*trials(40, seed=3))
    columns = fit.probability_at(np.linspace(-2, 2, 50))
    best, low, high = columns
    assert ((low <= best) & (best <= high)).all()
    assert all((np.diff(column) >= 0).all() for column in columns)


def test_separated_trials_have_a_finite_limit() -> None:
    """Where a size divides found from not found, the limits lie about it, and the interval of the half within reach."""
    log_sizes = np.linspace(-2, 2, 41)
    fit = fit_probit(log_sizes, log_sizes > 0.05)
    value, low, high = fit.log_size_at(0.5)
    assert fit.separated
    assert value is not None
    assert low is not None
    assert high is not None
    assert 0.0 < value < 0.1
    assert -0.2 < low < value < high < 0.3


def test_what_trials_cannot_tell_is_unknown() -> None:
    """Three trials bound no size found 95% of the time from above."""
    value, _, high = fit_probit(np.array([0.0, 0.1, 0.2]), np.array([False, True, False])).log_size_at(0.95)
    assert (value, high) == (None, None)


@settings(max_examples=20, deadline=None)
@given(st.floats(-20, 20), st.integers(0, 50))
def test_another_unit_shifts_everything(shift: float, seed: int) -> None:
    """Sizes in another unit give the same limit in that unit."""
    log_sizes, found = trials(30, seed)
    here, there = fit_probit(log_sizes, found), fit_probit(log_sizes + shift, found)
    assert there.log_half - shift == pytest.approx(here.log_half, abs=1e-3)
    assert there.log_slope == pytest.approx(here.log_slope, abs=1e-3)


@pytest.mark.parametrize("found", [[True, True], [False, False]])
def test_refuses_what_cannot_be_fitted(found: list[bool]) -> None:
    """All found, or none, is no curve."""
    with pytest.raises(ValueError, match="found and not found"):
        fit_probit(np.array([0.0, 1.0]), np.array(found))
