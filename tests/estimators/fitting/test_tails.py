"""Tails of distributions against scipy.stats, far out as well, and of the largest of many values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.stats import norm, t

from fedora_qa.estimators.fitting import tails
from fedora_qa.estimators.fitting.tails import FEWEST_VALUES, TAIL, chance_of_largest, shared_errors, student_factor

CHANCES = st.floats(1e-9, 0.999)
FREEDOMS = st.floats(1.0, 1e4)


@given(CHANCES, FREEDOMS, FREEDOMS)
def test_values_that_are_exceeded_with_a_chance(chance: float, freedom: float, other: float) -> None:
    assert tails.normal_beyond(chance) == pytest.approx(stats.norm.isf(chance), rel=1e-9, abs=1e-12)
    assert tails.student_beyond(chance, freedom) == pytest.approx(stats.t.isf(chance, freedom), rel=1e-9, abs=1e-12)
    assert tails.chi_squared_beyond(chance, freedom) == pytest.approx(stats.chi2.isf(chance, freedom), rel=1e-9)
    assert tails.fisher_beyond(chance, freedom, other) == pytest.approx(stats.f.isf(chance, freedom, other), rel=1e-6)


@given(st.floats(-30.0, 200.0), FREEDOMS)
def test_chance_of_a_value_of_student(value: float, freedom: float) -> None:
    assert tails.chance_of_student(value, freedom) == pytest.approx(stats.t.sf(value, freedom), rel=1e-9, abs=1e-300)


@given(st.integers(0, 2000), st.integers(0, 2000), st.floats(1e-6, 1.0))
def test_chance_of_so_many_hits(one: int, other: int, share: float) -> None:
    hits, trials = min(one, other), max(one, other)
    found = tails.log_chance_of_hits(np.array([hits]), np.array([trials]), share)
    with np.errstate(divide="ignore"):
        expected = stats.binom.logsf(hits - 1, trials, share)
    if expected > -600:  # below, the probability is denormal
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("share", [1e-6, 0.3, 0.9])
def test_chance_of_a_hit_in_any_trial_and_in_all(share: float) -> None:
    """At least one of n has the chance 1 - (1 - p)^n, all of n have p^n, and one of one has p."""
    found = tails.log_chance_of_hits([1, 20, 1], [20, 20, 1], share)
    assert found == pytest.approx([np.log(-np.expm1(20 * np.log1p(-share))), 20 * np.log(share), np.log(share)])


def test_no_hits_are_certain_and_no_trial_has_none() -> None:
    assert tails.log_chance_of_hits([0, 0], [0, 10], 0.0).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("width", [1e-3, 1.0, 40.0])
@pytest.mark.parametrize("noisy", [24, 50], ids=["half", "all"])
def test_noise_is_taken_for_noise(width: float, noisy: int) -> None:
    """Of two hundred sets of vectors, all of fifty or half of them normal, few have a largest one that is rare."""
    rng = np.random.default_rng(3)
    share = (np.arange(50) < noisy)[:, np.newaxis]
    chances = [chance_of_largest(share * rng.normal(0, width, (50, 2)), np.full((50, 2), 1e-6)) for _ in range(200)]
    assert np.median(chances) > 0.3
    assert np.mean(np.array(chances) < 0.001) <= 0.03


def test_one_value_that_is_far_off_is_no_noise() -> None:
    """Fifteen widths are beyond any chance, wherever most values lie."""
    values = np.random.default_rng(3).normal(5.0, 0.1, (50, 2))
    values[17, 1] += 1.5
    assert chance_of_largest(values, np.full((50, 2), 0.01)) < 1e-4


def test_errors_widen_what_is_expected() -> None:
    """Values that agree better than their errors say are not rare for a small deviation."""
    values = np.zeros((30, 2))
    values[4, 0] = 0.1
    assert chance_of_largest(values, np.full((30, 2), 0.1)) == 1.0
    assert chance_of_largest(values, np.full((30, 2), 0.001)) < 1e-4


def test_few_values_tell_nothing() -> None:
    """Below eight, and where values are not finite, nothing is said."""
    values = np.zeros((20, 2))
    values[0] = 9.0
    values[FEWEST_VALUES - 1 :] = np.nan
    assert chance_of_largest(values, np.ones((20, 2))) == 1.0


@pytest.mark.parametrize(("outliers", "is_rare"), [(10, True), (11, False)])
def test_many_outliers_are_another_distribution(outliers: int, is_rare: bool) -> None:
    """Of forty values a quarter may lie far off; of more of them none is rare."""
    values = np.random.default_rng(3).normal(0, 1, (40, 1))
    values[:outliers] = 1e3
    assert (chance_of_largest(values, np.full((40, 1), 0.01)) < 1e-4) == is_rare


def test_freedom_is_that_of_the_scatter_of_the_median_absolute_deviation() -> None:
    """The relative variance of its square is that of a variance, two over the degrees of freedom."""
    deviations = np.abs(np.random.default_rng(6).standard_normal((6000, 400)))
    squares = np.median(deviations, axis=1) ** 2
    assert np.var(squares) / np.mean(squares) ** 2 == pytest.approx(2 / (tails._FREEDOM * 400), rel=0.08)


@pytest.mark.parametrize("freedom", [4, 9, 30])
def test_widened_errors_alarm_as_rarely_as_known_ones(freedom: int) -> None:
    """Beyond z widened errors, z the normal quantile of TAIL, a value over an estimated error lies with chance TAIL."""
    limit = norm.isf(TAIL) * student_factor(freedom)
    assert t.sf(limit, freedom) == pytest.approx(TAIL, rel=1e-6)


def test_many_groups_need_no_widening() -> None:
    """Student's distribution becomes the normal one."""
    assert student_factor(10_000) == pytest.approx(1.0, abs=2e-3)


def test_groups_that_share_nothing_are_seldom_widened() -> None:
    """Of independent parts, groups scatter beyond chance in at most one case of twenty."""
    rng = np.random.default_rng(1)
    parts, groups = 60, 6
    values = rng.standard_normal((4000, groups, parts // groups))
    by_part = values.reshape(4000, -1).std(axis=1, ddof=1) / parts**0.5
    by_group = values.mean(axis=2).std(axis=1, ddof=1) / groups**0.5
    widened = shared_errors(by_part, parts, by_group, groups) > 1.01 * np.maximum(by_part, by_group)
    assert 0.01 < widened.mean() < 0.06


@pytest.mark.parametrize(("parts", "groups"), [(40, 2), (40, 6), (3, 2)])
def test_errors_of_one_size_differ_by_chance_as_often_as_stated(parts: int, groups: int) -> None:
    """Errors from so many parts and, independent of them, from so few groups."""
    rng = np.random.default_rng(2)
    by_part, by_group = (np.sqrt(rng.chisquare(count - 1, 40_000) / (count - 1)) for count in (parts, groups))
    widened = shared_errors(by_part, parts, by_group, groups) > 1.01 * np.maximum(by_part, by_group)
    assert widened.mean() == pytest.approx(tails.BEYOND_CHANCE, rel=0.1)


def test_shared_errors_are_those_of_the_groups() -> None:
    """Ten parts with one error among them count as one."""
    found = shared_errors(np.array([1.0]), 60, np.array([3.0]), 6)
    assert found == pytest.approx(3.0 * student_factor(5))
