"""Jitter of timestamps from quadruples of events: a closed form of light, and noise of known spread."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import norm

from fedora_qa.estimators.events.pixels import PixelEvents, by_pixel
from fedora_qa.estimators.events.time_jitter import (
    _OVERLAP,
    BLEND_OF_SIGNAL,
    DEVIATES,
    FEWEST_PIXELS,
    MOST_OF_A_PIXEL,
    QUARTILE,
    RANDOM_SHARE,
    SHAPE_SHARE,
    Blend,
    JitterEstimate,
    _deviations,
    _errors,
    chance_of_line,
    estimate_jitter,
    event_quadruples,
    step_polynomial,
    straight_runs,
)

Floats = NDArray[np.float64]

LONGEST_S = 0.03
NOTHING = np.zeros(0, np.int64)


def estimate(times_s: Floats, threshold: float = 0.0, tick_s: float = 1e-6) -> JitterEstimate | None:
    """The estimate from quadruples (n, 4) of as many pixels, in sixteen parts."""
    times_s = np.sort(times_s, axis=1)
    durations_s, middles_s = times_s[:, 3] - times_s[:, 0], times_s[:, 2] - times_s[:, 1]
    short = durations_s <= LONGEST_S
    pixels = np.arange(len(times_s))[short]
    return estimate_jitter(
        durations_s[short], middles_s[short], pixels, pixels[:, np.newaxis] % 16,
        c=step_polynomial(threshold), tick_s=tick_s, longest_s=LONGEST_S,
    )  # fmt: skip


def ramps(count: int, threshold: float, rng: np.random.Generator) -> Floats:
    """Times (count, 4), s, at which light that changes linearly gives events: rising and falling, 17 to 27 ms long."""
    signs = rng.choice([-1.0, 1.0], count)[:, np.newaxis]
    steps = np.exp(signs * threshold * np.arange(4)) if threshold else np.arange(4.0) + np.zeros((count, 1))
    times = np.abs(steps - steps[:, :1])
    return np.asarray(times / times[:, 3:] * rng.uniform(0.017, 0.027, (count, 1)) + rng.uniform(0, 1, (count, 1)))


def times_of_edge(levels: Floats, kind: str, angle: float) -> Floats:
    """Times at which an edge of unit speed and width has covered shares (n,) of a pixel."""
    if kind == "gauss":
        return np.asarray(ndtri(levels))
    if kind == "sine":
        return np.asarray(np.arcsin(2 * levels - 1))
    # A straight edge covers a square by the integral of a trapezoid: of the sum of two uniform variables.
    long, short = sorted((abs(np.cos(angle)), abs(np.sin(angle))), reverse=True)
    half = (long + short) / 2
    places = np.linspace(-half, half, 4001)
    widths = np.clip(half - np.abs(places), 0, short)
    covered = np.concatenate([[0.0], np.cumsum(widths[1:] + widths[:-1])])
    return np.interp(levels, covered / covered[-1], places)


@pytest.mark.parametrize("threshold", [0.05, 0.1, 0.2, 0.3, 0.5, 0.0])
@pytest.mark.parametrize("kind", ["straight", "gauss", "sine"])
def test_shape_of_light_stays_within_its_bound(kind: str, threshold: float) -> None:
    """Edges of 3 to 12 events, of all directions: the lower quartile of w / T lies above minus ``SHAPE_SHARE``."""
    rng, c, shares = np.random.default_rng(1), step_polynomial(threshold), []
    for _ in range(1500):
        step = threshold or 1.0
        contrast = step * rng.uniform(3, min(12, 3.5 / threshold) if threshold else 12)
        levels = np.arange(rng.random() * step, contrast, step)
        levels = levels if rng.random() < 0.5 else contrast - levels
        covered = np.expm1(levels) / np.expm1(contrast) if threshold else levels / contrast
        covered = covered[(covered > 0) & (covered < 1)]
        t = np.sort(times_of_edge(covered, kind, rng.uniform(0, np.pi / 2)))
        durations = t[3:] - t[:-3]
        shares.extend((durations - (c + 1) * (t[2:-1] - t[1:-2])) / durations)
    assert np.quantile(shares, QUARTILE) > -SHAPE_SHARE
    if kind == "straight":
        assert np.quantile(np.abs(shares), QUARTILE) < 0.01


@given(st.floats(0.01, 0.8), st.booleans(), st.floats(1e-4, 1.0))
def test_linear_light_has_no_third_difference(threshold: float, rising: bool, scale_s: float) -> None:
    """Of times that grow by exp(C) or exp(-C)."""
    t = scale_s * np.exp((1 if rising else -1) * threshold * np.arange(4))
    w = t[3] - t[0] - (step_polynomial(threshold) + 1) * (t[2] - t[1])
    assert abs(w) < 1e-12 * np.abs(t).max()


def test_constants_are_those_of_their_distributions() -> None:
    """Quartiles of the normal distribution, and of times at random."""
    assert pytest.approx((norm.ppf(0.75), norm.ppf(0.625))) == DEVIATES
    middles = np.sort(np.random.default_rng(1).random((400_000, 2)), axis=1)
    quartile = np.quantile(np.abs(1 - 3 * (middles[:, 1] - middles[:, 0])), QUARTILE)
    assert quartile == pytest.approx(RANDOM_SHARE, rel=0.03)


@pytest.mark.parametrize("threshold", [0.0, 0.2])
def test_without_jitter_the_estimate_is_that_of_rounding(threshold: float) -> None:
    times_s = np.round(ramps(2000, threshold, np.random.default_rng(2)), 6)
    found = estimate(times_s, threshold)
    assert found is not None
    assert found.sigma_s < 1e-6
    assert not found.saturated


@pytest.mark.parametrize("threshold", [0.0, 0.2])
@pytest.mark.parametrize("kind", ["normal", "uniform"])
@pytest.mark.parametrize("sigma_ms", [0.1, 0.5, 1.0, 2.0])
def test_jitter_is_estimated(sigma_ms: float, kind: str, threshold: float) -> None:
    """Within five standard errors and a tenth, by which the smaller of two estimates is too small."""
    rng = np.random.default_rng(3)
    times_s = ramps(4000, threshold, rng)
    spread = rng.normal(size=times_s.shape) if kind == "normal" else rng.uniform(-np.sqrt(3), np.sqrt(3), times_s.shape)
    found = estimate(times_s + 1e-3 * sigma_ms * spread, threshold)
    assert found is not None
    assert abs(1e3 * found.sigma_s - sigma_ms) < 5e3 * found.standard_error_s + 0.1 * sigma_ms
    assert 0.02 < found.standard_error_s / found.sigma_s < 0.12


def test_errors_have_unit_spread() -> None:
    """Over many draws estimates scatter by their standard error, which is the largest of two: by 0.6 to 1.1 of it."""
    rng, scores = np.random.default_rng(4), []
    for _ in range(60):
        times_s = ramps(1000, 0.2, rng)
        found = estimate(times_s + 5e-4 * rng.normal(size=times_s.shape), 0.2)
        assert found is not None
        scores.append((found.sigma_s - 5e-4) / found.standard_error_s)
    assert 0.6 < np.std(scores) < 1.1
    assert -0.8 < np.mean(scores) < 0.2


@settings(max_examples=20)
@given(st.sampled_from([1e-4, 2e-4, 1e-3]), st.integers(0, 100))
def test_ticks_stay_within_their_bound(tick_s: float, seed: int) -> None:
    """Stamps on a grid, each the first tick not before the event."""
    found = estimate(np.ceil(ramps(1500, 0.2, np.random.default_rng(seed)) / tick_s) * tick_s, 0.2, tick_s)
    assert found is not None
    assert found.sigma_s < found.bound_s + 2 * found.standard_error_s
    assert found.bound_s > tick_s / np.sqrt(12)


def test_jitter_above_all_intervals_gives_a_lower_bound() -> None:
    """Edges that pass in a millisecond with a jitter of 5 ms: not regular at any duration, but not below the bound."""
    rng = np.random.default_rng(5)
    found = estimate(0.05 * ramps(4000, 0.2, rng) + 5e-3 * rng.normal(size=(4000, 4)), 0.2)
    assert found is not None
    assert found.saturated
    assert found.bound_s + 5 * found.standard_error_s < found.sigma_s < 5e-3


@pytest.mark.parametrize("sigma_s", [1e-3, 2e-3])
def test_longer_durations_show_the_jitter_that_short_ones_limit(sigma_s: float) -> None:
    """Edges that pass in a millisecond limit what they show; beside them, slow edges show all of it."""
    rng = np.random.default_rng(11)
    times_s = np.concatenate([0.05 * ramps(2000, 0.2, rng), ramps(2000, 0.2, rng)])
    found = estimate(times_s + sigma_s * rng.normal(size=times_s.shape), 0.2)
    assert found is not None
    assert found.duration_s > 0.015
    assert not found.saturated
    assert found.sigma_s == pytest.approx(sigma_s, abs=5 * found.standard_error_s)


def test_short_regular_durations_need_no_longer_ones() -> None:
    """Fast edges without jitter show that there is none, whatever slow events at random times are like."""
    rng = np.random.default_rng(12)
    chance = np.sort(rng.uniform(0, 0.025, (4000, 4)), axis=1)
    found = estimate(np.concatenate([0.1 * ramps(2000, 0.2, rng), chance]), 0.2)
    assert found is not None
    assert found.sigma_s < 1e-6


def test_edges_in_succession_are_no_jitter() -> None:
    """Of two pairs of events with a gap between, half of the quadruples: the lower quartile of |w| is of the others."""
    rng = np.random.default_rng(6)
    times_s = ramps(3000, 0.2, rng)
    times_s[::2, 1] = times_s[::2, 0] + 1e-4
    times_s[::2, 2] = times_s[::2, 3] - 1e-4
    found = estimate(times_s, 0.2)
    assert found is not None
    assert found.sigma_s < found.bound_s


def test_coarse_ticks_give_no_estimate() -> None:
    """Edges that pass within eight ticks: rounding orders their times, and is no noise."""
    assert estimate(np.ceil(ramps(2000, 0.2, np.random.default_rng(9)) / 4e-3) * 4e-3, 0.2, 4e-3) is None


def test_few_pixels_give_no_estimate() -> None:
    few = ramps(FEWEST_PIXELS - 1, 0.2, np.random.default_rng(7))
    assert estimate(few, 0.2) is None
    assert estimate(few[:0], 0.2) is None


def test_quadruples_are_those_of_a_slow_loop() -> None:
    """Successive events of one pixel and one polarity, four of a pixel at most, without excluded pixels."""
    rng, count, (height, width) = np.random.default_rng(8), 4000, (5, 6)
    times_ns = np.sort(rng.integers(0, 200_000_000, count))
    x, y = rng.integers(0, width, count).astype(np.uint16), rng.integers(0, height, count).astype(np.uint16)
    p = rng.integers(0, 2, count).astype(np.uint8)
    start_ns, stop_ns, longest_ns, excluded = 20_000_000, 150_000_000, 10_000_000, np.array([3, 17])
    expected = []
    for pixel in range(height * width):
        rows = np.flatnonzero(y.astype(int) * width + x == pixel)
        of_pixel = []
        for i in range(len(rows) - 3):
            t = times_ns[rows[i : i + 4]]
            if len(set(p[rows[i : i + 4]])) == 1 and start_ns <= t[0] < stop_ns and t[3] - t[0] <= longest_ns:
                of_pixel.append((t[3] - t[0], t[2] - t[1], pixel))
        expected += [] if pixel in excluded else of_pixel[:MOST_OF_A_PIXEL]
    events = by_pixel(x, y, times_ns, p, (height, width))
    found = event_quadruples(events, start_ns, stop_ns, longest_ns, excluded, 10_000)
    assert expected
    assert list(zip(*(column.tolist() for column in found), strict=True)) == expected
    # With a limit whole pixels are left out, about in proportion.
    sampled = event_quadruples(events, start_ns, stop_ns, longest_ns, NOTHING, len(expected) // 3)
    assert 0 < len(set(sampled.pixels.tolist())) < height * width


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
    assert straight_runs(events, [INTERVALS], US, 2.0, [BLEND_OF_SIGNAL]).tolist() == [[1, len(times_us), 1]]


@settings(deadline=None)
@given(st.floats(0.002, 0.5))
def test_a_curved_signal_does_not(curvature: float) -> None:
    """L = 1.5 (s + c s (1 - s)) over the interval, from s = 0 to 1, bends the line by c / 4 of its change."""
    shares = np.linspace(0, 1, 200_001)
    signal = 1.5 * (shares + curvature * shares * (1 - shares))
    times_us = np.ceil(20_000 * np.interp(0.2 * np.arange(1, 8), signal, shares)).astype(np.int64)
    events = events_of([int(t) * US for t in times_us], [1] * 7)
    assert straight_runs(events, [INTERVALS], US, 2.0, [BLEND_OF_SIGNAL]).tolist() == [[1, 7, 0]]


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
    assert straight_runs(events, [INTERVALS], US, 2.0, [BLEND_OF_SIGNAL]).tolist() == [[1, 3, 0]]


def test_two_events_and_dense_events_are_no_run() -> None:
    """Two lie on any line; spacings of less than ten ticks are lines by chance."""
    pair = events_of([5_000 * US, 10_000 * US], [1, 1])
    assert straight_runs(pair, [INTERVALS], US, 2.0, [BLEND_OF_SIGNAL]).tolist() == [[0, 0, 0]]
    coarse = events_of([5_000 * US, 10_000 * US, 15_000 * US], [1, 1, 1])
    assert straight_runs(coarse, [INTERVALS], 1_000 * US, 2.0, [BLEND_OF_SIGNAL]).tolist() == [[0, 0, 0]]


def blended_us(exponent: float, ratio: float, threshold: float, renders: int) -> NDArray[np.int64]:
    """Crossings in 20 ms, us, while f = light^exponent goes straight to ``ratio`` times the light, by renders."""
    times = np.linspace(0, 1, renders + 1)
    signal = np.log(1 + (ratio**exponent - 1) * times) / exponent
    levels = np.sign(signal[-1]) * threshold * np.arange(1, 1 + int(abs(signal[-1]) / threshold))
    order = np.argsort(signal)
    crossings_ms = 20 * np.interp(levels, signal[order], times[order])
    return np.ceil(1_000 * crossings_ms - 1e-6).astype(np.int64)


@pytest.mark.parametrize("renders", [10, 50, 2_000])
@pytest.mark.parametrize("ratio", [0.1, 0.4, 2.5, 6.0])
@pytest.mark.parametrize("exponent", [1 / 2.4, 1 / 2.2, 1.0])
def test_a_blend_is_straight_in_its_own_domain(exponent: float, ratio: float, renders: int) -> None:
    """In steps with straight lines of the signal between them, brighter and darker; never straight in the signal."""
    times_us = blended_us(exponent, ratio, 0.2, renders)
    events = events_of([int(t) * US for t in times_us], [int(ratio > 1)] * len(times_us))
    blend = Blend((-0.2 * exponent, 0.2 * exponent), 0.0, 10)
    assert straight_runs(events, [INTERVALS], US, 2.0, [BLEND_OF_SIGNAL, blend]).tolist() == [[1, len(times_us), 0, 1]]


@pytest.mark.parametrize("share", [0.0, 0.02])
def test_another_domain_is_no_line(share: float) -> None:
    """Light that is blended is no line of code values, nor of thresholds that are twice as large."""
    times_us = blended_us(1.0, 6.0, 0.2, 50)
    events = events_of([int(t) * US for t in times_us], [1] * len(times_us))
    blends = [Blend((-0.2 * g, 0.2 * g), share, 10) for g in (1.0, 1 / 2.4, 2.0)]
    assert straight_runs(events, [INTERVALS], US, 2.0, blends)[0, 2:].tolist() == [1, 0, 0]


@pytest.mark.parametrize(("error_us", "lines"), [(40, 1), (120, 0)])
def test_codes_move_a_crossing_by_a_share_of_the_spacing(error_us: int, lines: int) -> None:
    """2% of spacings of 3 ms are 60 us."""
    times_us = blended_us(1.0, 3.3, 0.2, 2_000)
    times_us[2] += error_us
    events = events_of([int(t) * US for t in times_us], [1] * len(times_us))
    blend = Blend((-0.2, 0.2), 0.02, 2_000)
    assert straight_runs(events, [INTERVALS], US, 2.0, [blend])[0, 2] == lines


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
    assert straight_runs(events, [intervals], 0, 2.0, [BLEND_OF_SIGNAL]).tolist() == [[runs, total, lines]]


def test_chance_is_that_of_random_events() -> None:
    """The middle one of three lies anywhere between the others."""
    rng = np.random.default_rng(1)
    middles = rng.uniform(0, 2 * 5_000, 200_000)
    assert np.mean(np.abs(middles - 5_000) < 50) == pytest.approx(chance_of_line(50, 5_000), rel=0.1)


def test_formal_errors_are_those_of_quartiles() -> None:
    """Over many draws both deviations scatter by the error of a quartile, but for what quadruples share."""
    rng, nothing = np.random.default_rng(0), np.zeros((400, 0), np.intp)
    draws = rng.normal(size=(500, 400))
    scatter = np.std([_deviations(draw, 1e-6) for draw in draws], axis=0)
    stated = np.mean([_errors(draw, nothing, 1e-6) for draw in draws], axis=0)
    assert stated / scatter == pytest.approx(np.sqrt(_OVERLAP), rel=0.1)
