"""Huber's regression discounts outliers, and its two implementations agree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.fitting import huber_regression
from fedora_qa.estimators.fitting.huber_regression import huber_regression_weights, solve


def test_huber_weights_discount_outliers() -> None:
    """A fifth of gross outliers moves the weighted fit by less than a tenth of what it moves a plain one."""
    rng = np.random.default_rng(0)
    X = rng.normal(0, 1, (1000, 1))
    y = X[:, 0] + rng.normal(0, 0.01, 1000)
    y[:200] += 5.0 * np.sign(X[:200, 0])
    weights = huber_regression_weights(X, y)
    plain = float(X[:, 0] @ y / (X[:, 0] @ X[:, 0])) - 1
    robust = float((weights * X[:, 0]) @ y / ((weights * X[:, 0]) @ X[:, 0])) - 1
    assert abs(robust) < abs(plain) / 10


@given(st.integers(0, 2**32 - 1), st.integers(4, 60), st.booleans())
@settings(deadline=None)
def test_few_rows_weigh_as_many_do(seed: int, rows: int, doubled: bool) -> None:
    """The compiled loop gives what NumPy's partition does to the last bit; singular equations are left to LAPACK."""
    rng = np.random.default_rng(seed)
    X, y = rng.normal(0, 1, (rows, 3)), rng.standard_t(2, rows)
    X[:, 2] = X[:, 1] if doubled else X[:, 2]
    few = huber_regression_weights(X, y)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(huber_regression, "_FEW_ROWS", 0)
        assert np.array_equal(few, huber_regression_weights(X, y))
    assert np.all((few > 0) & (few <= 1))


@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
@settings(deadline=None)
def test_small_equations_are_solved_as_by_lapack(seed: int, k: int) -> None:
    """Of columns of any size; equations with one column twice, or nothing in one, are refused."""
    rng = np.random.default_rng(seed)
    X, theta = rng.normal(size=(30, k)) * 10.0 ** rng.integers(-3, 4, k), np.empty(k)
    vector = X.T @ rng.normal(size=30)
    assert solve(X.T @ X, vector, theta)
    scale = np.sqrt(np.diag(X.T @ X))
    np.testing.assert_allclose(theta * scale, np.linalg.solve(X.T @ X, vector) * scale, rtol=1e-8, atol=1e-8)
    for other in (X[:, :1], np.zeros((30, 1))):
        twice = np.hstack([X, other])
        assert not solve(twice.T @ twice, twice.T @ X[:, 0], np.empty(k + 1))
