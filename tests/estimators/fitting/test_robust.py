"""Robust scale and the jackknife against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from fedora_qa.estimators.fitting.robust import (
    DETECTION_SIGMAS,
    MAD_TO_SIGMA,
    NORMAL_QUARTILE,
    jackknife_errors,
    robust_sigma,
    sensitivity_range,
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


SIZES = st.floats(0.0, 1e3)


@given(st.lists(st.tuples(SIZES, SIZES), min_size=1))
def test_no_place_lies_outside_the_range(pairs: list[tuple[float, float]]) -> None:
    """Both ends are places that were compared, and every limit lies between theirs."""
    errors, bounds = np.array(pairs).T
    found = sensitivity_range(errors, bounds)
    assert found is not None
    limits = [2 * bound + DETECTION_SIGMAS * error for error, bound in pairs]
    ends = [2 * bound + DETECTION_SIGMAS * error for error, bound in found]
    assert ends == [min(limits), max(limits)]
    assert set(found) <= set(pairs)


def test_places_that_measured_nothing_are_left_out() -> None:
    """Errors that are not finite state no limit; without any place there is no range."""
    assert sensitivity_range([np.nan, 2.0, np.inf], 0.5) == ((2.0, 0.5), (2.0, 0.5))
    assert sensitivity_range([np.nan], 0.0) is None
    assert sensitivity_range([[1.0, 3.0]], [[0.1], [0.2]]) == ((1.0, 0.1), (3.0, 0.2))
