"""Events against log intensity: clock offset."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import MS_PER_S, NS_PER_S
from fedora_qa.estimators.fitting.robust import sensitivity_range
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import why_frames_and_events_do_not_meet
from fedora_qa.views.event_clock_offset import (
    ClockOffset,
    InterpolationSums,
    LocalOffset,
    OffsetSearch,
    expected_delay_ms,
    fit_all,
    interpolation_sums,
    offset_by_interpolation,
    offset_by_levels,
    offset_error_ms,
    region_offset,
    search_is_preferred,
    search_window,
    searched_offset,
    segment_offset,
)
from fedora_qa.views.level_samples import LevelSums, ThresholdFit, fit_thresholds, level_coverage, level_sums
from fedora_qa.views.sensor_events import place_of_segment, place_of_tiles

WINDOWS_SEARCHED: Final = 6

CAPTURE_SHARE: Final = 0.5
"""Share of ``capture_range_s`` above which the offset is searched: one fit then underestimates it by more than a
tenth."""

LOCAL_SIGNIFICANCE: Final = 5.0
"""Least difference of the delay of a part, in standard errors, with which not all events have one offset (after an
alarm only)."""


@dataclass(frozen=True, slots=True)
class DelayCourses(Feature):
    """Probabilities of three courses of the delay over time.

    Attributes
    ----------
    constant
        One offset.
    drift
        A delay that grows with time.
    segment
        The delay of a segment only.
    reaches_end
        Whether the segment reaches the first or the last window with an estimated delay.
    """

    constant: float
    drift: float
    segment: float
    reaches_end: bool


@dataclass(frozen=True, slots=True)
class DelayedSegment(Feature):
    """The segment of time in which events are late, beside others that are not.

    Attributes
    ----------
    offset_ms
        Delay, ms; negative: early.
    error_ms
        Its standard error, ms.
    begin_ns, end_ns
        Ends of the segment, ns from the file's origin; None where it reaches the first or the last delay.
    """

    offset_ms: float
    error_ms: float
    begin_ns: int | None
    end_ns: int | None


@dataclass(frozen=True, slots=True)
class _DelayFit:
    """A segment with a delay of its own, fitted to the delays of the windows.

    Attributes
    ----------
    squares
        Sum of squares of the residuals over their errors.
    free
        Number of free parameters.
    inside
        (k,) windows in which the delay holds.
    edge
        Window of (k,) in which it begins or ends, with a delay between; None for a segment of whole windows.
    offset_s, error_s
        The delay, and its standard error.
    """

    squares: float
    free: int
    inside: NDArray[np.bool_]
    edge: int | None
    offset_s: float
    error_s: float


@dataclass(frozen=True, slots=True)
class OffsetSize(Feature):
    """Reliability of the size of an offset.

    Attributes
    ----------
    error_ms
        Its error, ms, with bounds and the underestimation by one fit.
    of_all_pixels
        Whether no region of the image has a clearly different delay.
    """

    error_ms: float
    of_all_pixels: bool


@dataclass(frozen=True, slots=True)
class TimingSums:
    """Normal equations of a window.

    Attributes
    ----------
    levels
        From bracketed level samples; None for too few.
    interpolation
        From frames interpolated at events; None for too few.
    window
        Number of the window.
    """

    levels: LevelSums | None
    interpolation: InterpolationSums | None
    window: int

    @property
    def samples(self) -> int:
        """Number of pairs of level samples and of interpolated levels, by which windows are chosen for a search."""
        interpolated = 0 if self.interpolation is None else int(self.interpolation.fine.counts.sum())
        return interpolated + (0 if self.levels is None else self.levels.pairs)


TimingSummary = TimingSums | OffsetSearch


class EventResponseTiming(WindowCheck[TimingSummary]):
    """Do events and frames have timestamps of one clock?

    The clock offset of events against the colour frames, in ms (positive: timestamps of events too late), with its
    growth in ppm; and the segment of windows and the rectangle of image tiles whose delay differs most from the rest.

    Why it matters
    --------------
    Models that are trained or fitted assume that events and frames of one timestamp belong to one instant. At 200 px/s
    an offset of 2 ms displaces events by 0.4 px. A network learns this as a bias, and an evaluation attributes it to
    the method.

    How
    ---
    Where light changes slowly between frames, frames are interpolated at events: the polynomial through six frames
    gives the level L of a pixel and its slope L' at the timestamp of each event. Over the pixel's events so far, L = a
    + C+ P - C- M + delta L' + kappa |L'|. Here delta is the delay. kappa is an error of the frames at the ends of
    edges; it has one sign for rising and falling light. Where light changes fast, events are interpolated at frames
    instead, by bracketed level samples as in ``event_response.threshold``. The estimate with the smaller sum of
    standard error and bound is stated. Windows and tiles (4 x 4) are fitted separately, and every segment and every
    rectangle is compared with the rest. Where neither method gives an estimate, or an offset is so large that one fit
    underestimates it, some windows are measured again with the offset subtracted, until no offset remains. Offsets of
    up to 100 ms are searched. After an alarm, three models are compared by their Bayesian information criteria: an
    offset, a clock rate, and a late segment. Where timestamps step back, the steps separate a late segment from one in
    which the clock gains (``clocks.order``).

    Noise model
    -----------
    The standard error is the largest of the formal one and those by leaving out cells, windows, tiles, and rows and
    columns of tiles (delete-one jackknife): neighbouring samples, and samples along a straight edge, share errors of
    the frames. If few groups scatter more than their cells imply, the error by groups is used, widened by Student's
    distribution (``shared_errors``). The error of a region of few windows is widened likewise, and that of a delay from
    few cells. The scatter of windows is estimated from all of them together. The expected delay is half a tick of the
    timestamps (a timestamp is the first tick not before the crossing) plus the delay of a declared low-pass. The model
    error bound is the change by four frames in place of six, plus 0.7 of the change by uniform footprints (derivation
    beside ``LEFT_BY_SHARP``); for bracketed samples it is that of the thresholds. The signal of a linear sensor jumps
    at its events: its bracketed levels may all have one common error of sqrt(3) times their scatter. Its steps are
    large, and many lie at maxima and minima of light between two frames: the last event before each reversal is not
    used.

    Cannot detect
    -------------
    Delays that both streams share. A delay in a still scene. Offsets that last less than a window (0.2 s). Which stream
    is late, unless depth or flow determine it.

    Sources
    -------
    First principles (``fedora_qa/estimators/events/frame_interpolation.py``, ``levels.py``). Lagrange interpolation;
    Huber 1964; jackknife: Efron and Stein 1981; matched filter for a step; Schwarz 1978, "Estimating the dimension of a
    model".
    """

    name = "event_response.timing"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> TimingSummary | None:
        """Sum the window's level samples and interpolated levels."""
        levels, interpolation = level_sums(window), interpolation_sums(window)
        if levels is None and interpolation is None:
            return None
        return TimingSums(levels, interpolation, window.span.index)

    def follow_up_windows(self, state: list[TimingSummary], facts: Facts) -> tuple[int, ...]:
        """Name the windows with most samples where one fit does not determine the offset."""
        sums = _sums(state)
        fitted, _ = _fitted_offset(sums, facts)
        if not sums or (fitted is not None and abs(fitted.offset_s) < CAPTURE_SHARE * fitted.capture_range_s):
            return ()
        # Windows with most samples give the smallest error of an offset.
        richest = sorted(sums, key=lambda of_window: -of_window.samples)[:WINDOWS_SEARCHED]
        return tuple(of_window.window for of_window in richest)

    def follow_up(self, state: list[TimingSummary], window: Window) -> None:
        """Search the window for offsets beyond the capture range of the fit."""
        fitted, _ = _fitted_offset(_sums(state), window.facts)
        search = search_window(window, fitted.offset_s if fitted is not None else None, _searches(state))
        if search is not None:
            state.append(search)

    def conclude(self, state: Sequence[TimingSummary], facts: Facts) -> Observation:
        """State the offset by a search where one was made, else that by one fit of all windows."""
        sums, declared = _sums(state), facts.declared.events
        interpolation = [of_window.interpolation for of_window in sums if of_window.interpolation is not None]
        pairs = level_coverage([of_window.levels for of_window in sums if of_window.levels is not None]).seen
        samples = pairs + int(sum(of_window.fine.counts.sum() for of_window in interpolation))
        coverage = Coverage(samples, samples, "level samples")
        if declared is None:
            return Observation(coverage, unobservable="the event sensor is not declared")
        fitted, why = _fitted_offset(sums, facts)
        searched = searched_offset(_searches(state))
        if fitted is None:
            if searched is None:
                return Observation(coverage, unobservable=why)
            return Observation(coverage, (self._offset(searched, facts, (), of_all_pixels=True),))
        segment, region = segment_offset(interpolation), region_offset(interpolation)
        local = _differs_clearly(segment) or _differs_clearly(region)
        # A search fits one offset to all events, which a segment or a region of another delay contradicts.
        if searched is not None and search_is_preferred(searched, fitted, facts) and not local:
            return Observation(coverage, (self._offset(searched, facts, (), of_all_pixels=True),))
        courses = delayed = None
        if segment is not None:
            spans_ns = np.array([(each.start_ns, each.stop_ns) for each in interpolation], np.int64)
            courses, delayed = delay_courses(segment, spans_ns, 1e-3 * expected_delay_ms(declared, facts)[0])
        ppm, error_ppm = 1e6 * fitted.rate, 1e6 * fitted.rate_error
        rate = Statistic(
            name="clock_rate",
            value=ppm,
            unit="ppm",
            standard_error=error_ppm,
            model_error_bound=1e6 * fitted.rate_bound,
            statement=f"The clock of the events is {abs(ppm):.3g} +/- {error_ppm:.2g} ppm too "
            f"{'fast' if ppm > 0 else 'slow'} against that of the colour frames.",
            code="event_response.timing.rate",
            where=Where(stream="events"),
            features=(fitted, *_present(courses, delayed)),
        )
        statistics = [
            self._offset(fitted, facts, _present(courses, delayed), of_all_pixels=not _differs_clearly(region)),
            rate,
        ]
        if segment is not None:
            chosen = [each for each, inside in zip(interpolation, segment.step.chosen, strict=True) if inside]
            where, place = place_of_segment(facts, chosen[0].start_ns, chosen[-1].stop_ns)
            part_and_rest = (place, "in the rest of the sequence")
            statistics.append(self._part("stretch", segment, where, part_and_rest, _present(courses, delayed)))
        if region is not None:
            where, place = place_of_tiles(facts, region.step.chosen)
            statistics.append(self._part("region", region, where, (place, "elsewhere"), ()))
        return Observation(coverage, tuple(statistics))

    def _offset(
        self, estimate: ClockOffset, facts: Facts, courses: tuple[Feature, ...], *, of_all_pixels: bool
    ) -> Statistic:
        expected, tick_error = expected_delay_ms(facts.declared.events, facts)
        # In ms; the error of the expected delay adds to the bound.
        delay, error, bound = 1e3 * estimate.offset_s, 1e3 * estimate.error_s, 1e3 * estimate.bound_s + tick_error
        offset = delay - expected
        size = OffsetSize(offset_error_ms(estimate, offset, bound, facts), of_all_pixels)
        return Statistic(
            name="time_offset",
            value=delay,
            unit="ms",
            standard_error=error,
            expected=expected,
            model_error_bound=bound,
            statement=f"Events are {abs(offset):.3g} +/- {hypot(error, bound):.2g} ms "
            f"{'late' if offset > 0 else 'early'} against the colour frames.",
            code="event_response.timing.offset",
            where=Where(stream="events"),
            features=(estimate, size, *courses),
        )

    def _part(
        self, rule: str, local: LocalOffset, where: Where, part_and_rest: tuple[str, str], features: tuple[Feature, ...]
    ) -> Statistic:
        delay, error = 1e3 * local.step.offset_s, 1e3 * local.step.standard_error_s
        part, rest = part_and_rest
        return Statistic(
            name=f"late_{rule}",
            value=delay,
            unit="ms",
            standard_error=error,
            tests=local.step.tests,
            # A part of several windows or tiles is more sensitive than each of them.
            sensitivity=sensitivity_range(1e3 * np.append(local.errors_s, local.step.standard_error_s), 0.0),
            statement=f"{part} events are {abs(delay):.3g} +/- {error:.2g} ms {'later' if delay > 0 else 'earlier'} "
            f"than {rest}.",
            code=f"event_response.timing.{rule}",
            where=where,
            features=features,
        )


