"""How long a sequence resembles itself, and what is cut from that."""

import numpy as np
import pytest

from fedora_qa.comparison.stretches import correlation_time, independent_stretches
from tests.comparison.processes import autoregression, blocks_around


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.8])
def test_correlation_time_of_an_autoregression(memory: float) -> None:
    """It is (1 + a) / (1 - a) blocks for neighbours correlated by a, and somewhat more for its error."""
    random = np.random.default_rng(11)
    times = [correlation_time(blocks_around(3 * autoregression(512, memory, random), random)) for _ in range(8)]
    assert 0.8 < np.mean(times) * (1 - memory) / (1 + memory) < 2.0


def test_nothing_is_lost_between_stretches() -> None:
    """Stretches hold what the blocks held, at most 16 of them; blocks without values are no time at all."""
    counts = blocks_around(np.zeros(70), np.random.default_rng(12))
    counts[::7] = 0
    stretches = independent_stretches(counts)
    assert len(stretches) in range(8, 17)
    assert np.array_equal(stretches.sum(axis=0), counts.sum(axis=0))


def test_a_steady_drift_is_one_stretch() -> None:
    """What changes all along the sequence shows one sample of how it changes."""
    drift = np.linspace(-3.0, 3.0, 64)
    assert len(independent_stretches(blocks_around(drift, np.random.default_rng(13)))) == 1


def test_one_block_is_one_stretch() -> None:
    """A sequence of one block, or of blocks that are all the same, needs no correlation."""
    counts = np.ones((1, 64), np.int64)
    assert np.array_equal(independent_stretches(counts), counts)
    assert len(independent_stretches(np.ones((64, 64), np.int64))) == 16
