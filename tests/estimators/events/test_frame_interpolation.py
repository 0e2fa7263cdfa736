"""Frames read at events, on a closed-form world whose levels are known without error at any time."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fedora_qa.estimators.events.frame_interpolation import (
    COLUMNS,
    CORNER,
    FINE,
    FrameStack,
    InterpolatedLevels,
    InterpolationMethod,
    _rounded_up,
    divide,
    interpolate_at_events,
    interpolate_frames,
    interpolation_blocks,
    interpolation_weights,
    inverse_distances,
    polynomial,
)
from fedora_qa.estimators.events.pixels import PixelEvents, by_pixel
from fedora_qa.estimators.events.threshold_fit import ResponseFit, _effective_parts, concatenate, fit_interpolation
from tests.estimators.event_world import MS, Stream, Waves, linear_events, log_events

SHAPE = (24, 30)
STOP_NS = 400 * MS
FRAMES_NS = np.arange(0, 401, 20) * MS
SLOW = Waves(amplitude_dn=9.0, mean_dn=120.0, velocity_px_s=(45.0, 20.0), seed=4)


@cache
def events_of(model: str) -> Stream:
    return log_events(SLOW, SHAPE, STOP_NS) if model == "log" else linear_events(SLOW, SHAPE, STOP_NS, threshold=5.0)


@cache
def luma() -> np.ndarray:
    return np.array([SLOW.luma(time_ns * 1e-9, SHAPE) for time_ns in FRAMES_NS])


def sorted_events(events: Stream, shape: tuple[int, int] = SHAPE) -> PixelEvents:
    return by_pixel(events.x, events.y, events.times_ns, events.p, shape)


def readings(model: str, events: Stream, **options: float) -> InterpolatedLevels:
    levels = np.log(luma()) if model == "log" else luma()
    found = interpolate_frames(
        sorted_events(events), FRAMES_NS, levels, threshold=0.2 if model == "log" else 5.0, **options
    )
    assert found is not None
    return found


def fit(found: InterpolatedLevels, method: InterpolationMethod = "fine") -> ResponseFit:
    tiles = (found.pixels % SHAPE[1] >= 15) + 2 * (found.pixels // SHAPE[1] >= 12)
    fitted = fit_interpolation(
        concatenate([interpolation_blocks(found, interpolation_weights(found), tiles, 4, method=method)])
    )
    assert fitted is not None
    return fitted


@pytest.mark.parametrize("late_ms", [-2.0, 0.0, 0.2, 2.0])
def test_log_events_tell_delay_and_thresholds(late_ms: float) -> None:
    """Both thresholds come within 1%, the delay within 0.01 ms and 2%."""
    fitted = fit(readings("log", events_of("log").shifted(round(late_ms * MS))))
    assert fitted.threshold_on == pytest.approx(0.2, rel=0.01)
    assert fitted.threshold_off == pytest.approx(0.2, rel=0.01)
    assert 1e3 * fitted.delay_s == pytest.approx(late_ms, abs=0.01 + 0.02 * abs(late_ms))


@pytest.mark.parametrize("late_ms", [0.0, 1.0])
def test_whole_values_are_unrounded(late_ms: float) -> None:
    """A sensor of whole values steps by C + 1/2 and is not late, once what a step goes beyond that is taken off."""
    late = events_of("linear").shifted(round(late_ms * MS))
    fitted = fit(readings("linear", late, tick_s=1e-3))
    assert fitted.threshold_on == pytest.approx(5.5, rel=0.015)
    assert 1e3 * fitted.delay_s == pytest.approx(late_ms, abs=0.03 + 0.03 * late_ms)
    assert abs(fit(readings("linear", late)).threshold_on / 5.5 - 1) > 0.05


def test_the_last_event_before_a_turn_is_counted_and_not_read() -> None:
    """Of a linear sensor those are read whose pixel goes on in their direction; of a log sensor all.

    In any case a pixel that is read once tells nothing.
    """
    x, y = np.zeros(6, np.uint16), np.array([0, 1, 0, 0, 0, 0], np.uint16)
    p = np.array([1, 0, 1, 0, 0, 0], np.uint8)
    times_ns = np.array([50, 55, 60, 70, 80, 90]) * MS
    levels = np.full((8, 2, 1), 100.0)
    events = by_pixel(x, y, times_ns, p, (2, 1))
    linear = interpolate_frames(events, FRAMES_NS[:8], levels, threshold=3.0, tick_s=1e-3)
    log = interpolate_frames(events, FRAMES_NS[:8], levels, threshold=3.0)
    assert linear is not None
    assert log is not None
    assert linear.times_s == pytest.approx([0.05, 0.07, 0.08])
    assert linear.regressors[:, 0] == pytest.approx(np.array([1, 2, 2]) - 5 / 3)
    assert log.times_s == pytest.approx([0.05, 0.06, 0.07, 0.08, 0.09])


def test_crests_between_frames_make_no_event_early() -> None:
    """Where light turns between frames and hardly passes its threshold, the other events tell the delay."""
    world = Waves(amplitude_dn=9.0, mean_dn=120.0, velocity_px_s=(200.0, 20.0), seed=4)
    events = linear_events(world, SHAPE, STOP_NS, threshold=15.0)
    frames = np.array([world.luma(time_ns * 1e-9, SHAPE) for time_ns in FRAMES_NS])
    found = interpolate_frames(sorted_events(events), FRAMES_NS, frames, threshold=15.0, tick_s=1e-3)
    assert found is not None
    fitted = fit(found)
    assert fitted.standard_errors.delay_s < 1e-4
    assert abs(fitted.delay_s) < 4 * fitted.standard_errors.delay_s


def test_what_frames_tell_wrongly_at_edges_is_no_delay() -> None:
    """Levels that are off by 1 ms of their slope's size, as at the ends of edges, move the delay by nothing."""
    found = readings("log", events_of("log"))
    wrong = replace(found, levels=found.levels - 1e-3 * found.regressors[:, 3])
    plain, fitted = fit(found), fit(wrong)
    assert fitted.delay_s == pytest.approx(plain.delay_s, abs=1e-5)
    assert fitted.kappa_s == pytest.approx(plain.kappa_s - 1e-3, abs=1e-5)


