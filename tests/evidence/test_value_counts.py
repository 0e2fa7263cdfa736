"""Histograms of unknown range: exact, whatever the order and however the values were dealt out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.evidence.value_counts import added, count_values, histogram, no_values

VALUES = st.lists(st.floats(0, 1e5, width=32), min_size=1, max_size=200)


@given(VALUES)
def test_bins_hold_what_numpy_counts(values: list[float]) -> None:
    """Within the range every count is that of ``numpy.histogram`` with the same edges: no value is moved."""
    array = np.array(values, np.float32)
    edges, counts, beyond = histogram(count_values(array))
    below = array[array < edges[-1]].astype(np.float64)
    np.testing.assert_array_equal(counts, np.histogram(below, edges)[0])
    assert int(counts.sum()) + beyond == len(values)
    assert beyond <= 1e-3 * len(values)


@given(VALUES, st.integers(0, 200))
def test_parts_add_up(values: list[float], cut: int) -> None:
    """Counting two parts and adding gives the same whole numbers as counting all."""
    array = np.array(values)
    np.testing.assert_array_equal(added([count_values(array[cut:]), count_values(array[:cut])]), count_values(array))


def test_bins_are_equal_and_as_narrow_as_can_be() -> None:
    """Depths up to 30 m get quarters of a metre, from 0 on."""
    edges, counts, beyond = histogram(count_values(np.linspace(0.1, 29.99, 4000)))
    np.testing.assert_array_equal(np.diff(edges), 0.25)
    assert edges[0] == 0
    assert 64 < len(counts) <= 128
    assert beyond == 0


def test_few_far_values_do_not_flatten_the_rest() -> None:
    """One pixel of 500000 px among ten thousand of a few px lies above the last bin, and is told."""
    edges, counts, beyond = histogram(count_values(np.append(np.linspace(0, 3, 10_000), 5e5)))
    assert beyond == 1
    assert edges[-1] <= 4
    assert int(counts.sum()) == 10_000


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_what_is_no_value_is_not_counted(value: float) -> None:
    """NaN, infinity and negative values are left out."""
    assert not count_values(np.array([value])).any()


def test_extremes_stay_countable() -> None:
    """Nothing at all, minus zero and the largest float each give a histogram."""
    assert histogram(no_values())[1].sum() == 0
    assert histogram(count_values(np.array([-0.0])))[1].tolist() == [1]
    edges, counts, beyond = histogram(count_values(np.array([3e38])))
    assert int(counts.sum()) + beyond == 1
    assert np.isfinite(edges).all()
