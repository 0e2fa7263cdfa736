"""Every effect that the sensor can add, each against its closed form or its statistics."""

from collections.abc import Iterator

import numpy as np
import pytest

from fedora_generator.events.keys import EventBatch
from tests.generator.event_sensor_cases import MS, Floats, as_rows, pixel, play, sensor_for

GREY = np.full((20, 30), 50.0)


def at_rest(seconds: float, step_ms: float, **changes: float) -> EventBatch:
    """A grey wall for a while."""
    steps = round(seconds * 1e3 / step_ms) + 1
    times_ns = [round(k * step_ms * MS) for k in range(steps)]
    return play(sensor_for(GREY, **changes), times_ns, (GREY for _ in range(steps)))


def flicker(steps: int, step_ms: int = 2) -> tuple[list[int], Iterator[Floats]]:
    """A wall whose pixels wander."""
    walk = np.cumsum(np.random.default_rng(8).normal(0, 0.2, (steps, *GREY.shape)), axis=0)
    return [k * step_ms * MS for k in range(steps)], iter(50.0 * np.exp(walk))


def test_leak_gives_brighter_events_at_its_rate() -> None:
    """At rest every pixel fires ON at k / leak_rate and nothing else, however time is cut."""
    for step_ms in (1.0, 7.0, 50.0):
        events = at_rest(0.35, step_ms, leak_rate_hz=10.0)
        assert np.all(events.p == 1)
        np.testing.assert_array_equal(events.t_us, np.repeat([100_000, 200_000, 300_000], GREY.size))


@pytest.mark.parametrize("model", ["log", "linear"])
def test_shot_noise_is_poisson_of_both_polarities(model: str) -> None:
    """600 pixels at 5 Hz for 2 s: 6000 events within five sigma, half brighter, variance over pixels = mean."""
    events = at_rest(2.0, 10.0, model=model, shot_rate_hz=5.0)
    assert len(events) == pytest.approx(6_000, abs=5 * np.sqrt(6_000))
    assert events.p.mean() == pytest.approx(0.5, abs=5 * 0.5 / np.sqrt(6_000))
    counts = np.bincount(events.y * 30 + events.x, minlength=600)
    assert counts.var() / counts.mean() == pytest.approx(1.0, abs=5 * np.sqrt(2 / 600))
    assert np.all((events.t_us > 0) & (events.t_us <= 2_000_000))


def test_spurious_events_do_not_depend_on_the_steps() -> None:
    """Shot noise and hot pixels are the same events whether time is cut in 2, 7 or 100 ms."""
    effects = {"shot_rate_hz": 3.0, "hot_pixel_count": 4, "hot_pixel_rate_hz": 100.0}
    streams = [as_rows(at_rest(0.7, step_ms, **effects)) for step_ms in (2.0, 7.0, 100.0)]
    assert streams[0] == streams[1] == streams[2]
    assert streams[0]


def test_spurious_events_leave_the_true_ones_alone() -> None:
    """With shot noise every event of the clean sensor is still there, and the excursions are the same."""
    clean, noisy = sensor_for(GREY), sensor_for(GREY, shot_rate_hz=20.0)
    rows = [as_rows(play(sensor, *flicker(40))) for sensor in (clean, noisy)]
    assert set(rows[0]) <= set(rows[1])
    assert len(rows[1]) - len(rows[0]) == pytest.approx(600 * 20 * 0.078, rel=0.2)
    np.testing.assert_array_equal(clean.excursions, noisy.excursions)


def test_hot_pixels_fire_where_they_are_declared() -> None:
    """Only the declared (column, row) fire, each at its rate, within five sigma."""
    changes = {"hot_pixel_count": 5, "hot_pixel_rate_hz": 200.0}
    hot = {tuple(place) for place in sensor_for(GREY, **changes).hot_pixels.tolist()}
    events = at_rest(2.0, 50.0, **changes)
    assert len(hot) == 5
    counts = {place: np.sum((events.x == place[0]) & (events.y == place[1])) for place in hot}
    assert sum(counts.values()) == len(events)
    assert all(abs(count - 400) < 5 * np.sqrt(400) for count in counts.values())


def test_thresholds_spread_as_declared_with_a_floor() -> None:
    """Per-pixel thresholds have the declared mean and sigma, differ for ON and OFF, and never go below C / 10."""
    wall = np.ones((100, 100))
    on, off = sensor_for(wall, threshold_sigma=0.02).thresholds
    for thresholds in (on, off):
        assert thresholds.mean() == pytest.approx(0.2, abs=5 * 0.02 / 100)
        assert thresholds.std() == pytest.approx(0.02, rel=5 / np.sqrt(2 * 10_000))
    assert abs(np.corrcoef(on.ravel(), off.ravel())[0, 1]) < 0.05
    assert sensor_for(wall, threshold_sigma=0.5).thresholds.min() == pytest.approx(0.02)
    assert np.all(sensor_for(wall).thresholds == 0.2)


