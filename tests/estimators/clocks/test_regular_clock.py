"""The fit of a regular clock against clocks that are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.estimators.clocks.regular_clock import fit_regular_clock


@given(st.integers(3, 400), st.integers(1, 10**9), st.integers(-(10**15), 10**15))
def test_exact_clock(count: int, period_ns: int, start_ns: int) -> None:
    """An exact clock is recovered whatever its origin, and nothing is missing."""
    fit = fit_regular_clock(start_ns + period_ns * np.arange(count))
    assert fit is not None
    assert fit.period_ns == pytest.approx(period_ns, rel=1e-12)
    assert (fit.missing, fit.tick_ns) == (0, period_ns)


@given(st.lists(st.integers(1, 38), min_size=1, max_size=6, unique=True), st.floats(0.5, 3000.0))
def test_missing_samples_are_counted(lost: list[int], rate_hz: float) -> None:
    """Inner samples taken out of a rounded clock are counted, and do not move its period."""
    whole = np.rint(1e6 * np.arange(40) / rate_hz).astype(np.int64) * 1000
    fit = fit_regular_clock(np.delete(whole, lost))
    assert fit is not None
    assert fit.missing == len(lost)
    assert fit.period_ns == pytest.approx(1e9 / rate_hz, abs=1000)


def test_period_error_is_honest() -> None:
    """Over many jittered clocks the period's error has the stated size."""
    rng = np.random.default_rng(3)
    scores = []
    for _ in range(400):
        timestamps = np.rint(1e6 * np.arange(200) + rng.normal(0, 5e4, 200)).astype(np.int64)
        fit = fit_regular_clock(timestamps)
        assert fit is not None
        scores.append((fit.period_ns - 1e6) / fit.period_error_ns)
    assert np.std(scores) == pytest.approx(1.0, abs=0.15)


def test_too_few_timestamps_say_nothing() -> None:
    """Two stamps fit every clock."""
    assert fit_regular_clock(np.array([0, 5])) is None
