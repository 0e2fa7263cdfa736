"""Exact clocks of which a part was moved, in whole microseconds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.clocks.displaced_timestamps import displaced_part

US = 1000
PERIOD_US = 5000


def timestamps_us(count: int = 400) -> NDArray[np.int64]:
    return PERIOD_US * np.arange(count, dtype=np.int64)


@given(st.integers(-2400, 2400).filter(lambda us: abs(us) > 3), st.integers(1, 180), st.integers(20, 180))
def test_a_late_part_is_found_with_its_rows_and_size(late_us: int, first: int, count: int) -> None:
    """Any offset of more than rounding and less than half a period, anywhere."""
    times_us = timestamps_us()
    times_us[first : first + count] += late_us
    found = displaced_part(times_us * US, resolution_ns=US)
    assert found is not None
    assert (found.first, found.last) == (first, first + count - 1)
    assert (found.offset_ns, found.drift) == (late_us * US, 0.0)


@pytest.mark.parametrize("rate", [60e-6, -120e-6])
def test_a_fast_part_is_found_with_its_rate(rate: float) -> None:
    """A clock that runs fast for a while and is set right again."""
    times_us = timestamps_us()
    times_us[100:300] += np.rint(PERIOD_US * rate * np.arange(200)).astype(np.int64)
    found = displaced_part(times_us * US, resolution_ns=US)
    assert found is not None
    assert found.drift == pytest.approx(rate, rel=0.03)
    assert found.last == 299


LOST = np.delete(timestamps_us(), [50, 51, 200])
JITTER = timestamps_us() + np.random.default_rng(0).integers(-40, 40, 400)
UNTOUCHED = {
    "exact": timestamps_us(),
    "late throughout": timestamps_us() + 7,
    "fast throughout": np.rint(timestamps_us() * 1.0002).astype(np.int64),
    "samples lost": LOST,
    "jitter": JITTER,
    "period of no whole microseconds": np.rint(np.arange(400) * 1e6 / 30).astype(np.int64),
    "two stamps": timestamps_us(2),
    "one stamp again and again": np.zeros(50, np.int64),
}


@pytest.mark.parametrize("times_us", UNTOUCHED.values(), ids=UNTOUCHED)
def test_what_was_not_moved_in_part_is_not_found(times_us: NDArray[np.int64]) -> None:
    """Clocks that are sound, or wrong as a whole, or lack samples."""
    assert displaced_part(times_us * US, resolution_ns=US) is None
