"""Limits follow from the false-alarm rate, and the stated least detectable fault is true."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest, norm

from fedora_qa.judgement.judge import tolerance_for
from fedora_qa.judgement.verdict import DEFAULT_FALSE_ALARM_RATE


@given(st.integers(1, 10**7), st.floats(1e-8, 0.1))
def test_all_comparisons_share_one_rate(comparisons: int, rate: float) -> None:
    """The two-sided tails of all comparisons add up to the file's rate."""
    z = tolerance_for(comparisons, rate).z_limit
    assert 2 * norm.sf(z) * comparisons == pytest.approx(rate, rel=1e-6)


def test_by_default_one_honest_file_in_ten_thousand_alarms() -> None:
    """A single two-sided comparison is allowed 3.89 standard errors."""
    z = tolerance_for(1, DEFAULT_FALSE_ALARM_RATE).z_limit
    assert z == pytest.approx(3.8906, abs=1e-4)
    assert 2 * norm.sf(z) == pytest.approx(1e-4, rel=1e-6)


def test_false_alarms_of_honest_files_keep_the_rate() -> None:
    """Files of 20 honest Gaussian values alarm at the stated rate, within its binomial interval."""
    files, rate = 20_000, 0.02
    limit = tolerance_for(20, rate).limit(standard_error=1.0, model_error_bound=0.0)
    values = np.random.default_rng(1).standard_normal((files, 20))
    alarms = int(np.sum(np.any(np.abs(values) > limit, axis=1)))
    assert binomtest(alarms, files, rate).pvalue > 1e-3


MODEL_ERROR_BOUNDS = [0.0, 0.1, 1.0, 30.0]


@pytest.mark.parametrize("model_error_bound", MODEL_ERROR_BOUNDS)
@pytest.mark.parametrize("model_error", [-1.0, 0.0, 1.0], ids=["hides", "absent", "feigns"])
def test_least_detectable_is_seen_with_the_stated_power(model_error_bound: float, model_error: float) -> None:
    """A fault of the stated size is seen in 95% of files or more, whichever way the model errs, in either direction."""
    tolerance, files = tolerance_for(100, 1e-4), 20_000
    least = tolerance.least_detectable(standard_error=0.3, model_error_bound=model_error_bound, resolution=0.0)
    values = least + model_error * model_error_bound + 0.3 * np.random.default_rng(2).standard_normal(files)
    seen = int(np.sum(values > tolerance.limit(0.3, model_error_bound)))
    assert seen / files >= 0.95 or binomtest(seen, files, 0.95).pvalue > 1e-3
    if model_error < 0 or not model_error_bound:
        assert binomtest(seen, files, 0.95).pvalue > 1e-3  # no less would do


@given(st.integers(1, 10**6), st.floats(1e-3, 10), st.floats(0, 10))
def test_honest_values_rarely_exceed(comparisons: int, standard_error: float, model_error_bound: float) -> None:
    """Whatever the model error within its bound, an honest value exceeds with its share of the rate at most."""
    tolerance = tolerance_for(comparisons, 1e-4)
    margin = tolerance.limit(standard_error, model_error_bound) - model_error_bound
    exceeds = 2 * norm.sf(margin / standard_error)
    assert exceeds <= 1e-4 / comparisons * (1 + 1e-6)


@given(st.integers(0, 5), st.integers(1, 50))
def test_a_count_is_seen_from_the_first_beyond_its_bound(model_error_bound: int, lost: int) -> None:
    """Where up to ``allowance`` may be lost without fault, twice that and one more is seen, even if none was."""
    tolerance = tolerance_for(1, 1e-4)
    least = tolerance.least_detectable(standard_error=0.0, model_error_bound=model_error_bound, resolution=1.0)
    seen = lost - model_error_bound > tolerance.limit(0.0, model_error_bound)
    assert seen == (lost >= least)


@pytest.mark.parametrize("rate", [0.0, 1.0, -1.0, float("nan")])
def test_a_rate_that_is_none_is_refused(rate: float) -> None:
    """No silent nonsense."""
    with pytest.raises(ValueError, match="between 0 and 1"):
        tolerance_for(1, rate)
