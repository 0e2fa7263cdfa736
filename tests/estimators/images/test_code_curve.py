"""Codes that a power law leaves out state its exponent; those of a sensor, a gain or few shades state none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.images.gain import exponent_after_rounding


def values(seed: int = 0, mean: float = 90.0, count: int = 200_000) -> np.ndarray:
    """Radiance of a scene of many shades, in DN, not rounded."""
    return np.clip(np.random.default_rng(seed).gamma(3.0, mean / 3.0, count), 0, 255)


def histogram(codes: np.ndarray) -> np.ndarray:
    return np.bincount(np.clip(np.rint(codes), 0, 255).astype(np.int64), minlength=256)


def curved(codes: np.ndarray, exponent: float) -> np.ndarray:
    return 255 * (codes / 255) ** exponent


@pytest.mark.parametrize(
    ("exponent", "mean"),
    [(0.3, 40.0), (1 / 2.2, 40.0), (0.83, 40.0), (0.45, 110.0), (0.7, 110.0), (1.3, 110.0), (2.2, 110.0)],
)
def test_the_exponent_of_rounded_codes_is_measured(exponent: float, mean: float) -> None:
    """Dark and bright scenes, curves that lift the dark and that press it."""
    codes = curved(np.rint(values(mean=mean)), exponent)
    assert exponent_after_rounding(histogram(codes)) == pytest.approx(exponent, rel=2e-3)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.3, 3.0), st.integers(0, 2**32 - 1))
def test_a_curve_before_rounding_leaves_nothing_out(exponent: float, seed: int) -> None:
    """A display's codes of a sensor's own radiance."""
    assert exponent_after_rounding(histogram(curved(values(seed), exponent))) is None


@pytest.mark.parametrize("gain", [1.03, 1.25, 1.6])
def test_a_gain_is_no_curve(gain: float) -> None:
    """It leaves codes out at equal distances."""
    assert exponent_after_rounding(histogram(gain * np.rint(values()))) is None


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 200), st.integers(0, 2**32 - 1))
def test_few_shades_are_no_curve(shades: int, seed: int) -> None:
    """A scene of few flat colours, in whatever codes."""
    random = np.random.default_rng(seed)
    counts = np.zeros(256, np.int64)
    np.add.at(counts, random.integers(0, 256, shades), random.integers(1, 10_000, shades))
    assert exponent_after_rounding(counts) is None


def test_an_empty_histogram_states_nothing() -> None:
    """Without values there is no curve."""
    assert exponent_after_rounding(np.zeros(256, np.int64)) is None
