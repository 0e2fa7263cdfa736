"""Failures that other simulators are known for, each shown not to happen here, in both models."""

from typing import Any

import numpy as np
import pytest

from tests.generator.event_sensor_cases import MS, as_rows, pixel, play, sensor_for

Changes = dict[str, Any]

LINEAR: Changes = {"model": "linear", "threshold_on": 15, "threshold_off": 15}
BOTH_MODELS = pytest.mark.parametrize("model", [{"threshold_on": 0.2}, LINEAR], ids=["log", "linear"])


def test_slow_oversampled_ramp_loses_no_event() -> None:
    """Steps of 5e-7 nat, below the 1e-6 that one simulator skips: all ten levels of the ramp fire."""
    levels = np.linspace(0, 0.01005, 20_001)
    sensor = sensor_for(np.ones((1, 1)), threshold_on=0.001)
    events = play(sensor, [k * 1_000 for k in range(20_001)], pixel(*levels))
    np.testing.assert_allclose(events.t_us, np.arange(1, 11) * 0.001 / 0.01005 * 20_000, atol=1.01)


def test_slow_oversampled_ramp_of_the_linear_model_loses_no_event() -> None:
    """Steps of 0.002 DN from 0 to 40.4: with threshold 3 it fires when rint reaches 4, 8, ..., 40."""
    values = np.linspace(0, 40.4, 20_201)
    sensor = sensor_for(np.ones((1, 1)), model="linear", threshold_on=3, threshold_off=3)
    events = play(sensor, [k * 1_000 for k in range(20_201)], values.reshape(-1, 1, 1))
    np.testing.assert_allclose(events.t_us, (4 * np.arange(1, 11) - 0.5) / 0.002, atol=1.01)


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


