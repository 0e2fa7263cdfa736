"""Tails of distributions are those of scipy.stats, far out as well."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from fedora_qa.estimators.fitting import tails

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


def test_no_hits_are_certain_and_no_trial_has_none() -> None:
    assert tails.log_chance_of_hits([0, 0], [0, 10], 0.0).tolist() == [0.0, 0.0]
