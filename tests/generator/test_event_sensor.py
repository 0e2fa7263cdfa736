"""The ideal sensor against closed forms and an exact rational model."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from fedora_generator.events.sensor import EventSensor
from tests.generator.event_sensor_cases import MS, as_rows, options, pixel, play, sensor_for

movies = st.integers(0, 2**32 - 1).map(
    lambda seed: np.exp(np.cumsum(np.random.default_rng(seed).normal(0, 0.3, (12, 3, 4)), axis=0) + 3)
)


def test_ramp_is_timestamped_where_it_crosses() -> None:
    """A straight line in L from 0 to 1 in one step of 1 s crosses 0.3, 0.6, 0.9 at those times, rounded up to us."""
    ramp = sensor_for(np.ones((1, 1)), threshold_on=0.3)
    events = play(ramp, [0, 1_000 * MS], pixel(0.0, 1.0))
    assert as_rows(events) == [(300_000, 0, 0, 1), (600_000, 0, 0, 1), (900_000, 0, 0, 1)]


def test_timestamp_is_the_first_microsecond_not_before_the_crossing() -> None:
    """A crossing at 1/3 of 10 us is stamped 4 us, not 3."""
    events = play(sensor_for(np.ones((1, 1))), [0, 10_000], pixel(0.0, 0.6))
    assert events.t_us.tolist() == [4, 7]


def test_sinusoid_crosses_where_bisection_says() -> None:
    """L = A sin(2 pi f t), 20 us steps: the right levels in the right order, each within 3 us of its bisected time."""
    amplitude, frequency_hz, threshold = 1.07, 10.0, 0.2
    times_ns = np.arange(0, 200 * MS + 1, 20_000)
    level_at = lambda t_s: amplitude * np.sin(2 * np.pi * frequency_hz * t_s)  # noqa: E731
    events = play(sensor_for(np.ones((1, 1))), times_ns.tolist(), pixel(*level_at(times_ns * 1e-9)))

    expected: list[tuple[float, int]] = []
    turning_s = [0.0, *np.arange(0.025, 0.2, 0.05), 0.2]
    reference = 0
    for begin_s, end_s in pairwise(turning_s):
        direction = 1 if level_at(end_s) > level_at(begin_s) else -1
        while direction * (level_at(end_s) - (reference + direction) * threshold) >= 0:
            reference += direction
            crossing_s = brentq(lambda t, level=reference: level_at(t) - level * threshold, begin_s, end_s, xtol=1e-12)
            expected.append((crossing_s * 1e6, (direction + 1) // 2))
    times_us, polarities = zip(*expected, strict=True)
    assert events.p.tolist() == list(polarities)
    late_us = events.t_us - np.array(times_us)
    assert np.all((late_us > -2) & (late_us < 3))


@given(movies)
@settings(max_examples=30, deadline=None)
def test_events_are_those_of_exact_rational_arithmetic(movie_dn: np.ndarray) -> None:
    """Against a pixel model in rational numbers: the same events, each stamped in [crossing, crossing + 1 us)."""
    times_ns = [1_000 * int(t) for t in np.cumsum(np.full(len(movie_dn), 137))]
    events = play(sensor_for(movie_dn[0]), times_ns, movie_dn)
    by_pixel: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for t_us, y, x, p in as_rows(events):
        by_pixel.setdefault((y, x), []).append((t_us, p))
    threshold, logs = Fraction(0.2), np.log(movie_dn)
    for y, x in np.ndindex(movie_dn.shape[1:]):
        levels = [Fraction(value) for value in logs[:, y, x].tolist()]
        reference, expected = levels[0], []
        for step in range(1, len(levels)):
            while abs(levels[step] - reference) >= threshold:
                direction = 1 if levels[step] > reference else -1
                reference += direction * threshold
                share = (reference - levels[step - 1]) / (levels[step] - levels[step - 1])
                crossing_ns = times_ns[step - 1] + share * (times_ns[step] - times_ns[step - 1])
                expected.append((crossing_ns, (direction + 1) // 2))
        got = by_pixel.get((y, x), [])
        assert [p for _, p in got] == [p for _, p in expected]
        # A nanosecond of slack: the clock inside is whole nanoseconds.
        assert all(-1 <= 1_000 * t_us - t_ns < 1_001 for (t_us, _), (t_ns, _) in zip(got, expected, strict=True))


@given(movies, st.floats(0.05, 0.5), st.floats(0.05, 0.5), st.sampled_from(["zero", "uniform"]))
@settings(max_examples=30, deadline=None)
def test_signal_stays_between_its_thresholds(movie_dn: np.ndarray, on: float, off: float, phase: str) -> None:
    """After every step -C_off < L - ref < C_on, and L moved by C_on P - C_off M plus the change of that excursion."""
    sensor = sensor_for(movie_dn[0], threshold_on=on, threshold_off=off, initial_phase=phase)
    sensor.start(0, movie_dn[0])
    first, net = sensor.excursions, np.zeros(movie_dn.shape[1:])
    for step, luma_dn in enumerate(movie_dn[1:], start=1):
        events = sensor.advance(step * MS, luma_dn)
        np.add.at(net, (events.y, events.x), np.where(events.p == 1, on, -off))
        assert np.all((sensor.excursions < on) & (sensor.excursions > -off))
        moved = np.log(luma_dn) - np.log(movie_dn[0])
        np.testing.assert_allclose(moved, net + sensor.excursions - first, atol=1e-12)


@given(movies, st.sampled_from(["log", "linear"]))
@settings(max_examples=20, deadline=None)
def test_events_come_in_canonical_order(movie_dn: np.ndarray, model: str) -> None:
    """Each batch lies in (t_previous, t] and everything together is sorted by (t, y, x, p)."""
    sensor = sensor_for(movie_dn[0], model=model)
    sensor.start(0, movie_dn[0])
    rows = []
    for step, luma_dn in enumerate(movie_dn[1:], start=1):
        events = sensor.advance(step * MS, luma_dn)
        assert np.all((events.t_us > (step - 1) * 1_000) & (events.t_us <= step * 1_000))
        rows += as_rows(events)
    assert rows == sorted(rows)
    assert rows


def test_columns_have_the_types_of_the_file() -> None:
    """x, y u16, t i64, p u8, at the pixel (column, row) that changed; also when there is no event."""
    dark, bright = np.ones((3, 5)), np.ones((3, 5))
    bright[2, 4] = np.exp(0.25)
    sensor = sensor_for(dark)
    sensor.start(0, dark)
    for events, rows in ((sensor.advance(MS, dark), []), (sensor.advance(2 * MS, bright), [(1_800, 2, 4, 1)])):
        types = [column.dtype for column in (events.x, events.y, events.t_us, events.p)]
        assert types == [np.uint16, np.uint16, np.int64, np.uint8]
        assert as_rows(events) == rows
        assert len(events) == len(rows)


def test_uniform_phase_spreads_the_first_reference_over_both_thresholds() -> None:
    """The first excursion is uniform in (-C_off, C_on): mean and variance of that distribution, bounds kept."""
    grey = np.full((100, 100), 50.0)
    sensor = sensor_for(grey, threshold_on=0.3, threshold_off=0.1, initial_phase="uniform")
    sensor.start(0, grey)
    excursions = sensor.excursions
    assert excursions.min() > -0.1
    assert excursions.max() < 0.3
    assert excursions.mean() == pytest.approx(0.1, abs=5 * 0.4 / np.sqrt(12 * 10_000))
    assert excursions.std() == pytest.approx(0.4 / np.sqrt(12), rel=0.03)


def test_linear_model_is_strict_and_fires_once_a_step() -> None:
    """Threshold 30: a difference of 30 is silent, 31 fires, 200 fires once; the reference becomes the value."""
    values = [100.0, 130.0, 131.0, 102.0, 101.0, 100.4, 254.0, 224.0]
    sensor = sensor_for(np.ones((1, 1)), model="linear", threshold_on=30, threshold_off=30)
    events = play(sensor, [k * MS for k in range(8)], [np.full((1, 1), value) for value in values])
    assert as_rows(events) == [(2_000, 0, 0, 1), (5_000, 0, 0, 0), (6_000, 0, 0, 1)]


def test_linear_model_sees_rounded_luma() -> None:
    """The sensor compares rint(luma): 10.5 is 10, so 40.4 is 30 away (silent) and 40.6 is 31 (fires)."""
    sensor = sensor_for(np.ones((1, 1)), model="linear", threshold_on=30, threshold_off=30)
    events = play(sensor, [0, MS, 2 * MS], [np.full((1, 1), value) for value in (10.5, 40.4, 40.6)])
    assert events.t_us.tolist() == [2_000]


def test_log_eps_is_added_before_the_logarithm() -> None:
    """With log_eps_dn = 1, going from 0 to 1 DN is a step of ln 2: three events of 0.2, and 0 DN is legal."""
    sensor = sensor_for(np.zeros((1, 1)), log_eps_dn=1.0)
    events = play(sensor, [0, MS], [np.zeros((1, 1)), np.ones((1, 1))])
    np.testing.assert_array_equal(events.t_us, np.ceil(np.array([0.2, 0.4, 0.6]) / np.log(2) * 1_000))


def test_lin_log_is_linear_in_the_dark() -> None:
    """With T = 20 DN, L rises from 0 to ln 20 at 20 DN on a line, and as the logarithm from there on."""
    sensor = sensor_for(np.zeros((1, 1)), linear_below_dn=20.0)
    events = play(sensor, [0, MS, 2 * MS], [np.full((1, 1), value) for value in (0.0, 20.0, 40.0)])
    # Multiples of 0.2: fourteen of them are below ln 20 = 2.996, and three more below ln 40 = 3.689.
    rises = 0.2 * np.arange(1, 19)
    times_ms = np.where(rises <= np.log(20), rises / np.log(20), 1 + (rises - np.log(20)) / np.log(2))
    np.testing.assert_array_equal(events.t_us, np.ceil(times_ms * 1000))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"threshold_on": 0.0}, "threshold_on"),
        ({"threshold_off": -0.2}, "threshold_off"),
        ({"threshold_on": float("nan")}, "threshold_on"),
        ({"shot_rate_hz": -1.0}, "shot_rate_hz"),
        ({"linear_below_dn": 1.0}, "linear_below_dn"),
        ({"model": "cubic"}, "model"),
        ({"initial_phase": "random"}, "initial_phase"),
    ],
)
def test_impossible_options_are_refused(changes: dict[str, object], named: str) -> None:
    """A zero, negative or undefined threshold, a negative rate, an unknown model: an error that names the option."""
    with pytest.raises(ValueError, match=named):
        options(**changes)


def test_misuse_is_refused_in_one_sentence() -> None:
    """A wrong shape, time that stands still or is off the microsecond, no light, too many hot pixels, no start."""
    grey = np.ones((2, 3))
    with pytest.raises(ValueError, match="at most 6 hot pixels"):
        sensor_for(grey, hot_pixel_count=7)
    with pytest.raises(ValueError, match="at least 1 x 1"):
        EventSensor(options(), 0, 3, np.random.SeedSequence(0))
    sensor = sensor_for(grey)
    with pytest.raises(RuntimeError, match="start before advance"):
        sensor.advance(MS, grey)
    with pytest.raises(ValueError, match=r"shape \(2, 3\), got \(3, 2\)"):
        sensor.start(0, grey.T)
    with pytest.raises(ValueError, match=r"1 pixels without a logarithm, first \(column 1, row 0\)"):
        sensor.start(0, np.array([[1.0, 0.0, 1.0], [1.0, 1.0, 1.0]]))
    sensor.start(0, grey)
    with pytest.raises(RuntimeError, match="start once"):
        sensor.start(0, grey)
    with pytest.raises(ValueError, match="after 0 ns"):
        sensor.advance(0, grey)
    with pytest.raises(ValueError, match="whole microsecond"):
        sensor.advance(1_500, grey)
    with pytest.raises(ValueError, match="got 6 pixels"):
        sensor.advance(MS, np.full((2, 3), np.nan))
