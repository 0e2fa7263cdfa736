"""Runs of events on a line: closed forms, and a slow loop."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.events.pixels import PixelEvents, by_pixel
from fedora_qa.estimators.events.time_jitter import chance_of_line, straight_runs

US = 1_000
INTERVAL_NS = 20_000 * US
INTERVALS = np.array([[0, INTERVAL_NS], [INTERVAL_NS, 2 * INTERVAL_NS]])


def events_of(times_ns: list[int], polarities: list[int]) -> PixelEvents:
    """Events of the second pixel of two, by time."""
    count = len(times_ns)
    x, y = np.ones(count, np.uint16), np.zeros(count, np.uint16)
    order = np.argsort(times_ns, kind="stable")
    return by_pixel(x, y, np.array(times_ns)[order], np.array(polarities, np.uint8)[order], (1, 2))


def crossings_us(slope_nat_s: float, start_nat: float, threshold: float) -> NDArray[np.int64]:
    """Timestamps in us up to 20 ms, rounded up, of a line that begins ``start_nat`` above its reference."""
    levels = threshold * np.arange(1, 2 + int((start_nat + 0.02 * slope_nat_s) / threshold))
    times_us = np.ceil((levels - start_nat) / slope_nat_s * 1e6).astype(np.int64)
    return times_us[times_us <= INTERVAL_NS // US]


@settings(deadline=None)
@given(st.floats(45.0, 2000.0), st.floats(-0.19, 0.19), st.integers(0, 1))
# The last crossing is at the end of the interval, and a rounding after it.
@example(230.0, 0.0, 0)
def test_a_signal_that_is_a_line_gives_a_straight_run(slope_nat_s: float, start_nat: float, polarity: int) -> None:
    """Wherever the reference lies between the two thresholds."""
    times_us = crossings_us(slope_nat_s, start_nat, 0.2)
    events = events_of([int(t) * US for t in times_us], [polarity] * len(times_us))
    assert straight_runs(events, [INTERVALS], US, 2.0).tolist() == [[1, 1, len(times_us)]]


@settings(deadline=None)
@given(st.floats(0.002, 0.5))
def test_a_curved_signal_does_not(curvature: float) -> None:
    """L = 1.5 (s + c s (1 - s)) over the interval, from s = 0 to 1, bends the line by c / 4 of its change."""
    shares = np.linspace(0, 1, 200_001)
    signal = 1.5 * (shares + curvature * shares * (1 - shares))
    times_us = np.ceil(20_000 * np.interp(0.2 * np.arange(1, 8), signal, shares)).astype(np.int64)
    events = events_of([int(t) * US for t in times_us], [1] * 7)
    assert straight_runs(events, [INTERVALS], US, 2.0).tolist() == [[1, 0, 7]]


@pytest.mark.parametrize(
    ("times_us", "polarities"),
    [
        pytest.param([5_000, 10_000, 15_000], [1, 0, 1], id="both polarities"),
        pytest.param([1_000, 2_000, 3_000], [1, 1, 1], id="an edge passes early"),
        pytest.param([17_000, 18_000, 19_000], [1, 1, 1], id="an edge passes late"),
        pytest.param([5_000, 10_002, 15_000], [1, 1, 1], id="off by more than a tick"),
    ],
)
def test_a_run_that_no_line_through_the_interval_gives(times_us: list[int], polarities: list[int]) -> None:
    """It counts as a run."""
    events = events_of([t * US for t in times_us], polarities)
    assert straight_runs(events, [INTERVALS], US, 2.0).tolist() == [[1, 0, 3]]


def test_two_events_and_dense_events_are_no_run() -> None:
    """Two lie on any line; spacings of less than ten ticks are lines by chance."""
    pair = events_of([5_000 * US, 10_000 * US], [1, 1])
    assert straight_runs(pair, [INTERVALS], US, 2.0).tolist() == [[0, 0, 0]]
    coarse = events_of([5_000 * US, 10_000 * US, 15_000 * US], [1, 1, 1])
    assert straight_runs(coarse, [INTERVALS], 1_000 * US, 2.0).tolist() == [[0, 0, 0]]


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(1, 60), st.integers(0, 1), st.integers(0, 3)), max_size=60))
def test_runs_are_those_of_a_slow_loop(rows: list[tuple[int, int, int]]) -> None:
    """Intervals are open at their start and closed at their stop; events outside of all are left out."""
    intervals = np.array([[3, 23], [23, 43]])
    rows.sort()
    t, p, x = (np.array([row[column] for row in rows], np.int64) for column in range(3))
    events = by_pixel(x.astype(np.uint16), np.zeros(len(x), np.uint16), t, p.astype(np.uint8), (1, 4))
    runs, lines, total = 0, 0, 0
    for pixel in range(4):
        for start, stop in intervals.tolist():
            chosen = (x == pixel) & (t > start) & (t <= stop)
            times, signs = t[chosen], p[chosen]
            # Ten ticks of zero: every number of events is a run.
            if len(times) < 3:
                continue
            runs, total = runs + 1, total + len(times)
            spacing = (times[-1] - times[0]) / (len(times) - 1)
            line = times[0] + spacing * np.arange(len(times))
            fills = times[0] - start <= 2 * spacing and stop - times[-1] <= spacing
            lines += bool(np.all(times == line) and len(set(signs.tolist())) == 1 and fills)
    assert straight_runs(events, [intervals], 0, 2.0).tolist() == [[runs, lines, total]]


def test_chance_is_that_of_random_events() -> None:
    """The middle one of three lies anywhere between the others."""
    rng = np.random.default_rng(1)
    middles = rng.uniform(0, 2 * 5_000, 200_000)
    assert np.mean(np.abs(middles - 5_000) < 50) == pytest.approx(chance_of_line(50, 5_000), rel=0.1)
