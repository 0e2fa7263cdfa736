"""The bound that defines an event sensor: the signal never leaves its thresholds, at any time, between samples too."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.events.comparator import Comparator, SignalNotFiniteError
from fedora_generator.events.keys import KeyLayout, decode
from tests.generator.event_sensor_cases import Floats, pixel, play, sensor_for

thresholds = st.floats(0.02, 0.6)
levels_and_gaps_us = st.lists(
    st.tuples(st.floats(-3, 3), st.one_of(st.integers(1, 50), st.integers(1_000, 10**6))), min_size=2, max_size=30
)


@given(levels_and_gaps_us, thresholds, thresholds)
@settings(max_examples=100, deadline=None)
def test_the_log_signal_never_leaves_its_thresholds(samples: list[tuple[float, int]], on: float, off: float) -> None:
    """At all times -C_off < L - ref < C_on, with ref counted from the events alone, and an event only at a threshold.

    L is a straight line between random samples at random times and ref is constant between events, so that L - ref is
    extreme at a sample or at an event. A stamp is up to 1 us late: L goes on for as long.
    """
    log_levels, gaps_us = np.array([level for level, _ in samples]), np.array([gap for _, gap in samples])
    times_us = np.cumsum(gaps_us)
    events = play(sensor_for(np.ones((1, 1)), threshold_on=on, threshold_off=off), times_us * 1_000, pixel(*log_levels))
    steps = np.where(events.p == 1, on, -off)
    references = log_levels[0] + np.concatenate([[0.0], np.cumsum(steps)])
    slack = 1e-9

    at_samples = log_levels - references[np.searchsorted(events.t_us, times_us, side="right")]
    assert np.all((at_samples < on + slack) & (at_samples > -off - slack))

    interval = np.searchsorted(times_us, events.t_us, side="left")
    late = np.abs(np.diff(log_levels) / np.diff(times_us))[interval - 1] * 1.002 + slack  # 1 us, and 1 ns of the clock
    reached = (np.interp(events.t_us, times_us, log_levels) - references[:-1]) * np.sign(steps)
    assert np.all(reached > np.abs(steps) - late)
    assert np.all(reached < np.abs(steps) + late)


@given(st.lists(st.floats(0, 255), min_size=2, max_size=60), st.integers(1, 60), st.integers(1, 60))
@settings(max_examples=100, deadline=None)
def test_the_linear_value_never_leaves_its_thresholds(luma_dn: list[float], on: int, off: int) -> None:
    """At every image -C_off <= value - ref <= C_on, with ref the value at the last event; an event only beyond it."""
    sensor = sensor_for(np.ones((1, 1)), model="linear", threshold_on=on, threshold_off=off)
    times_us = 1_000 * np.arange(len(luma_dn))
    events = play(sensor, times_us * 1_000, np.reshape(luma_dn, (-1, 1, 1)))
    values, polarity_at = np.rint(luma_dn), dict(zip(events.t_us.tolist(), events.p.tolist(), strict=True))
    assert len(polarity_at) == len(events)
    reference = values[0]
    for time_us, value in zip(times_us.tolist(), values.tolist(), strict=True):
        if time_us in polarity_at:
            assert (value - reference > on) if polarity_at[time_us] else (reference - value > off)
            reference = value
        assert -off <= value - reference <= on


def crossings(log_levels: Floats, threshold: float) -> list[tuple[int, int]]:
    """Stamps and polarities of one pixel whose signal is given directly, a sample a millisecond."""
    layout, row = KeyLayout(1, 1), np.full((1, 1), threshold)
    comparator = Comparator(layout, row, row, np.full((1, 1), log_levels[0]))
    events = []
    for step, (before, after) in enumerate(pairwise(log_levels.tolist())):
        signals = (np.full((1, 1), before), np.full((1, 1), after))
        batch = decode(comparator.crossings(*signals, step * 1_000_000, (step + 1) * 1_000_000), layout, 0)
        events += zip(batch.t_us.tolist(), batch.p.tolist(), strict=True)
    return events


@given(st.lists(st.integers(-40, 40), min_size=2, max_size=40), st.sampled_from([0.125, 0.25, 1.0]))
@settings(max_examples=100, deadline=None)
def test_fence_posts(multiples: list[int], threshold: float) -> None:
    """Samples at exact multiples of C, in numbers without rounding: every level reached fires once, at its time.

    From one multiple to the next fires as many events as there are levels between, the last at the sample itself.
    """
    expected = []
    for step, (before, after) in enumerate(pairwise(multiples)):
        count = abs(after - before)
        expected += [(1_000 * step - (-1_000 * k // count), int(after > before)) for k in range(1, count + 1)]
    assert crossings(threshold * np.array(multiples, dtype=np.float64), threshold) == expected


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
def test_a_signal_that_is_not_a_number_is_refused(broken: float) -> None:
    """Infinity would fire for ever and NaN never: both are an error, for both models."""
    row, signal = np.full((1, 3), 0.2), np.array([[0.0, broken, 0.0]])
    comparator = Comparator(KeyLayout(1, 3), row, row, np.zeros((1, 3)))
    with pytest.raises(SignalNotFiniteError):
        comparator.crossings(np.zeros((1, 3)), signal, 0, 1_000)
    with pytest.raises(SignalNotFiniteError):
        comparator.steps(signal, 1_000)
