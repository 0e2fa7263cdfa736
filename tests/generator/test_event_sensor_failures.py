"""Failures that other simulators are known for, each shown not to happen here."""

import numpy as np
import pytest

from tests.generator.event_sensor_cases import MS, as_rows, pixel, play, sensor_for


def test_slow_oversampled_ramp_loses_no_event() -> None:
    """Steps of 5e-7 nat, below the 1e-6 that one simulator skips: all ten levels of the ramp fire."""
    levels = np.linspace(0, 0.01005, 20_001)
    sensor = sensor_for(np.ones((1, 1)), threshold_on=0.001)
    events = play(sensor, [k * 1_000 for k in range(20_001)], pixel(*levels))
    np.testing.assert_allclose(events.t_us, np.arange(1, 11) * 0.001 / 0.01005 * 20_000, atol=1.01)


def test_threshold_mismatch_does_not_depend_on_the_sampling() -> None:
    """Pixels with spread thresholds fire the same events, to 1 us, at 10 and at 500 samples of the same ramp."""
    streams = []
    for samples in (11, 501):
        sensor = sensor_for(np.ones((8, 8)), threshold_sigma=0.05)
        movie_dn = (np.full((8, 8), np.exp(level)) for level in np.linspace(0, 3, samples))
        streams.append(play(sensor, np.linspace(0, 100 * MS, samples, dtype=np.int64).tolist(), movie_dn))
    coarse, fine = (sorted(zip(e.y, e.x, e.p, e.t_us, strict=True)) for e in streams)
    assert len(coarse) == len(fine) > 64 * 10
    assert [row[:3] for row in coarse] == [row[:3] for row in fine]
    assert max(abs(int(a[3]) - int(b[3])) for a, b in zip(coarse, fine, strict=True)) <= 1


def test_reusing_one_image_buffer_changes_nothing() -> None:
    """A caller that renders every image into the same array gets the events of separate arrays; input is unchanged."""
    movie_dn = np.exp(np.random.default_rng(4).normal(3, 0.5, (6, 4, 4)))
    times_ns = [k * MS for k in range(6)]
    separate = play(sensor_for(movie_dn[0]), times_ns, movie_dn)
    buffer = np.empty((4, 4))

    def rendered_in_place():
        for luma_dn in movie_dn:
            buffer[...] = luma_dn
            yield buffer
            np.testing.assert_array_equal(buffer, luma_dn)
            buffer[...] = np.nan

    shared = play(sensor_for(movie_dn[0]), times_ns, rendered_in_place())
    assert as_rows(shared) == as_rows(separate)
    assert len(separate) > 20


@pytest.mark.parametrize("origin_us", [1_790_000_000_000_000, -86_400_000_000, 2**31])
def test_epoch_times_lose_nothing(origin_us: int) -> None:
    """Started at an epoch, before zero, or at the 32-bit wrap, the stamps are those from zero plus the origin."""
    movie_dn = np.exp(np.random.default_rng(5).normal(3, 0.5, (6, 4, 4)))
    steps_ns = [k * 777_000 for k in range(6)]
    from_zero = play(sensor_for(movie_dn[0]), steps_ns, movie_dn)
    from_origin = play(sensor_for(movie_dn[0]), [origin_us * 1_000 + t for t in steps_ns], movie_dn)
    np.testing.assert_array_equal(from_origin.t_us - origin_us, from_zero.t_us)
    np.testing.assert_array_equal(from_origin.x, from_zero.x)


def test_stamps_are_interpolated_not_those_of_the_samples() -> None:
    """At 1000 samples/s a 10 Hz sinusoid is stamped within 30 us RMS of its closed-form crossings, not 600 us."""
    times_ns = np.arange(0, 25 * MS + 1, MS)
    events = play(sensor_for(np.ones((1, 1))), times_ns.tolist(), pixel(*1.07 * np.sin(20 * np.pi * times_ns * 1e-9)))
    levels = 0.2 * np.arange(1, 6)
    crossings_us = np.arcsin(levels / 1.07) / (20 * np.pi) * 1e6
    assert np.sqrt(np.mean((events.t_us - crossings_us) ** 2)) < 30


def test_exact_multiples_of_the_threshold_fire_exactly_once() -> None:
    """C = ln 2 and luma 1, 2, 4, 2, 1: every sample ties with a level; each tie fires once, dwelling fires nothing."""
    luma = [1.0, 2.0, 2.0, 2.0, 4.0, 4.0, 2.0, 2.0, 1.0, 1.0] * 5
    sensor = sensor_for(np.ones((1, 1)), threshold_on=np.log(2.0), threshold_off=np.log(2.0))
    events = play(sensor, [k * MS for k in range(len(luma))], [np.full((1, 1), value) for value in luma])
    assert events.p.tolist() == [1, 1, 0, 0] * 5
    assert (events.t_us % 10_000 // 1_000).tolist() == [1, 4, 6, 8] * 5


def test_luma_is_not_rounded_for_the_log_model() -> None:
    """A ramp from 10.1 to 10.4 DN, all one grey value in 8 bits, crosses thresholds of 0.005 nat where it should."""
    steps = np.linspace(10.1, 10.4, 301)
    sensor = sensor_for(np.ones((1, 1)), threshold_on=0.005)
    events = play(sensor, [k * MS for k in range(301)], [np.full((1, 1), value) for value in steps])
    expected_us = (10.1 * np.exp(0.005 * np.arange(1, 6)) - 10.1) / 0.3 * 300_000
    np.testing.assert_allclose(events.t_us, expected_us, atol=2)
