"""Errors that few groups tell are widened as Student's distribution says, and only where groups share errors."""

import numpy as np
import pytest
from scipy.stats import norm, t

from fedora_qa.estimators.fitting.tails import TAIL, shared_errors, student_factor


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


def test_shared_errors_are_those_of_the_groups() -> None:
    """Ten parts with one error among them count as one."""
    found = shared_errors(np.array([1.0]), 60, np.array([3.0]), 6)
    assert found == pytest.approx(3.0 * student_factor(5))
