"""Counts of values that no correct file holds."""

import numpy as np
import pytest

from fedora_qa.estimators.images.value_tallies import add_up, tally_depth, tally_flow, tally_samples


def test_samples_that_are_not_finite_are_counted_by_row() -> None:
    samples = np.zeros((5, 3))
    samples[2, 1], samples[2, 2], samples[4, 0] = np.nan, np.inf, -np.inf
    counts = tally_samples("path/imu/w", 10, samples)
    assert (counts.values, counts.nan, counts.first) == (5, 2, (12, 0))


def test_flow_counts_invalid_infinite_and_too_long_vectors() -> None:
    flow_px = np.zeros((4, 5, 2), np.float32)
    flow_px[0, 0], flow_px[1, 2, 0], flow_px[3, 4, 1] = np.nan, np.inf, 90.0
    counts = tally_flow("path/flow/10hz", 7, flow_px, longest_px=50.0)
    assert (counts.values, counts.nan, counts.infinite, counts.outside) == (20, 1, 1, 1)
    assert counts.first == (7, 1 * 5 + 2)
    assert counts.filled == ((7, pytest.approx(0.95)),)


def test_depth_outside_of_its_range_may_be_in_another_unit() -> None:
    depth_mm = np.full((3, 4), 2_000.0, np.float32)
    depth_mm[0, 1], depth_mm[2, 2], depth_mm[1, 1] = 2.0, -5.0, np.nan
    counts = tally_depth("path/depth", 0, depth_mm, (0.5, 40.0))
    assert (counts.nan, counts.outside, counts.rescaled) == (1, 2, 1)
    assert (counts.low, counts.high, counts.first) == (-5.0, 2.0, (0, 1))


def test_tallies_of_a_dataset_add_up_and_keep_the_first_place() -> None:
    clean, bad = np.zeros((2, 3)), np.full((2, 3), np.nan)
    (total,) = add_up([tally_samples("k", 0, clean), tally_samples("k", 2, bad), tally_samples("k", 4, bad)])
    assert (total.values, total.nan, total.first) == (6, 4, (2, 0))