def test_edges_of_one_kind_hardly_tell_a_delay() -> None:
    """Where light rises at one pixel of a hundred, the delay is told by far less than where it rises at every other."""
    falling, both = (fit(_edges(share)).standard_errors.delay_s for share in (0.01, 0.5))
    assert falling > 3 * both


def _edges(share_that_rises: float) -> InterpolatedLevels:
    """Eight readings each of 720 pixels, through which an edge passes."""
    rng = np.random.default_rng(3)
    pixels, count = np.repeat(np.arange(720), 8), 720 * 8
    signs = np.where(np.repeat(rng.random(720) < share_that_rises, 8), 1.0, -1.0)
    slopes = signs * rng.uniform(2, 12, count)
    events = np.tile(np.arange(8) - 3.5, 720)
    levels = 0.2 * signs * events + 0.01 * rng.normal(size=count)
    columns = np.where(signs > 0, events, 0.0), np.where(signs < 0, -events, 0.0), slopes, np.abs(slopes)
    columns = *columns[:2], *(each - np.repeat(each.reshape(-1, 8).mean(axis=1), 8) for each in columns[2:])
    ones = np.ones(count)
    return InterpolatedLevels(
        pixels, np.linspace(0, 0.4, count), np.column_stack(columns), levels, levels, levels, ones
    )


