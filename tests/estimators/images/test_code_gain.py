"""Gains after rounding are told from the codes that they leave out, and from nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.images.code_gain import gain_after_rounding


def values(seed: int = 0, count: int = 200_000) -> np.ndarray:
    """Radiance of a scene of many shades, in DN, not rounded."""
    rng = np.random.default_rng(seed)
    return np.clip(rng.normal(110, 45, count), 0, 255)


def histogram(codes: np.ndarray) -> np.ndarray:
    return np.bincount(np.clip(np.rint(codes), 0, 255).astype(np.int64), minlength=256)


@pytest.mark.parametrize("percent", [3.0, -3.0, 9.0, 25.0, -12.0, 2.345, -4.321])
def test_a_gain_after_rounding_is_measured(percent: float) -> None:
    """Values that were rounded, multiplied and rounded again betray the gain to a part of a percent."""
    found = gain_after_rounding(histogram(np.rint(values()) * (1 + percent / 100)))
    assert found is not None
    assert found.gain == pytest.approx(1 + percent / 100, abs=found.half_range + 1e-9)
    assert found.half_range < 0.005


@settings(max_examples=30)
@given(st.floats(0.3, 3.0), st.integers(0, 2**32 - 1))
def test_a_gain_before_rounding_betrays_nothing(gain: float, seed: int) -> None:
    """Exposure of the sensor, before values are rounded, leaves no code out."""
    assert gain_after_rounding(histogram(gain * values(seed))) is None


@settings(max_examples=30)
@given(st.integers(2, 200), st.integers(0, 2**32 - 1))
def test_few_shades_betray_nothing(shades: int, seed: int) -> None:
    """A scene of few flat colours, in whatever codes, is not taken for a gain."""
    rng = np.random.default_rng(seed)
    counts = np.zeros(256, np.int64)
    np.add.at(counts, rng.integers(0, 256, shades), rng.integers(1, 10_000, shades))
    assert gain_after_rounding(counts) is None


def test_a_curve_is_no_gain() -> None:
    """Codes of a display made from rounded linear values leave codes out, but not those of a gain."""
    codes = 255 * (np.rint(values()) / 255) ** (1 / 2.2)
    assert gain_after_rounding(histogram(codes)) is None


def test_an_empty_histogram_betrays_nothing() -> None:
    """Without values there is no gain."""
    assert gain_after_rounding(np.zeros(256, np.int64)) is None