@BOTH_MODELS
def test_thresholds_are_drawn_once(model: Changes) -> None:
    """Each image shown 40 times in a row, where thresholds drawn anew would fire at rest: as when shown once."""
    movie_dn = np.exp(np.random.default_rng(6).normal(4, 0.3, (5, 6, 7)))
    spread = {**model, "threshold_sigma": 0.2 * model["threshold_on"]}
    once = play(sensor_for(movie_dn[0], **spread), [k * MS for k in range(5)], movie_dn)
    times_ns = [k * MS + j * 10_000 for k in range(5) for j in (0, *range(61, 100))]
    often = play(sensor_for(movie_dn[0], **spread), times_ns, np.repeat(movie_dn, 40, axis=0))
    by_image = [sorted(zip(-(-e.t_us // 1_000), e.y, e.x, e.p, strict=True)) for e in (once, often)]
    assert by_image[0] == by_image[1]
    assert len(once) > 50


@BOTH_MODELS
def test_the_first_interval_is_like_any_other(model: Changes) -> None:
    """The events of the first interval are those of the same two images shown after a second of standing still."""
    images_dn = np.exp(np.random.default_rng(3).normal(4, 0.5, (2, 5, 4)))
    at_once = play(sensor_for(images_dn[0], **model), [0, 7 * MS], images_dn)
    later_dn = [images_dn[0]] * 11 + [images_dn[1]]
    times_ns = [*range(0, 1_001 * MS, 100 * MS), 1_007 * MS]
    later = play(sensor_for(images_dn[0], **model), times_ns, later_dn)
    assert as_rows(at_once) == [(t_us - 1_000_000, y, x, p) for t_us, y, x, p in as_rows(later)]
    assert len(at_once) > 10


@BOTH_MODELS
def test_reusing_one_image_buffer_changes_nothing(model: Changes) -> None:
    """A caller that renders every image into the same array gets the events of separate arrays; input is unchanged."""
    movie_dn = np.exp(np.random.default_rng(4).normal(4, 0.5, (6, 4, 4)))
    times_ns = [k * MS for k in range(6)]
    separate = play(sensor_for(movie_dn[0], **model), times_ns, movie_dn)
    buffer = np.empty((4, 4))

    def rendered_in_place():
        for luma_dn in movie_dn:
            buffer[...] = luma_dn
            yield buffer
            np.testing.assert_array_equal(buffer, luma_dn)
            buffer[...] = np.nan

    shared = play(sensor_for(movie_dn[0], **model), times_ns, rendered_in_place())
    assert as_rows(shared) == as_rows(separate)
    assert len(separate) > 20


@pytest.mark.parametrize("origin_us", [1_790_000_000_000_000, -86_400_000_000, 2**31])
@BOTH_MODELS
def test_epoch_times_lose_nothing(origin_us: int, model: Changes) -> None:
    """Started at an epoch, before zero, or at the 32-bit wrap, the stamps are those from zero plus the origin."""
    movie_dn = np.exp(np.random.default_rng(5).normal(4, 0.5, (6, 4, 4)))
    steps_ns = [k * 777_000 for k in range(6)]
    from_zero = play(sensor_for(movie_dn[0], **model), steps_ns, movie_dn)
    from_origin = play(sensor_for(movie_dn[0], **model), [origin_us * 1_000 + t for t in steps_ns], movie_dn)
    np.testing.assert_array_equal(from_origin.t_us - origin_us, from_zero.t_us)
    np.testing.assert_array_equal(from_origin.x, from_zero.x)
    assert len(from_zero) > 10


def test_timestamps_are_interpolated_not_those_of_the_samples() -> None:
    """At 1000 samples/s a 10 Hz sinusoid is stamped within 30 us RMS of its closed-form crossings, not 600 us."""
    times_ns = np.arange(0, 25 * MS + 1, MS)
    events = play(sensor_for(np.ones((1, 1))), times_ns.tolist(), pixel(*1.07 * np.sin(20 * np.pi * times_ns * 1e-9)))
    levels = 0.2 * np.arange(1, 6)
    crossings_us = np.arcsin(levels / 1.07) / (20 * np.pi) * 1e6
    assert np.sqrt(np.mean((events.t_us - crossings_us) ** 2)) < 30


def test_timing_error_falls_with_the_square_of_the_step() -> None:
    """No floor: from 500 to 50 000 samples/s the error of a sinusoid's crossings falls 10^4 times, to 10 ns.

    The sensor's arithmetic knows no unit of time: told times 1000 times as long, it stamps in nanoseconds.
    """
    levels = 0.2 * np.arange(1, 6)
    crossings_ns = np.arcsin(levels / 1.07) / (20 * np.pi) * 1e9
    errors_ns = []
    for step_us in (2_000, 20):
        times_us = np.arange(0, 24_001, step_us)
        movie_dn = pixel(*1.07 * np.sin(20 * np.pi * times_us * 1e-6))
        timestamps_ns = play(sensor_for(np.ones((1, 1))), (times_us * 1_000 * 1_000).tolist(), movie_dn).t_us
        errors_ns.append(np.sqrt(np.mean((timestamps_ns - crossings_ns) ** 2)))
    assert errors_ns[0] / errors_ns[1] > 3_000
    assert errors_ns[1] < 30


def test_timestamps_of_the_linear_model_are_those_of_its_images() -> None:
    """It knows nothing between images: every stamp is the time of one, rounded up to the microsecond it stands for."""
    movie_dn = np.exp(np.random.default_rng(7).normal(4, 0.5, (6, 4, 4)))
    times_ns = [k * 777_000 for k in range(6)]
    events = play(sensor_for(movie_dn[0], **LINEAR), times_ns, movie_dn)
    assert set(events.t_us.tolist()) == {t // 1_000 for t in times_ns[1:]}


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


def test_exact_multiples_of_the_threshold_are_silent_in_the_linear_model() -> None:
    """Threshold 15 and steps of 15: strictly greater is needed, so only the sum of two steps fires, once."""
    values = [15.0, 30.0, 45.0, 45.0, 30.0, 15.0, 0.0] * 3
    events = play(sensor_for(np.ones((1, 1)), **LINEAR), [k * MS for k in range(21)], np.reshape(values, (-1, 1, 1)))
    assert events.p.tolist() == [1, 0, 1, 0, 1, 0]
    assert (events.t_us // 1_000 % 7).tolist() == [2, 5, 2, 5, 2, 5]
