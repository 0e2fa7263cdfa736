"""Intervals of shares hold the truth as often as they say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from fedora_qa.power.detection import chance_of, share_of, upper_bound


@given(st.integers(1, 400), st.data())
def test_interval_is_that_of_another_implementation(of: int, data: st.DataObject) -> None:
    """The interval is Clopper and Pearson's, as SciPy finds it by inverting the test."""
    count = data.draw(st.integers(0, of))
    theirs = binomtest(count, of).proportion_ci(0.95, method="exact")
    share = share_of(count, of)
    assert (share.low, share.high) == pytest.approx((theirs.low, theirs.high), abs=1e-9)


@pytest.mark.parametrize("truth", [0.01, 0.3, 0.9])
def test_interval_covers_the_truth(truth: float) -> None:
    """Summed over every possible count, the interval of 40 trials holds the truth with 95% probability or more."""
    shares = [share_of(count, 40) for count in range(41)]
    held = np.array([share.low <= truth <= share.high for share in shares])
    assert binom.pmf(np.arange(41), 40, truth)[held].sum() >= 0.95


def test_nothing_in_three_hundred() -> None:
    """No alarm in 300 clean files bounds the rate by 1 - 0.05^(1/300), the rule of three."""
    assert upper_bound(0, 300) == pytest.approx(1 - 0.05 ** (1 / 300))
    assert upper_bound(0, 300) == pytest.approx(3 / 300, rel=0.01)


def test_nothing_tried() -> None:
    """Of no files, nothing is known."""
    assert (share_of(0, 0).value, share_of(0, 0).low, share_of(0, 0).high) == (None, 0.0, 1.0)
    assert upper_bound(0, 0) == 1.0


def test_chance_of_as_many_or_more() -> None:
    """At a rate of 1e-4, one alarm in 300 files comes with 3%, none or more always."""
    assert chance_of(1, 300, 1e-4) == pytest.approx(1 - (1 - 1e-4) ** 300)
    assert chance_of(0, 300, 1e-4) == 1.0


@pytest.mark.parametrize(("count", "of"), [(-1, 3), (4, 3)])
def test_refuses_what_is_no_count(count: int, of: int) -> None:
    """More than all, or less than none, is an error."""
    with pytest.raises(ValueError, match="Expected a count between 0"):
        share_of(count, of)
