"""Events against log intensity: time."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np

from fedora_qa.checks.event_response.offset_search import Searched, found_again, search_again, tells_better
from fedora_qa.checks.event_response.timing_causes import Shapes, offset_suspects, rate_suspects, shapes_of, with_steps
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import NS_PER_S
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.clock_resets import clock_reset
from fedora_qa.views.event_camera import sensor_shape, why_frames_and_events_do_not_meet
from fedora_qa.views.event_clock_offset import (
    Lateness,
    Local,
    by_levels,
    by_readings,
    expected_delay_ms,
    late_region,
    late_stretch,
    told_error_ms,
)
from fedora_qa.views.event_tiles import tile_around
from fedora_qa.views.frame_interpolation import ReadingSums, fit_all, reading_sums
from fedora_qa.views.level_samples import LevelSums, level_sums
from fedora_qa.views.threshold_fit import Answer, answer, level_coverage

EVENTS: Final = Where(stream="events")

WINDOWS_SEARCHED: Final = 6

READ_TRULY: Final = 0.5
"""Share of ``told_within_s`` from which on one fit reads an offset too small by more than a tenth, and it is read again
with itself undone."""

CLEARLY_LOCAL: Final = 5.0
"""Standard errors by which a region must be late for an offset of all events to be doubted (after an alarm only)."""


_WRONG_MODEL: Final = Suspect("event_model_misdeclared", "events", 0.15)
"""Thresholds of another model spoil delays as well; event_response.model says so better."""


@dataclass(frozen=True, slots=True)
class TimingSums:
    """What a window shows: bracketed level samples, frames read at events, or both."""

    levels: LevelSums | None
    readings: ReadingSums | None
    window: int

    @property
    def samples(self) -> int:
        """Pairs of level samples and readings, by which other offsets are tried."""
        readings = 0 if self.readings is None else int(self.readings.fine.counts.sum())
        return readings + (0 if self.levels is None else self.levels.pairs)


Seen = TimingSums | Searched


class EventResponseTiming(WindowCheck[Seen]):
    """Are events and frames stamped by one clock?

    The time by which events are stamped late against the colour frames (negative: early) is estimated in ms, with its
    growth in ppm; then the stretch of windows and the rectangle of image tiles that differ most from the rest.

    Why it matters
    --------------
    A learned or fitted model takes events and frames of one stamp to show one instant. At 200 px/s an offset of 2 ms
    displaces events by 0.4 px, which a network learns as a bias and an evaluation blames on the method.

    How
    ---
    Frames are read at events: where light changes slowly between frames, the polynomial through six of them gives a
    pixel's level L and slope L' at the stamp of each event, and L = a + C+ P - C- M + delta L' + kappa |L'| over the
    pixel's events so far, delta being the delay, and kappa what frames tell wrongly at the ends of edges, whichever way
    the light goes. Where light changes fast, events are read at frames instead, by bracketed level
    samples as in event_response.threshold. The one with the smaller standard error and bound is stated. Windows and
    tiles (4 x 4) are fitted by themselves; every stretch and every rectangle is held against the rest. Where neither
    tells, or an offset is so gross that one fit reads it too small, some windows are read again with the offset undone,
    until none is left; offsets up to 100 ms are tried. After an alarm, offset,
    clock rate and late stretch are compared by their Bayesian information criteria; where stamps step back, their steps
    tell a stretch that is late from one whose clock gains (``clocks.order``).

    Noise model
    -----------
    Standard errors are the largest of the formal one and those by leaving out cells, windows, tiles, and rows and
    columns of tiles (delete-one jackknife): errors of frames are shared by neighbouring readings, and along a straight
    edge. Where few groups scatter by more than their cells explain, theirs counts, widened as Student's distribution
    says (``few_groups``); so is the error of a region of few windows, and that of a delay of which few cells tell most.
    How far windows scatter is told by all of them together. Expected is half a tick of the stamps (a stamp is
    the first tick not before the crossing) and the delay of a declared low-pass. Allowances: what four frames in place
    of six change, and 0.7 of what the even reconstruction of footprints changes (derivation beside ``LEFT_BY_SHARP``);
    for bracketed samples those of the thresholds. A sensor of the linear model jumps at its events: its bracketed
    levels may err by sqrt(3) times their scatter, all as one. Its steps are large, and many are made at crests of light
    between two frames: the last event before each turn is not read.

    Cannot see
    ----------
    Delays of whole pixels' histories alike in both streams; a delay in a still scene; offsets that are shorter than a
    window (0.2 s) in time; which stream is late, unless depth or flow tell.

    Sources
    -------
    First principles (event_reading, event_levels). Lagrange interpolation; Huber 1964; jackknife: Efron and Stein 1981;
    matched filter for a step; Schwarz 1978, "Estimating the dimension of a model".
    """

    name = "event_response.timing"
    needs = ("events", "rgb")
    _MATTERS_MS: Final = 2.0
    _MATTERS_PPM: Final = 1_000.0

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> Seen | None:
        """Sum the window's level samples and readings."""
        levels, readings = level_sums(window), reading_sums(window)
        return None if levels is None and readings is None else TimingSums(levels, readings, window.span.index)

    def follow_up_windows(self, state: list[Seen], facts: Facts) -> tuple[int, ...]:
        """Name the windows with most samples where one fit does not tell the offset."""
        sums = _sums(state)
        found, _ = _lateness(sums, facts)
        if not sums or (found is not None and abs(found.late_s) < READ_TRULY * found.capture_range_s):
            return ()
        richest = sorted(sums, key=lambda one: -one.samples)[:WINDOWS_SEARCHED]
        return tuple(one.window for one in richest)

    def follow_up(self, state: list[Seen], window: Window) -> None:
        """Try other offsets."""
        first, _ = _lateness(_sums(state), window.facts)
        found = search_again(window, first.late_s if first is not None else None, _searched(state))
        if found is not None:
            state.append(found)

    def conclude(self, state: Sequence[Seen], facts: Facts) -> Observation:
        """State the offset of the second look where there was one, else what all windows tell."""
        sums, declared = _sums(state), facts.declared.events
        coverage = _coverage(sums)
        if declared is None:
            return Observation(coverage, unobservable="the event sensor is not declared")
        found, why = _lateness(sums, facts)
        again = found_again(_searched(state))
        if found is None:
            if again is None:
                return Observation(coverage, unobservable=why)
            return Observation(coverage, (self._offset(again, facts, Shapes(), told=True),))
        readings = _readings(sums)
        stretch, region = late_stretch(readings), late_region(readings)
        if again is not None and tells_better(again, found, facts) and not (_clear(stretch) or _clear(region)):
            return Observation(coverage, (self._offset(again, facts, Shapes(), told=True),))
        shapes = _shapes(stretch, sums, facts)
        measured = (
            self._offset(found, facts, shapes, told=not _clear(region)),
            self._rate(found, shapes),
            *([self._stretch(stretch, readings, facts, shapes)] if stretch is not None else []),
            *([self._region(region, facts)] if region is not None else []),
        )
        return Observation(coverage, measured)

    def _offset(self, found: Lateness, facts: Facts, shapes: Shapes, *, told: bool) -> Statistic:
        """State the offset; ``told`` where it is that of all events."""
        expected, tick_error = expected_delay_ms(facts.declared.events, facts)
        late, error, bound = 1e3 * found.late_s, 1e3 * found.error_s, 1e3 * found.bound_s + tick_error
        offset = late - expected
        share, sized = shapes.constant + shapes.stretch, told and shapes.constant > shapes.stretch
        told_error = told_error_ms(found, offset, bound, facts)
        return Statistic(
            name="time_offset",
            value=late,
            unit="ms",
            standard_error=error,
            expected=expected,
            model_error_bound=bound,
            material=self._MATTERS_MS,
            statement=f"Events are {abs(offset):.3g} +/- {hypot(error, bound):.2g} ms "
            f"{'late' if offset > 0 else 'early'} against the colour frames.",
            code="event_response.timing.offset",
            where=EVENTS,
            suspects=(
                *offset_suspects(offset, told_error, facts, share, told=sized),
                *rate_suspects(found, shapes.drift),
                _WRONG_MODEL,
            ),
        )

    def _rate(self, found: Lateness, shapes: Shapes) -> Statistic:
        ppm, error, bound = 1e6 * found.rate, 1e6 * found.rate_error, 1e6 * found.rate_bound
        return Statistic(
            name="clock_rate",
            value=ppm,
            unit="ppm",
            standard_error=error,
            model_error_bound=bound,
            material=self._MATTERS_PPM,
            statement=f"The clock of the events runs {abs(ppm):.3g} +/- {error:.2g} ppm too "
            f"{'fast' if ppm > 0 else 'slow'} against that of the colour frames.",
            code="event_response.timing.rate",
            where=EVENTS,
            suspects=(
                *rate_suspects(found, 1.0 - shapes.stretch),
                Suspect("time_offset", "events", 0.9 * shapes.stretch),
                Suspect("time_offset", "rgb", 0.8 * shapes.stretch),
                _WRONG_MODEL,
            ),
        )

    def _stretch(self, local: Local, readings: Sequence[ReadingSums], facts: Facts, shapes: Shapes) -> Statistic:
        chosen = [one for one, inside in zip(readings, local.step.chosen, strict=True) if inside]
        start_us, stop_us = facts.to_file_us(chosen[0].start_ns), facts.to_file_us(chosen[-1].stop_ns)
        where = Where(stream="events", start_us=start_us, stop_us=stop_us)
        suspects = (
            *offset_suspects(1e3 * local.step.late_s, 1e3 * local.step.standard_error_s, facts, shapes.stretch),
            Suspect("clock_rate", "events", 0.9 * shapes.drift),
            Suspect("clock_rate", "rgb", 0.8 * shapes.drift),
        )
        place = f"From {start_us / 1e6:.2f} s to {stop_us / 1e6:.2f} s"
        return self._part("stretch", local, where, place, "in the rest of the sequence", suspects)

    def _region(self, local: Local, facts: Facts) -> Statistic:
        tile = tile_around(local.step.chosen, sensor_shape(facts.declared))
        late, error = 1e3 * local.step.late_s, 1e3 * local.step.standard_error_s
        suspects = (Suspect("time_offset", "events", 0.9, late, "ms", error),)
        place = f"In columns {tile[0]} to {tile[2] - 1}, rows {tile[1]} to {tile[3] - 1}"
        return self._part("region", local, Where(stream="events", tile=tile), place, "elsewhere", suspects)

    def _part(
        self, rule: str, local: Local, where: Where, place: str, rest: str, suspects: tuple[Suspect, ...]
    ) -> Statistic:
        late, error = 1e3 * local.step.late_s, 1e3 * local.step.standard_error_s
        return Statistic(
            name=f"late_{rule}",
            value=late,
            unit="ms",
            standard_error=error,
            tests=local.step.tests,
            material=self._MATTERS_MS,
            statement=f"{place} events are {abs(late):.3g} +/- {error:.2g} ms {'later' if late > 0 else 'earlier'} "
            f"than {rest}.",
            code=f"event_response.timing.{rule}",
            where=where,
            suspects=(*suspects, _WRONG_MODEL),
        )


