"""Samples of a clock that was set back are told apart after they were sorted, and those of other clocks are not."""

import numpy as np
import pytest

from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.clocks.merged_clock import merged_clock

PERIOD_US = 5000


def sorted_us(back_us: int, row: int = 60, count: int = 200) -> np.ndarray:
    times_us = PERIOD_US * np.arange(count)
    times_us[row:] -= back_us
    return np.sort(times_us)


@pytest.mark.parametrize("back_us", [7500, 12668, 49000])
def test_samples_before_and_behind_the_step_are_told_apart(back_us: int) -> None:
    merged = merged_clock(NS_PER_US * sorted_us(back_us), resolution_ns=NS_PER_US)
    assert merged is not None
    assert merged.offset_ns == -NS_PER_US * back_us
    assert len(merged.before) == 60
    times_us = sorted_us(back_us)
    assert np.array_equal(times_us[merged.before], PERIOD_US * np.arange(60))
    assert np.array_equal(times_us[merged.behind], PERIOD_US * np.arange(60, 200) - back_us)


@pytest.mark.parametrize(
    "times_us",
    [
        PERIOD_US * np.arange(200),
        # Less than a period: no samples take turns.
        sorted_us(900),
        # Whole periods: no timestamp shows which sample has it.
        sorted_us(10_000),
        # Set forwards, a gap, and timestamps that scatter.
        sorted_us(-12_668),
        np.delete(PERIOD_US * np.arange(200), [50, 51, 90]),
        np.sort(PERIOD_US * np.arange(200) + np.random.default_rng(1).integers(-900, 900, 200)),
    ],
    ids=["regular", "part of a period", "whole periods", "forwards", "gaps", "scattered"],
)
def test_other_clocks_were_not_set_back(times_us: np.ndarray) -> None:
    assert merged_clock(NS_PER_US * times_us, resolution_ns=NS_PER_US) is None