def test_low_pass_answers_a_step_exponentially() -> None:
    """After a jump of 2 nat in one us the signal rises as 2 (1 - exp(-t / tau)); levels are crossed when that says."""
    tau_us = 1e6 / (2 * np.pi * 20.0)
    times_ns = [0, 1_000, *range(51_000, 20 * MS, 50_000)]
    levels = pixel(0.0, *[2.0] * (len(times_ns) - 1))
    events = play(sensor_for(np.ones((1, 1)), bandwidth_hz=20.0), times_ns, levels)
    crossings_us = -tau_us * np.log1p(-0.1 * np.arange(1, len(events) + 1))
    assert len(events) == 9
    np.testing.assert_allclose(events.t_us, crossings_us, atol=2.5)


def test_low_pass_does_not_depend_on_the_steps() -> None:
    """A ramp through the filter ends at the same excursion whether shown in 1 or in 64 steps."""
    ends = []
    for steps in (1, 64):
        sensor = sensor_for(np.ones((1, 1)), bandwidth_hz=30.0, threshold_on=10.0)
        play(sensor, np.linspace(0, 64 * MS, steps + 1, dtype=np.int64), pixel(*np.linspace(0, 3, steps + 1)))
        ends.append(sensor.excursions[0, 0])
    tau_s = 1 / (2 * np.pi * 30.0)
    slope = 3 / 0.064
    assert ends[0] == pytest.approx(3 - slope * tau_s * (1 - np.exp(-0.064 / tau_s)), rel=1e-12)
    assert ends[1] == pytest.approx(ends[0], rel=1e-12)


def test_refractory_loses_what_comes_too_soon() -> None:
    """The survivors are those of a plain loop over the clean stream; the reference moves with the lost ones too."""
    clean, dead = sensor_for(GREY), sensor_for(GREY, refractory_us=1_500)
    every, kept = (as_rows(play(sensor, *flicker(40))) for sensor in (clean, dead))
    last_us: dict[tuple[int, int], int] = {}
    expected = []
    for t_us, y, x, p in every:
        if t_us - last_us.get((y, x), -(10**9)) >= 1_500:
            last_us[y, x] = t_us
            expected.append((t_us, y, x, p))
    assert kept == expected
    assert 0.3 < len(kept) / len(every) < 0.9
    np.testing.assert_array_equal(clean.excursions, dead.excursions)


def test_packets_round_up_and_lose_nothing() -> None:
    """With 200 us packets each event has the first tick not before its stamp; order and delivery keep to time."""
    times_ns, movie_dn = flicker(30)
    exact = play(sensor_for(GREY), *flicker(30))
    sensor = sensor_for(GREY, packet_interval_us=200)
    packed = play(sensor, times_ns, movie_dn)
    expected = sorted((-(-t // 200) * 200, y, x, p) for t, y, x, p in as_rows(exact))
    assert as_rows(packed) == expected


def test_unfinished_packet_is_held_back_and_closes_with_the_recording() -> None:
    """Steps of 130 us: no batch holds a stamp beyond its time, and the last packet is stamped with the last time."""
    sensor = sensor_for(np.ones((1, 1)), packet_interval_us=200)
    sensor.start(0, np.ones((1, 1)))
    batches = [sensor.advance(130_000 * k, np.full((1, 1), np.exp(0.5 * k))) for k in (1, 2, 3)]
    assert [batch.t_us.tolist() for batch in batches] == [[], [200, 200, 200], []]
    assert sensor.finish().t_us.tolist() == [390] * 4
    assert len(sensor.finish()) == 0


def test_same_seed_same_events_and_every_effect_has_its_own_stream() -> None:
    """All effects together repeat bit for bit; another seed differs; one more effect leaves the thresholds alone."""
    effects = {
        "threshold_sigma": 0.02,
        "shot_rate_hz": 1.0,
        "leak_rate_hz": 0.5,
        "bandwidth_hz": 200.0,
        "refractory_us": 100,
        "hot_pixel_count": 3,
        "hot_pixel_rate_hz": 50.0,
        "packet_interval_us": 200,
        "initial_phase": "uniform",
    }
    rows = [as_rows(play(sensor_for(GREY, seed=seed, **effects), *flicker(20))) for seed in (1, 1, 2)]
    assert rows[0] == rows[1] != rows[2]
    plain, more = (sensor_for(GREY, threshold_sigma=0.02, shot_rate_hz=rate) for rate in (0.0, 9.0))
    np.testing.assert_array_equal(plain.thresholds, more.thresholds)
