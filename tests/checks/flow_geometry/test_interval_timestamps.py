"""Stamps that left their frames: by a constant, by a drift, or onto a grid; each way is recovered with its size."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks.flow_geometry.interval_timestamps import timestamp_patterns, timestamp_statistics
from fedora_qa.sequence.facts import clock_of
from tests.support.facts import FLOW_PERIODS_NS, exact_facts, with_clock

MS = 1_000_000
FRAMES_NS = np.arange(0, 1_001 * MS, 20 * MS)


def rounded_to_us(instants_ns: np.ndarray) -> np.ndarray:
    return np.rint(np.asarray(instants_ns) / 1000).astype(np.int64) * 1000


@given(offset_us=st.integers(5, 9_000), sign=st.sampled_from([-1, 1]))
def test_constant_offset_is_recovered(offset_us: int, sign: int) -> None:
    """An offset of less than half a frame step, of either sign, is named with its size, exactly."""
    best = timestamp_patterns(FRAMES_NS + 1000 * sign * offset_us, FRAMES_NS)[0]
    assert best.pattern == "constant"
    assert best.magnitude == pytest.approx(sign * offset_us / 1000)
    assert best.removed_share == 1.0


@given(ppm=st.floats(50.0, 5_000.0), sign=st.sampled_from([-1, 1]))
def test_drift_is_recovered(ppm: float, sign: int) -> None:
    """A rate is named with its size, to what rounding to microseconds leaves of a second."""
    best = timestamp_patterns(rounded_to_us(FRAMES_NS * (1 + sign * ppm * 1e-6)), FRAMES_NS)[0]
    assert best.pattern == "drift"
    assert best.magnitude == pytest.approx(sign * ppm, abs=51.0)


@pytest.mark.parametrize("grid_ms", [3, 7, 9, 11, 13])
def test_grid_is_recovered(grid_ms: int) -> None:
    """Stamps rounded to a grid that frames do not lie on are named with the grid."""
    grid_ns = grid_ms * MS
    instants_ns = (FRAMES_NS + grid_ns // 2) // grid_ns * grid_ns
    best = timestamp_patterns(instants_ns, FRAMES_NS)[0]
    assert (best.pattern, best.magnitude) == ("grid", grid_ms)


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_timestamps_that_keep_the_steps_of_frames_were_not_rounded(frames: int) -> None:
    """A part of the stamps that is a microsecond late is late, and on no grid of one frame step or of several."""
    patterns = timestamp_patterns(FRAMES_NS[10:40:frames] + 1000, FRAMES_NS)
    assert (patterns[0].pattern, patterns[0].magnitude) == ("constant", 0.001)
    assert "grid" not in {pattern.pattern for pattern in patterns}


def test_stray_timestamps_follow_no_pattern() -> None:
    """Stamps that scatter over a frame step are explained by nothing."""
    stray_ns = FRAMES_NS + np.random.default_rng(3).integers(-9 * MS, 9 * MS, len(FRAMES_NS))
    assert timestamp_patterns(stray_ns, FRAMES_NS)[0].removed_share < 0.5


def test_a_single_timestamp_is_an_offset() -> None:
    """One stamp beside one frame is late, and neither a drift nor a grid."""
    best = timestamp_patterns(np.array([3 * MS]), np.array([0]))[0]
    assert (best.pattern, best.magnitude) == ("constant", pytest.approx(3.0))


def test_another_unit_is_no_offset() -> None:
    """Stamps in nanoseconds, read as microseconds, lie beyond all frames and step a thousand times as far."""
    assert [(p.pattern, p.magnitude) for p in timestamp_patterns(1000 * FRAMES_NS, FRAMES_NS)] == [("unit", 1000.0)]
    assert timestamp_patterns(FRAMES_NS + 5_000 * MS, FRAMES_NS) == ()


@pytest.mark.parametrize(("stream", "row"), [("depth", 50), ("depth", 100), ("flow/50hz", 3), ("flow/10hz", 0)])
@pytest.mark.parametrize("side", ["start", "end"])
def test_a_timestamp_without_a_place_is_no_wrong_interval(stream: str, row: int, side: str) -> None:
    """What ``integrity.finite`` counts is no second finding: neither of its interval nor of those that end on it."""
    facts = exact_facts()
    held = facts.clocks[stream]
    starts_ns, ends_ns = held.times_ns.copy(), None if held.ends_ns is None else held.ends_ns.copy()
    (starts_ns if side == "start" or ends_ns is None else ends_ns)[row] = 10**18
    facts = with_clock(facts, stream, clock_of(starts_ns, ends_ns))
    facts = replace(facts, streams=facts.streams | set(FLOW_PERIODS_NS))
    statistics = timestamp_statistics(facts)
    assert len(statistics) == 9
    assert not [statistic.name for statistic in statistics if statistic.value]