def test_corners_are_told_by_the_parabolas_on_both_sides() -> None:
    """The distance of two parabolas, by NumPy's polynomials through three frames each, at uneven times."""
    rng = np.random.default_rng(5)
    frames_ns = np.sort(rng.integers(0, 200 * MS, 8))
    levels, shares = rng.normal(size=(8, 2, 3)), np.array([0.3, 0.5, 0.5, 0.7])
    pixels, before, firsts = np.array([0, 4, 5, 2]), np.array([0, 2, 4, 6]), [0, 1, 3, 4]
    times_ns = frames_ns[before] + (shares * (frames_ns[before + 1] - frames_ns[before])).astype(np.int64)
    rows, columns = (each.astype(np.uint16).repeat(2) for each in np.divmod(pixels, 3))
    events = by_pixel(columns, rows, times_ns.repeat(2), np.ones(8, np.uint8), (2, 3))
    found, of, everywhere = np.empty((8, COLUMNS)), np.empty(8, np.int64), np.ones(levels.shape, np.bool_)
    seconds = (frames_ns - frames_ns[0]) * 1e-9
    frames = FrameStack(frames_ns, seconds, inverse_distances(seconds), levels, levels, everywhere, np.nan)
    assert interpolate_at_events(events.starts, events.timestamped, frames, 1, 0.0, of, found) == 8
    for pixel, time_ns, first in zip(pixels, times_ns, firsts, strict=True):
        curve, time = levels[:, pixel // 3, pixel % 3], (time_ns - frames_ns[0]) * 1e-9
        ends = (slice(first, first + 3), slice(first + 1, first + 4))
        one, other = (np.polynomial.Polynomial.fit(seconds[each], curve[each], 2)(time) for each in ends)
        assert np.abs(found[of == pixel, CORNER]) == pytest.approx(abs(other - one), rel=1e-6)


def test_cells_that_hold_nearly_all_are_few() -> None:
    """Three of sixteen cells with nearly all information count as three, whatever the others hold."""
    cells = np.tile(np.eye(3), (16, 1, 1))
    cells[3:] *= 1e-3
    assert _effective_parts(cells.sum(axis=0), cells) == pytest.approx([3.0] * 3, rel=0.01)
    even = np.tile(np.eye(3), (16, 1, 1))
    assert _effective_parts(even.sum(axis=0), even) == pytest.approx([16.0] * 3)


def test_leak_is_not_light() -> None:
    """Brighter events of a declared leak change no threshold."""
    leaking = log_events(Waves(**{**_fields(SLOW), "leak_nat_s": 0.2 * 1.5}), SHAPE, STOP_NS)
    assert fit(readings("log", leaking, leak_rate_hz=1.5)).threshold_off == pytest.approx(0.2, rel=0.01)
    assert abs(fit(readings("log", leaking)).threshold_off / 0.2 - 1) > 0.02


def _fields(world: Waves) -> dict[str, object]:
    return {name: getattr(world, name) for name in world.__dataclass_fields__}


def test_polynomial_is_that_through_the_points() -> None:
    """Value and slope agree with those of NumPy's polynomial at uneven times."""
    rng = np.random.default_rng(2)
    seconds, levels = np.sort(rng.uniform(0, 0.1, 6)), rng.normal(size=6)
    curve = np.polynomial.Polynomial.fit(seconds, levels, 5)
    divided = np.empty((FINE, FINE))
    divide(levels, 0, inverse_distances(seconds)[0], divided)
    due = curve(0.04), curve.deriv()(0.04)
    assert polynomial(divided, 0, seconds, 0, FINE, 0.04) == pytest.approx(due, rel=1e-6)
    inner = np.polynomial.Polynomial.fit(seconds[1:5], levels[1:5], 3)
    assert polynomial(divided, 1, seconds, 1, 4, 0.04)[0] == pytest.approx(inner(0.04), rel=1e-6)


@pytest.mark.parametrize("step", [0.0, 0.3, 1.0, 1.7, 25.4])
def test_rounding_beyond_a_half(step: float) -> None:
    """The mean of rint(v) - v over v = 1/2 + U step, by brute force."""
    values = 0.5 + step * (np.arange(200_000) + 0.5) / 200_000
    rounded = np.floor(values + 0.5) - values
    assert _rounded_up(step) == pytest.approx(float(rounded.mean()), abs=1e-4)


def test_too_few_frames_read_nothing() -> None:
    """Fewer than six frames hold no polynomial of six."""
    events = events_of("log")
    assert interpolate_frames(sorted_events(events), FRAMES_NS[:5], np.log(luma()[:5]), threshold=0.2) is None


def test_unusable_levels_are_not_read() -> None:
    """A pixel that is NaN in a frame gives no reading that needs it; without any usable pixel there are none."""
    levels = np.log(luma())
    levels[7, 3, 4] = np.nan
    events = events_of("log")
    found = interpolate_frames(sorted_events(events), FRAMES_NS, levels, threshold=0.2)
    assert found is not None
    assert np.isfinite(found.levels).all()
    of_pixel = found.times_s[found.pixels == 3 * SHAPE[1] + 4]
    assert not np.any((of_pixel > 0.12) & (of_pixel < 0.16))
    nothing = interpolate_frames(sorted_events(events), FRAMES_NS, np.full_like(levels, np.nan), threshold=0.2)
    assert nothing is not None
    assert len(nothing) == 0
