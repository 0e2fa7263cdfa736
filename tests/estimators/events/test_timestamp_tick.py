"""The tick of timestamps that many events share."""

import numpy as np
import pytest

from fedora_qa.estimators.events.timestamp_tick import crowded_step_ns


@pytest.mark.parametrize("tick_ns", [100_000, 333_000, 1_000_000])
def test_packets_have_the_distance_of_their_timestamps(tick_ns: int) -> None:
    """Twenty packets of ten events each lie on the tick, one event in twenty beside it."""
    packets = np.repeat(np.arange(20, dtype=np.int64) * tick_ns, 10)
    alone = np.arange(10, dtype=np.int64) * tick_ns + 7
    assert crowded_step_ns(np.sort(np.concatenate([packets, alone]))) == tick_ns


def test_events_with_timestamps_of_their_own_have_no_tick() -> None:
    """Timestamps that differ, and a single burst, are no tick."""
    times_ns = np.arange(500, dtype=np.int64) * 1_000
    assert crowded_step_ns(times_ns) == 0
    assert crowded_step_ns(np.sort(np.concatenate([times_ns, np.full(400, 77_000, np.int64)]))) == 0
    assert crowded_step_ns(np.empty(0, np.int64)) == 0
