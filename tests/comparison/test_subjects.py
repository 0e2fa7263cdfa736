"""Distances of histograms against those of the samples that they were made of."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import wasserstein_distance

from fedora_qa.comparison.subjects import mean_of, sampled_counts_of, shares_of, wasserstein
from fedora_qa.evidence.value_counts import count_values, octave_counts, octave_edges

EDGES = octave_edges()
samples = st.lists(st.floats(0.0078125, 1024.0, width=32), min_size=1, max_size=40).map(np.array)


def shares(values: np.ndarray) -> np.ndarray:
    return shares_of(octave_counts(count_values(values)))


@settings(deadline=None)
@given(samples, samples)
def test_distance_is_that_of_the_samples(one: np.ndarray, other: np.ndarray) -> None:
    """It is within the width of the bins of what scipy finds of the samples themselves."""
    found = wasserstein(shares(one), shares(other), EDGES)
    moved_by_binning = (shares(one) + shares(other)) @ np.diff(EDGES)
    assert abs(found - wasserstein_distance(one, other)) <= moved_by_binning


@settings(deadline=None)
@given(st.lists(st.integers(0, 9), min_size=6, max_size=6), st.lists(st.integers(0, 9), min_size=6, max_size=6))
def test_evenly_spread_values_exactly(one: list[int], other: list[int]) -> None:
    """Of values spread evenly within bins it is the integral between the distribution functions, crossings included."""
    if not sum(one) or not sum(other):
        return
    edges = np.array([0.0, 1.0, 2.0, 4.0, 7.0, 8.0, 16.0])
    dense = np.linspace(0, 16, 160_001)
    functions = [np.interp(dense, edges, np.cumsum([0.0, *shares_of(np.array(counts))])) for counts in (one, other)]
    expected = np.trapezoid(np.abs(functions[0] - functions[1]), dense)
    found = wasserstein(shares_of(np.array(one)), shares_of(np.array(other)), edges)
    assert found == pytest.approx(expected, abs=1e-6)


def test_a_shift_is_its_own_distance() -> None:
    """Values that all move by 3 lie 3 apart, and their mean moves by 3."""
    edges = np.arange(11.0)
    before, after = np.zeros(10), np.zeros(10)
    before[[1, 2, 5]], after[[4, 5, 8]] = (0.2, 0.3, 0.5), (0.2, 0.3, 0.5)
    assert wasserstein(before, after, edges) == pytest.approx(3.0)
    assert mean_of(after, edges) - mean_of(before, edges) == pytest.approx(3.0)


@settings(deadline=None)
@given(samples)
def test_wide_bins_hold_what_lies_in_them(values: np.ndarray) -> None:
    """Each bin counts the values between its edges, as numpy counts them."""
    assert np.array_equal(octave_counts(count_values(values)), np.histogram(values.astype(np.float32), EDGES)[0])


def test_flow_is_in_the_order_of_its_rates() -> None:
    """A rate with a fraction has its place between whole ones; flow comes before what is no flow."""
    arrays = {"distributions/blocks_ns": np.array([[0, 8]])}
    for name in ("depth_m", "flow_100hz", "flow_12.5hz", "flow_10hz", "flow_25hz"):
        arrays |= {f"distributions/{name}/counts": np.ones((1, len(EDGES) - 1), np.int64)}
        arrays |= {f"distributions/{name}/edges": EDGES}
    counted = sampled_counts_of(arrays)
    assert counted is not None
    assert list(counted.counts) == ["flow_10hz", "flow_12.5hz", "flow_25hz", "flow_100hz", "depth_m"]
