"""Stamps of regular clocks, rounded to grids of all kinds, in whole microseconds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.clocks.rounded_timestamps import rounding_grid_ns

US = 1000


def timestamps_ns(period_us: float, count: int = 400) -> NDArray[np.int64]:
    return np.rint(period_us * np.arange(count)).astype(np.int64) * US


def rounded(times_ns: NDArray[np.int64], grid_us: int) -> NDArray[np.int64]:
    return (times_ns + grid_us * US // 2) // (grid_us * US) * (grid_us * US)


@given(st.integers(2, 4000), st.sampled_from([1000, 5000, 20000, 33333]))
def test_grid_is_found_or_does_no_harm(grid_us: int, period_us: int) -> None:
    """A found grid is the true one; none is missed whose rounding shows in a tenth of the steps or more."""
    found = rounding_grid_ns(rounded(timestamps_ns(period_us), grid_us), resolution_ns=US)
    assert found in (0, grid_us * US)
    odd = (period_us / grid_us) % 1.0
    if 0.1 < odd < 0.9:
        assert found == grid_us * US


@pytest.mark.parametrize("period_us", [1000.0, 5000.0, 33333.0, 1e6 / 30, 1e6 / 29.97])
def test_whole_microseconds_are_no_grid(period_us: float) -> None:
    """Stamps in the format's own unit are not rounded beyond it, whether the period is whole or not."""
    assert rounding_grid_ns(timestamps_ns(period_us), resolution_ns=US) == 0


def test_part_of_a_stream() -> None:
    """A clock that is rounded from the middle on shows there."""
    times_ns = timestamps_ns(5000.0)
    times_ns[200:] = rounded(times_ns[200:], 700)
    assert rounding_grid_ns(times_ns, resolution_ns=US) == 700 * US


@pytest.mark.parametrize("lost", [[100], [90, 91, 92], [70, 90, 101, 125]])
def test_lost_samples_are_no_grid(lost: list[int]) -> None:
    """Gaps are whole periods, yet lie off the line of a rounded clock."""
    assert rounding_grid_ns(np.delete(timestamps_ns(5000.0), lost), resolution_ns=US) == 0


def test_jitter_is_no_grid() -> None:
    """Steps of many lengths are noise, not rounding."""
    jitter_us = np.random.default_rng(0).integers(-300, 300, 400)
    assert rounding_grid_ns(timestamps_ns(5000.0) + jitter_us * US, resolution_ns=US) == 0


def test_too_few() -> None:
    """A short stream shows no grid."""
    assert rounding_grid_ns(timestamps_ns(5000.0, 10), resolution_ns=US) == 0
