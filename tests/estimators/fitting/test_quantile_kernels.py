"""Order statistics in compiled loops, against numpy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fedora_qa.estimators.fitting.quantile_kernels import median_of, percentile_of

NUMBERS = arrays(np.float64, st.integers(1, 60), elements=st.floats(-1e6, 1e6))
FEW_VALUES = arrays(np.float64, st.integers(1, 60), elements=st.sampled_from([-1.0, 0.0, 0.5, 2.0]))


@settings(deadline=None)
@given(NUMBERS | FEW_VALUES)
def test_the_median_is_that_of_numpy_and_values_stay_as_they_are(values: np.ndarray) -> None:
    before = values.copy()
    assert median_of(values) == pytest.approx(float(np.median(values)), rel=1e-12, abs=1e-9)
    np.testing.assert_array_equal(values, before)


@settings(deadline=None)
@given(NUMBERS | FEW_VALUES, st.floats(0.0, 100.0))
def test_percentiles_are_those_of_numpy(values: np.ndarray, percent: float) -> None:
    expected = float(np.percentile(values, percent))
    assert percentile_of(values, percent) == pytest.approx(expected, rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("values", [[], [np.nan], [1.0, np.nan, 2.0], [np.nan, np.inf]])
def test_nothing_and_nan_have_none(values: list[float]) -> None:
    assert np.isnan(median_of(np.array(values, np.float64)))


def test_infinities_are_ordered() -> None:
    assert median_of(np.array([np.inf, 1.0, np.inf])) == np.inf
    assert median_of(np.array([np.inf, np.inf])) == np.inf
    assert percentile_of(np.array([-np.inf, 0.0, 1.0]), 75.0) == 0.5


@pytest.mark.parametrize("order", ["rising", "falling", "organ pipe", "equal"])
def test_no_order_of_many_values_is_slow(order: str) -> None:
    rising = np.arange(100_001.0)
    values = {
        "rising": rising,
        "falling": rising[::-1].copy(),
        "organ pipe": np.minimum(rising, rising[::-1]) * 2,
        "equal": np.full(100_001, 50_000.0),
    }[order]
    assert median_of(values) == np.median(values)
