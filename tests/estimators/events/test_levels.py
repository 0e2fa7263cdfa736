"""Bracketed level samples and their regression, on a closed-form world."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.events.levels import (
    DISAGREEMENT_KNEE,
    LevelImages,
    LevelPairs,
    accumulate,
    level_pairs,
    precision_weights,
)
from fedora_qa.estimators.events.pixels import by_pixel
from fedora_qa.estimators.events.threshold_fit import NormalBlocks, ResponseFit, concatenate, fit_response
from tests.estimators.event_world import MS, Stream, Waves, log_events

SHAPE = (40, 56)
FRAMES_NS = np.arange(0, 401, 20) * MS
WORLD = Waves(amplitude_dn=10.0, mean_dn=140.0, velocity_px_s=(200.0, 40.0), seed=3)
LEVELS = np.log([WORLD.luma(time_ns * 1e-9, SHAPE) for time_ns in FRAMES_NS])


@pytest.fixture(scope="module")
def events() -> Stream:
    return log_events(WORLD, SHAPE, 400 * MS, on=0.15, off=0.2)


def shown(usable: np.ndarray, hidden: list[int] | None = None) -> LevelImages:
    """Frames that are bright where they are usable."""
    light = np.where(usable, 200, 50).astype(np.float32)
    return LevelImages(light, np.full_like(light, 255), np.zeros_like(light), 100.0, np.array(hidden or [], np.int64))


def pairs_of(events: Stream, **options: int) -> LevelPairs:
    by = by_pixel(events.x, events.y, events.times_ns, events.p, SHAPE)
    usable = np.ones(LEVELS.shape, np.bool_)
    return level_pairs(by, FRAMES_NS, shown(usable), **{"longest_gap_ns": 20 * MS, "off_over_on": 4 / 3, **options})


def blocks_of(pairs: LevelPairs) -> NormalBlocks:
    """Halves of the image, five frames at a time, each with outlier weights of its own."""
    times_s = FRAMES_NS[pairs.earlier] * 1e-9
    return blocks_at(
        pairs, np.diff(pairs.ends_of(LEVELS), axis=0)[0], (pairs.pixels % SHAPE[1]) // (SHAPE[1] // 2), times_s, 0.1
    )


def blocks_at(
    pairs: LevelPairs, y: np.ndarray, halves: np.ndarray, times_s: np.ndarray, window_s: float
) -> NormalBlocks:
    windows = (times_s / window_s).astype(int)
    return concatenate([
        accumulate(pairs.take(windows == w), y[windows == w], halves[windows == w], 2, times_s[windows == w])
        for w in np.unique(windows)
    ])  # fmt: skip


def fit(events: Stream) -> ResponseFit:
    found = fit_response(blocks_of(pairs_of(events)))
    assert found is not None
    return found


def test_steady_ramp_is_read_exactly() -> None:
    """A level that rises by 0.2 every 5 ms is known at frame times to a fraction of the threshold."""
    times_ns = np.arange(3, 100, 5) * MS
    count = len(times_ns)
    zeros = np.zeros(count, np.uint16)
    events = by_pixel(zeros, zeros, times_ns, np.ones(count, np.uint8), (1, 1))
    pairs = level_pairs(events, np.arange(0, 81, 20) * MS, shown(np.ones((5, 1, 1), np.bool_)), longest_gap_ns=20 * MS)
    assert pairs.earlier.tolist() == [1, 2, 3]
    assert np.allclose(pairs.regressors, [[4.0, 0.0, 0.0, 0.0]] * 3, atol=1e-9)
    assert np.allclose(pairs.gaps_s, 0.005)


def test_thresholds_and_delay_are_recovered(events: Stream) -> None:
    """C+ = 0.15 and C- = 0.2 come out apart to 1%, and events are not late by more than 0.1 ms."""
    found = fit(events)
    assert found.threshold_on == pytest.approx(0.15, rel=0.01)
    assert found.threshold_off == pytest.approx(0.2, rel=0.01)
    assert abs(found.delay_s) < 100e-6
    assert found.relative_sigma < 0.06


@pytest.mark.parametrize("late_us", [-1000, -300, 300, 1000])
def test_delay_is_read_off_the_slope(events: Stream, late_us: int) -> None:
    """Events stamped late by 0.3 to 1 ms shift the delay by as much, to 5% and 20 us."""
    shift_s = fit(events.shifted(late_us * 1000)).delay_s - fit(events).delay_s
    assert shift_s == pytest.approx(late_us * 1e-6, rel=0.05, abs=20e-6)


def test_clock_rate_is_the_growth_of_the_delay(events: Stream) -> None:
    """A clock that runs 2000 ppm fast is read to 10%, and does not spoil the thresholds."""
    fast = Stream(events.x, events.y, np.rint(events.times_ns * 1.002).astype(np.int64), events.p)
    found = fit(fast)
    assert found.delay_rate == pytest.approx(0.002, rel=0.1)
    assert found.threshold_on == pytest.approx(0.15, rel=0.01)


def test_events_too_close_break_the_chain(events: Stream) -> None:
    """With a dead time longer than every gap no pair is left; with none, all are."""
    assert len(pairs_of(events, least_gap_ns=1_000 * MS)) == 0
    assert 0 < len(pairs_of(events, least_gap_ns=12 * MS)) < len(pairs_of(events))


def test_straight_lines_lie_near_cubics(events: Stream) -> None:
    """Both readings of a level differ by less than a quarter of a threshold, and by something."""
    straightened = pairs_of(events).straightened
    assert np.abs(straightened).max() < 0.5  # of two samples
    assert 0.01 < np.std(straightened) < 0.1


def test_pixels_that_tell_nothing_give_no_sample(events: Stream) -> None:
    """Pixels that are dark in either image, of which nothing is known, or that are hidden, never appear."""
    usable = np.ones(LEVELS.shape, np.bool_)
    usable[:, :, ::2] = False
    seen, everywhere = shown(usable), shown(np.ones_like(usable))
    unknown = everywhere._replace(error=np.where(usable, 0, np.inf).astype(np.float32))
    hidden = np.flatnonzero(~usable[0]).tolist()
    exchanged = seen._replace(light=seen.other_light, other_light=seen.light)
    by = by_pixel(events.x, events.y, events.times_ns, events.p, SHAPE)
    found = [
        level_pairs(by, FRAMES_NS, one, longest_gap_ns=20 * MS)
        for one in (seen, exchanged, unknown, shown(np.ones_like(usable), hidden))
    ]
    assert len(found[0]) > 100
    for pairs in found:
        assert np.all(pairs.pixels % SHAPE[1] % 2 == 1)
        assert np.array_equal(pairs.regressors, found[0].regressors)


def test_tightest_keeps_the_shortest_gaps(events: Stream) -> None:
    """At least as many as wanted, none longer than one that was left out."""
    pairs = pairs_of(events)
    tight = pairs.tightest(200)
    assert 200 <= len(tight) < len(pairs)
    assert tight.gaps_s.max() <= np.sort(pairs.gaps_s)[len(tight)]
    assert len(pairs.tightest(10**9)) == len(pairs)


def test_sureness_falls_where_readings_part(events: Stream) -> None:
    """Pairs of two readings alike weigh 1; a pair whose level is read otherwise by the knee, 1/4."""
    pairs = pairs_of(events)
    pairs = replace(pairs, straightened=np.zeros_like(pairs.straightened))
    otherwise = LEVELS.copy()
    otherwise[pairs.later[0]].flat[pairs.pixels[0]] += 0.2 * DISAGREEMENT_KNEE
    weights = precision_weights(pairs, pairs.ends_of(LEVELS), pairs.ends_of(otherwise), 0.2)
    assert weights[0] == pytest.approx(0.25)
    elsewhere = pairs.pixels != pairs.pixels[0]
    assert np.all(weights[elsewhere] == 1.0)


def test_sureness_falls_where_straight_lines_part_from_cubics(events: Stream) -> None:
    """With frames read alike, the weight is that of the distance between both readings of the events."""
    pairs = pairs_of(events)
    weights = precision_weights(pairs, pairs.ends_of(LEVELS), pairs.ends_of(LEVELS), 0.2)
    apart = np.abs(pairs.straightened).sum(axis=1) / DISAGREEMENT_KNEE
    assert np.allclose(weights, 1 / (1 + apart**2) ** 2)
    assert weights.max() > 0.9
    assert weights.min() < 0.1


def test_unsure_pairs_do_not_move_the_fit(events: Stream) -> None:
    """Half of the changes read at three quarters of their size spoil a plain fit by 5% and more, a sure one by 1%."""
    pairs = pairs_of(events)
    change = np.diff(pairs.ends_of(LEVELS), axis=0)[0]
    spoilt = np.random.default_rng(0).uniform(size=len(pairs)) < 0.5
    change[spoilt] *= 0.75
    block, times_s = np.arange(len(pairs)) % 4, np.zeros(len(pairs))
    plain = fit_response(accumulate(pairs, change, block, 4, times_s))
    sure = fit_response(accumulate(pairs, change, block, 4, times_s, np.where(spoilt, 1e-4, 1.0)))
    assert plain is not None
    assert sure is not None
    assert plain.threshold_on < 0.95 * 0.15
    assert sure.threshold_on == pytest.approx(0.15, rel=0.01)
    assert sure.threshold_off == pytest.approx(0.2, rel=0.01)


def test_weights_are_precisions(events: Stream) -> None:
    """Where each pair errs as its weight states, none is an outlier: the sums have nearly the given weights."""
    pairs, rng = pairs_of(events), np.random.default_rng(0)
    block = np.arange(len(pairs)) % 2
    weights = np.where(block, 1.0, 0.04)
    change = pairs.regressors @ np.array([0.15, 0.2, 0.0, 0.0]) + 0.01 * rng.normal(size=len(pairs)) / np.sqrt(weights)
    for number, matrix in enumerate(accumulate(pairs, change, block, 2, np.zeros(len(pairs)), weights).matrices):
        rows, given_weights = pairs.regressors[block == number], weights[block == number]
        assert np.all(np.diag(matrix) > 0.9 * np.einsum("n,ni,ni->i", given_weights, rows, rows))


def test_blocks_sum_to_the_whole(events: Stream) -> None:
    """The fit of blocks that were concatenated in two lists is that of all of them."""
    pairs = pairs_of(events)
    blocks = blocks_of(pairs)
    halves = [NormalBlocks(*(getattr(blocks, name)[part] for name in NormalBlocks.__slots__))
              for part in (slice(0, 4), slice(4, None))]  # fmt: skip
    assert fit_response(concatenate(halves)) == fit_response(concatenate([blocks]))


def test_too_little_is_no_fit(events: Stream) -> None:
    """A handful of pairs, or one polarity only, gives no fit."""
    pairs = pairs_of(events)
    assert fit_response(blocks_of(pairs.take(np.arange(len(pairs)) < 30))) is None
    rising = pairs.take(np.all(pairs.regressors[:, [1, 3]] == 0, axis=1))
    assert fit_response(blocks_of(rising)) is None


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_standard_errors_are_honest(seed: int) -> None:
    """With independent noise of known size all four estimates lie within six standard errors of the truth."""
    rng = np.random.default_rng(seed)
    X = np.concatenate([rng.normal(0, 1, (4000, 2)), rng.normal(0, 50, (4000, 2))], axis=1)
    times_s = rng.uniform(0, 2, 4000)
    delay_s = 1e-3 + 2e-3 * (times_s - 1)
    y = X @ [0.2, 0.25, 0, 0] + delay_s * (X[:, 2:] @ [0.2, 0.25]) + rng.normal(0, 0.01, 4000)
    pixels = np.zeros(4000, np.int32)
    pairs = LevelPairs(pixels, pixels, pixels, X, np.ones(4000), np.zeros((4000, 2)))
    found = fit_response(blocks_at(pairs, y, rng.integers(0, 2, 4000), times_s, 0.1))
    assert found is not None
    errors = found.standard_errors
    assert abs(found.threshold_on - 0.2) < 6 * errors.threshold_on
    assert abs(found.threshold_off - 0.25) < 6 * errors.threshold_off
    assert abs(found.delay_s - 1e-3 - 2e-3 * (found.middle_s - 1)) < 6 * errors.delay_s
    assert abs(found.delay_rate - 2e-3) < 6 * errors.delay_rate
    assert errors.threshold_on < 0.001