def delay_courses(
    local: LocalOffset, spans_ns: NDArray[np.int64], expected_s: float
) -> tuple[DelayCourses, DelayedSegment | None]:
    """Return the probabilities of three courses of the delay over the windows, by exp(-BIC / 2) (Schwarz 1978).

    An offset and a rate (delay 0 at the origin of the file) have one parameter each; a segment has three, with its
    ends, and a fourth where it begins or ends within a window, whose delay then lies between. Residuals of the best
    course count as noise. Which of two parts has the delay follows from the expected delay, where no third part does.

    Parameters
    ----------
    local
        Delays of the windows, and the segment whose delay differs most.
    spans_ns
        (k, 2) begin and end of the windows, ns from the file's origin.
    expected_s
        Delay of a correct file, s.

    Returns
    -------
    courses
        Of sum 1.
    segment
        The best one; None where one offset of all windows is more probable.
    """
    usable = np.isfinite(local.delays_s) & np.isfinite(local.errors_s)
    delays_s, errors_s, spans_ns = (local.delays_s - expected_s)[usable], local.errors_s[usable], spans_ns[usable]
    inside = local.step.chosen[usable]
    count = len(delays_s)
    squares_of, free_of = [], []
    # Middles of the windows, s.
    for course in (np.ones(count), spans_ns.mean(axis=1) / NS_PER_S):
        squares_of.append(_fitted_multiple(delays_s, errors_s, course)[0])
        free_of.append(1)
    segments = _segment_fits(delays_s, errors_s, inside)
    # BIC = chi^2 + k ln n
    best = min(segments, key=lambda fit: fit.squares + fit.free * np.log(count), default=None)
    squares_of.append(np.inf if best is None else best.squares)
    free_of.append(0 if best is None else best.free)
    squares = np.array(squares_of)
    # Scatter beyond the errors counts as noise; otherwise a large chi^2 would make any course certain.
    noise = max(1.0, float(squares.min()) / max(count - 1, 1))
    criteria = squares / noise + np.array(free_of) * np.log(count)
    # Only differences of BIC matter; the least is subtracted so that exp does not underflow.
    probabilities = np.exp(-0.5 * (criteria - criteria.min()))
    probabilities /= probabilities.sum()
    constant, drift, segment = (float(probability) for probability in probabilities)
    courses = DelayCourses(constant, drift, segment, reaches_end=bool(inside[0] or inside[-1]))
    if best is None or segment <= constant:
        return courses, None
    return courses, _delayed_segment(best, delays_s, spans_ns)


