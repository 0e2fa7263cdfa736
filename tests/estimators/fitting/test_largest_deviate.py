"""The largest of many values is held against the distribution of the others."""

import numpy as np
import pytest

from fedora_qa.estimators.fitting.largest_deviate import FEWEST, chance_of_largest


@pytest.mark.parametrize("width", [1e-3, 1.0, 40.0])
@pytest.mark.parametrize("noisy", [24, 50], ids=["half", "all"])
def test_noise_is_taken_for_noise(width: float, noisy: int) -> None:
    """Of two hundred sets of vectors, all of fifty or half of them normal, few have a largest one that is rare."""
    rng = np.random.default_rng(3)
    share = (np.arange(50) < noisy)[:, np.newaxis]
    chances = [chance_of_largest(share * rng.normal(0, width, (50, 2)), np.full((50, 2), 1e-6)) for _ in range(200)]
    assert np.median(chances) > 0.3
    assert np.mean(np.array(chances) < 0.001) <= 0.03


def test_one_value_that_is_far_off_is_no_noise() -> None:
    """Fifteen widths are beyond any chance, wherever most values lie."""
    values = np.random.default_rng(3).normal(5.0, 0.1, (50, 2))
    values[17, 1] += 1.5
    assert chance_of_largest(values, np.full((50, 2), 0.01)) < 1e-4


def test_errors_widen_what_is_expected() -> None:
    """Values that agree better than their errors say are not rare for a small deviation."""
    values = np.zeros((30, 2))
    values[4, 0] = 0.1
    assert chance_of_largest(values, np.full((30, 2), 0.1)) == 1.0
    assert chance_of_largest(values, np.full((30, 2), 0.001)) < 1e-4


def test_few_values_tell_nothing() -> None:
    """Below eight, and where values are not finite, nothing is said."""
    values = np.zeros((20, 2))
    values[0] = 9.0
    values[FEWEST - 1 :] = np.nan
    assert chance_of_largest(values, np.ones((20, 2))) == 1.0
