"""Robust scale and the jackknife against closed forms."""

import numpy as np
import pytest
from scipy.stats import norm

from fedora_qa.estimators.fitting.robust import (
    MAD_TO_SIGMA,
    NORMAL_QUARTILE,
    jackknife_errors,
    robust_sigma,
)


def test_the_constants_are_those_of_the_normal_distribution() -> None:
    """Half of all normal values deviate by less than the third quartile."""
    assert pytest.approx(1 / norm.ppf(0.75), abs=5e-6) == MAD_TO_SIGMA
    assert pytest.approx(norm.ppf(0.75), abs=5e-5) == NORMAL_QUARTILE


def test_the_robust_sigma_of_normal_values_is_theirs() -> None:
    """On quantiles of the normal distribution it is sigma, and one gross outlier does not move it."""
    quantiles = 3.0 * norm.ppf((np.arange(1001) + 0.5) / 1001)
    assert robust_sigma(quantiles) == pytest.approx(3.0, rel=4e-3)
    assert robust_sigma(np.append(quantiles, 1e9)) == pytest.approx(3.0, rel=4e-3)
    columns = np.stack([quantiles, 2 * quantiles + 7], axis=1)
    np.testing.assert_allclose(robust_sigma(columns), (3.0, 6.0), rtol=2e-3)
    assert robust_sigma(np.array([1.0, 2.0, 3.0]), 0.0) == 2.0 * MAD_TO_SIGMA


def test_the_jackknife_of_a_mean_is_its_standard_error() -> None:
    """For a mean the delete-one jackknife is exactly the sample's standard deviation over the root of n."""
    values = np.array([3.0, -1.0, 4.0, 1.0, 5.0, 9.0])
    left_out = (values.sum() - values) / (len(values) - 1)
    assert jackknife_errors(left_out) == pytest.approx(values.std(ddof=1) / np.sqrt(len(values)))
    pairs = np.stack([left_out, 2 * left_out], axis=1)
    assert jackknife_errors(pairs)[1] == pytest.approx(2 * jackknife_errors(left_out))