def _fitted_multiple(
    delays_s: NDArray[np.float64], errors_s: NDArray[np.float64], course: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return chi^2 of the delays less the best multiple of a course, that multiple, and its standard error."""
    values, weighted = delays_s / errors_s, course / errors_s
    # Least squares of one multiple m in y = m x, both over the error of y: m = x . y / x . x, of variance 1 / x . x.
    squared = max(float(weighted @ weighted), 1e-300)
    multiple = float(values @ weighted) / squared
    return float(np.sum((values - multiple * weighted) ** 2)), multiple, 1 / sqrt(squared)


def _segment_fits(
    delays_s: NDArray[np.float64], errors_s: NDArray[np.float64], inside: NDArray[np.bool_]
) -> list[_DelayFit]:
    """Return the fits of a segment with a delay: the one that differs, or all others if it lies at one end."""
    fits: list[_DelayFit] = []
    sides = (inside, ~inside) if bool(inside[0]) != bool(inside[-1]) else (inside,)
    for side in sides:
        changes = np.flatnonzero(side[1:] != side[:-1])
        edges: tuple[int | None, ...] = (None, *sorted({*changes.tolist(), *(changes + 1).tolist()}))
        for edge in edges:
            measured = np.ones(len(side), np.bool_)
            if edge is not None:
                measured[edge] = False
            held = side & measured
            if held.any() and not held[measured].all():
                course = held[measured].astype(np.float64)
                squares, offset_s, error_s = _fitted_multiple(delays_s[measured], errors_s[measured], course)
                # Its size, its begin and its end; at an edge window the part of it that has the delay.
                fits.append(_DelayFit(squares, 3 + (edge is not None), held, edge, offset_s, error_s))
    return fits


def _delayed_segment(fit: _DelayFit, delays_s: NDArray[np.float64], spans_ns: NDArray[np.int64]) -> DelayedSegment:
    first, last = (int(row) for row in np.flatnonzero(fit.inside)[[0, -1]])
    begin_ns = None if first == 0 else int(spans_ns[first, 0])
    end_ns = None if last == len(delays_s) - 1 else int(spans_ns[last, 1])
    if fit.edge is not None:
        start_ns, stop_ns = (int(ns) for ns in spans_ns[fit.edge])
        # The delay of the window is the mean over its time.
        late_ns = round(float(np.clip(delays_s[fit.edge] / fit.offset_s, 0, 1)) * (stop_ns - start_ns))
        if fit.edge == first - 1:
            begin_ns = stop_ns - late_ns
        elif fit.edge == last + 1:
            end_ns = start_ns + late_ns
    return DelayedSegment(MS_PER_S * fit.offset_s, MS_PER_S * fit.error_s, begin_ns, end_ns)


def _present(*features: Feature | None) -> tuple[Feature, ...]:
    return tuple(feature for feature in features if feature is not None)


def _sums(state: Sequence[TimingSummary]) -> list[TimingSums]:
    return [summary for summary in state if isinstance(summary, TimingSums)]


def _searches(state: Sequence[TimingSummary]) -> list[OffsetSearch]:
    return [summary for summary in state if not isinstance(summary, TimingSums)]


def _fitted_offset(sums: Sequence[TimingSums], facts: Facts) -> tuple[ClockOffset | None, str]:
    """Return the offset by the fit of the smaller error, and an empty sentence; or None and the reason."""
    declared = facts.declared.events
    fits = fit_all([of_window.interpolation for of_window in sums if of_window.interpolation is not None])
    by_levels = fit_thresholds([of_window.levels for of_window in sums if of_window.levels is not None], facts)
    estimates = [] if fits is None else [offset_by_interpolation(fits)]
    if isinstance(by_levels, ThresholdFit) and declared is not None:
        estimates.append(offset_by_levels(by_levels, declared))
    finite = [estimate for estimate in estimates if estimate is not None]
    if not finite:
        return None, by_levels if isinstance(by_levels, str) else "events do not agree with the frames"
    # By error and bound together, since a limit is made of both.
    return min(finite, key=lambda estimate: estimate.error_s + estimate.bound_s), ""


def _differs_clearly(local: LocalOffset | None) -> bool:
    """Whether the delay of a part differs from the rest by ``LOCAL_SIGNIFICANCE`` standard errors."""
    return local is not None and abs(local.step.offset_s) >= LOCAL_SIGNIFICANCE * local.step.standard_error_s
