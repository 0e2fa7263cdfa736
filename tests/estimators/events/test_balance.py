"""The balance of events against changes of the light, of pixels whose signals rise or fall evenly."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.events.balance import TILES, BalanceSums, sum_balance
from fedora_qa.estimators.events.balance_estimates import (
    concentration,
    gain_across,
    gain_over_time,
    response_line,
    silent_share,
    threshold_spread,
)

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]

FRAMES, SHAPE, ON, OFF, INTERVAL_NS = 13, (80, 96), 0.25, 0.2, 20_000_000
SECONDS = INTERVAL_NS / 1e9
WHILE = slice(4, 8)

Fault = Callable[[Int32, np.random.Generator], Int32]


def world(seed: int, gains: Float64 | float = 1.0) -> tuple[NDArray[np.float32], Int32]:
    """Levels (n, h, w), and the events of thresholds that are smaller by ``gains``, from a random phase.

    A pixel changes by up to four thresholds between two frames, always in one direction.
    """
    random = np.random.default_rng(seed)
    rises = random.random(SHAPE) < 0.5
    thresholds = np.where(rises, ON, -OFF)
    step = random.uniform(0.0, 4.0, SHAPE)
    passed = np.broadcast_to(step * gains, (FRAMES - 1, *SHAPE)).cumsum(axis=0)
    total = np.floor(np.concatenate([np.zeros((1, *SHAPE)), passed]) + random.random(SHAPE))
    events = np.diff(total, axis=0).astype(np.int32)
    counts = np.stack([np.where(rises, 0, events), np.where(rises, events, 0)], axis=1).astype(np.int32)
    levels = 3.0 + np.arange(FRAMES)[:, np.newaxis, np.newaxis] * (step * thresholds)
    return levels.astype(np.float32), counts


def balance(seed: int = 0, gains: Float64 | float = 1.0, fault: Fault = lambda counts, random: counts) -> BalanceSums:
    levels, counts = world(seed, gains)
    counts = np.ascontiguousarray(fault(counts, np.random.default_rng(seed + 1000)))
    intervals_ns = np.full(len(counts), INTERVAL_NS)
    return sum_balance(levels, np.ones(levels.shape, np.bool_), counts, (OFF, ON), intervals_ns)


def thinned(counts: Int32, random: np.random.Generator) -> Int32:
    return random.binomial(counts, 0.7).astype(np.int32)


def one_at_most(counts: Int32, random: np.random.Generator) -> Int32:
    return np.minimum(counts, 1)


def inverted_for_a_while(counts: Int32, random: np.random.Generator) -> Int32:
    changed = counts.copy()
    changed[WHILE] = counts[WHILE, ::-1]
    return changed


def with_noise(counts: Int32, random: np.random.Generator) -> Int32:
    """1.5 events of each polarity in a second."""
    return (counts + random.poisson(1.5 * SECONDS, counts.shape)).astype(np.int32)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [(None, (1.0, 1.0, 0.0)), (thinned, (0.7, 1.0, 0.3))],
    ids=["clean", "thinned"],
)
def test_gain_growth_and_scatter_have_the_stated_errors(
    fault: Fault | None, expected: tuple[float, float, float]
) -> None:
    """Over 30 worlds the mean pull is 0 within 4 of its errors, and the spread of pulls 1.

    A binomial loss of 0.3 scatters by 0.3 for each event that is left, and a little less, as only what varies of the
    phases is thinned.
    """
    pulls = []
    for seed in range(30):
        line = response_line((balance(seed) if fault is None else balance(seed, fault=fault)).moments)
        assert line is not None
        estimates = line.gain, line.growth, line.scatter
        pulls.append([(each.value - true) / each.error for each, true in zip(estimates, expected, strict=True)])
    assert np.abs(np.mean(pulls, axis=0)).max() < 4 / np.sqrt(30)
    assert 0.6 < np.std(pulls, axis=0).min() < np.std(pulls, axis=0).max() < 1.5


@pytest.mark.parametrize("gain", [1 / 1.6, 0.5, 1.3, 1.7])
def test_other_thresholds_have_a_gain_without_scatter(gain: float) -> None:
    """A loss at random would scatter by 1 - gain, duplicates by more."""
    line = response_line(balance(gains=gain).moments)
    assert line is not None
    assert line.gain.value == pytest.approx(gain, abs=5 * line.gain.error)
    assert abs(line.scatter.value) < min(abs(1 - gain) / 2, 0.15)


def test_each_polarity_has_its_gain() -> None:
    """Where a third of the darker events is lost."""

    def darker_lost(counts: Int32, random: np.random.Generator) -> Int32:
        return np.stack([random.binomial(counts[:, 0], 2 / 3), counts[:, 1]], axis=1).astype(np.int32)

    moments = balance(fault=darker_lost).moments
    off, on = (response_line(moments[:, [sign]]) for sign in (0, 1))
    assert off is not None
    assert on is not None
    assert (off.gain.value, on.gain.value) == pytest.approx((2 / 3, 1.0), abs=0.02)


def test_pixels_that_give_one_event_at_most_do_not_grow() -> None:
    line = response_line(balance(fault=one_at_most).moments)
    assert line is not None
    assert abs(line.growth.value) < 0.05


def test_thresholds_of_pixels_agree_over_time() -> None:
    """Gains with a standard deviation of 0.2 have a variance of 0.04; equal ones, and losses, have none."""
    gains = np.random.default_rng(3).normal(1.0, 0.2, SHAPE).clip(0.3)
    spread = threshold_spread(balance(gains=gains).agreement)
    assert spread.value == pytest.approx(0.04, abs=5 * spread.error)
    assert spread.value > 10 * spread.error
    for other in (balance().agreement, balance(fault=thinned).agreement):
        none = threshold_spread(other)
        assert abs(none.value) < 4 * none.error + 1e-3


def test_spurious_events_come_against_the_light() -> None:
    """Half of 3 Hz; of an ideal sensor there are none."""
    for fault, rate_hz in ((None, 0.0), (with_noise, 1.5)):
        sums = balance() if fault is None else balance(fault=fault)
        seconds = float(sums.seconds.sum())
        error = np.sqrt(rate_hz / seconds)
        assert float(sums.against.sum()) / seconds == pytest.approx(rate_hz, abs=4 * error)


def test_columns_that_fire_hold_the_events_against_the_light() -> None:
    """Noise lies in all columns alike."""

    def columns_fire(counts: Int32, random: np.random.Generator) -> Int32:
        changed = counts.copy()
        changed[..., [20, 21]] += random.poisson(0.5, changed[..., [20, 21]].shape).astype(np.int32)
        return changed

    assert concentration(balance(fault=columns_fire).columns_against.sum(axis=0)) > 0.9
    assert concentration(balance(fault=with_noise).columns_against.sum(axis=0)) < 0.05


def test_a_part_of_the_time_has_its_own_gain() -> None:
    """Thresholds that double for a while, and a polarity that is inverted: its events stand for the other step."""
    gains = np.ones((FRAMES - 1, 1, 1))
    gains[WHILE] = 0.5
    for sums, contrast in ((balance(gains=gains), -0.5), (balance(fault=inverted_for_a_while), -2.0)):
        course = gain_over_time(sums.moments, 3)
        assert course is not None
        assert not course.is_trend
        assert (course.first, course.stop) == (WHILE.start, WHILE.stop)
        assert course.contrast.value == pytest.approx(contrast, abs=max(5 * course.contrast.error, 0.03))
        assert course.usual == pytest.approx(1.0, abs=0.02)


def test_a_gain_that_falls_in_time_is_a_trend() -> None:
    """From 1.2 to 0.8."""
    course = gain_over_time(balance(gains=np.linspace(1.2, 0.8, FRAMES - 1)[:, np.newaxis, np.newaxis]).moments, 3)
    assert course is not None
    assert course.is_trend
    assert course.contrast.value == pytest.approx(-0.4, abs=5 * course.contrast.error)


def test_a_gain_that_grows_across_the_image_is_a_trend() -> None:
    """From 0.6 to 1.4 along the columns; the middles of the first and the last of 8 tiles are 7/8 of that apart."""
    course = gain_across(balance(gains=np.broadcast_to(np.linspace(0.6, 1.4, SHAPE[1]), SHAPE)).moments)
    assert course is not None
    assert course.contrast.value == pytest.approx(0.8 * (TILES - 1) / TILES, abs=0.02)
    even = gain_across(balance().moments)
    assert even is not None
    assert even.contrast.value < 0.05


def test_a_gain_that_varies_does_not_scatter() -> None:
    """Neither over time nor across the image: the scatter is that within tiles and intervals."""
    gains = np.linspace(1.2, 0.6, FRAMES - 1)[:, np.newaxis, np.newaxis] * np.linspace(0.8, 1.2, SHAPE[1])
    line = response_line(balance(gains=gains).moments)
    assert line is not None
    assert abs(line.scatter.value) < 0.05


def test_a_silent_side_holds_what_is_missing() -> None:
    def silent_side(counts: Int32, random: np.random.Generator) -> Int32:
        changed = counts.copy()
        changed[WHILE, :, :, : SHAPE[1] // 2] = 0
        return changed

    assert silent_share(balance(fault=silent_side).moments) > 0.95
    assert silent_share(balance(fault=thinned).moments) == 0.0


def test_sums_of_windows_join_in_the_order_of_time() -> None:
    earlier, later = balance(0), balance(1)
    joined = earlier.then(later)
    np.testing.assert_array_equal(joined.moments, np.concatenate([earlier.moments, later.moments]))
    assert joined.columns_against.shape == (2, SHAPE[1])
    assert joined.agreement.shape == (2, TILES**2, 2)


def test_pixels_whose_light_is_not_known_count_nothing() -> None:
    levels, counts = world(0)
    dark = np.zeros(levels.shape, np.bool_)
    sums = sum_balance(levels, dark, counts, (OFF, ON), np.full(len(counts), INTERVAL_NS))
    assert not sums.moments.any()
    assert not sums.seconds.any()
    assert response_line(sums.moments) is None
    assert gain_over_time(sums.moments, 3) is None
    assert gain_across(sums.moments) is None


def test_a_sensor_without_an_event_has_no_line() -> None:
    assert response_line(balance(fault=lambda counts, random: np.zeros_like(counts)).moments) is None
