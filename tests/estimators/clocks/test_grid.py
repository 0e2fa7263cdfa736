"""Stamps that went through another number format are told from those that did not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.estimators.clocks.grid import single_precision_spacing_us


def in_single_precision(times_us: np.ndarray) -> np.ndarray:
    return np.rint((times_us / 1e6).astype(np.float32).astype(np.float64) * 1e6)


@given(st.integers(40_000_000, 10**12), st.integers(1_000, 50_000))
def test_single_precision_is_told(origin_us: int, period_us: int) -> None:
    """Any regular stream later than 40 s betrays float32 seconds, and their spacing is that of the latest stamp."""
    times_us = in_single_precision(origin_us + period_us * np.arange(50.0))
    expected_us = float(np.spacing(np.float32(times_us[-1] / 1e6))) * 1e6
    assert single_precision_spacing_us(times_us) == pytest.approx(expected_us)


@given(st.integers(40_000_000, 10**12), st.integers(0, 2**32 - 1))
def test_whole_microseconds_are_not_taken_for_it(origin_us: int, seed: int) -> None:
    """Stamps at random microseconds are not single-precision seconds."""
    times_us = origin_us + np.cumsum(np.random.default_rng(seed).integers(500, 1500, 50)).astype(float)
    assert single_precision_spacing_us(times_us) == 0.0


def test_early_timestamps_tell_nothing() -> None:
    """Below 16 s single precision is as fine as a microsecond."""
    assert single_precision_spacing_us(np.arange(0.0, 15e6, 1e5)) == 0.0