def _sums(state: Sequence[Seen]) -> list[TimingSums]:
    return [one for one in state if isinstance(one, TimingSums)]


def _searched(state: Sequence[Seen]) -> list[Searched]:
    return [one for one in state if not isinstance(one, TimingSums)]


def _readings(sums: Sequence[TimingSums]) -> list[ReadingSums]:
    return [one.readings for one in sums if one.readings is not None]


def _coverage(sums: Sequence[TimingSums]) -> Coverage:
    pairs = level_coverage([one.levels for one in sums if one.levels is not None]).seen
    samples = pairs + int(sum(one.fine.counts.sum() for one in _readings(sums)))
    return Coverage(samples, samples, "level samples")


def _lateness(sums: Sequence[TimingSums], facts: Facts) -> tuple[Lateness | None, str]:
    """Return what tells the offset best, by its own error; or why nothing does."""
    declared, readings = facts.declared.events, fit_all(_readings(sums))
    found = answer([one.levels for one in sums if one.levels is not None], facts)
    known = [by_readings(readings)] if readings is not None else []
    if isinstance(found, Answer) and declared is not None:
        known.append(by_levels(found, declared))
    told = [one for one in known if one is not None]
    if not told:
        return None, found if isinstance(found, str) else "events do not follow the frames"
    return min(told, key=lambda one: one.error_s + one.bound_s), ""


def _clear(local: Local | None) -> bool:
    """Whether a part is so late against the rest that an offset of all events is not the whole truth."""
    return local is not None and abs(local.step.late_s) >= CLEARLY_LOCAL * local.step.standard_error_s


def _shapes(stretch: Local | None, sums: Sequence[TimingSums], facts: Facts) -> Shapes:
    if stretch is None:
        return Shapes()
    times_s = np.array([0.5 * (one.start_ns + one.stop_ns) / NS_PER_S for one in _readings(sums)])
    expected_s = 1e-3 * expected_delay_ms(facts.declared.events, facts)[0]
    return with_steps(shapes_of(stretch, times_s, expected_s), stretch, clock_reset(facts.events))
