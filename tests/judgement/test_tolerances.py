"""Limits follow from the false-alarm rate, and the stated least detectable fault is true."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest, norm

from fedora_qa.judgement.tolerances import tolerance_for


@given(st.integers(1, 10**7), st.floats(1e-8, 0.1))
def test_all_comparisons_share_one_rate(comparisons: int, rate: float) -> None:
    """The two-sided tails of all comparisons add up to the file's rate."""
    z = tolerance_for(comparisons, rate).z_limit
    assert 2 * norm.sf(z) * comparisons == pytest.approx(rate, rel=1e-6)


def test_false_alarms_of_honest_files_keep_the_rate() -> None:
    """Files of 20 honest Gaussian values alarm at the stated rate, within its binomial interval."""
    files, rate = 20_000, 0.02
    limit = tolerance_for(20, rate).limit(standard_error=1.0, allowance=0.0)
    values = np.random.default_rng(1).standard_normal((files, 20))
    alarms = int(np.sum(np.any(np.abs(values) > limit, axis=1)))
    assert binomtest(alarms, files, rate).pvalue > 1e-3


def test_least_detectable_is_seen_with_the_stated_power() -> None:
    """A fault of the stated size is seen in 95% of files."""
    tolerance = tolerance_for(100, 1e-4)
    least = tolerance.least_detectable(standard_error=0.3, allowance=0.0, resolution=0.0)
    values = least + 0.3 * np.random.default_rng(2).standard_normal(20_000)
    seen = int(np.sum(values > tolerance.limit(0.3, 0.0)))
    assert binomtest(seen, 20_000, 0.95).pvalue > 1e-3


@pytest.mark.parametrize("rate", [0.0, 1.0, -1.0, float("nan")])
def test_a_rate_that_is_none_is_refused(rate: float) -> None:
    """No silent nonsense."""
    with pytest.raises(ValueError, match="between 0 and 1"):
        tolerance_for(1, rate)
