"""Events against log intensity: time."""

from collections.abc import Sequence
from math import hypot, pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.events.answer import TOLD_WITHIN_S, Answer, LevelCheck, Seen, answer, level_coverage
from fedora_qa.checks.events.levels import FoundOffset, LevelSums, search_offset
from fedora_qa.checks.events.rows import tick_ns
from fedora_qa.checks.protocol import Measured, Observation, Suspect
from fedora_qa.conventions import NS_PER_US
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

EVENTS: Final = Where(stream="events")

HELD_LEVEL_BIAS: Final = float(np.sqrt(3.0))
"""Mean over scatter of the error of levels that stay where an event left them until the next one.

At a share phi of the gap the events tell phi thresholds more than there are: 1/2 on average, with a standard deviation
of 1/sqrt(12) as phi is uniform."""

DRIFT_KNOWN: Final = 5.0
"""Standard errors of the clock rate beyond which an offset is suspected to be part of it (after an alarm only)."""

WINDOWS_SEARCHED: Final = 2

_EITHER: Final = (0.9, 0.8)
"""Weights of an offset of the events and of the frames where nothing tells them apart."""


class Timing(LevelCheck):
    """Are events and frames stamped by one clock?

    The coefficient of the level's slope in the regression of ``event_response.threshold`` is the time by which events
    are stamped late. Expected is the mean lateness that is declared: half a tick of the stamps (a stamp is the first
    tick not before the crossing; a sensor that takes its reference at the tick is not late), and the delay of a
    declared low-pass. Allowances are those of the thresholds. A sensor of the linear model fires once a rendered step,
    however far the step went; where edges pass within a few steps a pixel's level jumps at an event and holds until
    the next, and events seem early by up to half their gap. Such levels scatter about the fit: what scatters by its
    residual may be biased by sqrt(3) times as much. The offset is that at the middle of the sequence; its growth is
    the difference of the clocks' rates. Where the offset is large, or events do not follow the frames at
    all, offsets up to 100 ms are tried on two windows in a second look.
    """

    name = "event_response.timing"
    _MATTERS_MS: Final = 2.0
    _MATTERS_PPM: Final = 1_000.0

    def look_again_at(self, state: list[Seen], facts: Facts) -> tuple[int, ...]:
        """Name the windows with most samples where one fit does not tell the offset."""
        sums = [one for one in state if isinstance(one, LevelSums)]
        found = answer(sums, facts)
        if not sums or (isinstance(found, Answer) and abs(found.fit.delay_s) < TOLD_WITHIN_S):
            return ()
        richest = sorted(sums, key=lambda one: -one.pairs)[:WINDOWS_SEARCHED]
        return tuple(one.window for one in richest)

    def look_again(self, state: list[Seen], window: Window) -> None:
        """Try other offsets."""
        found = search_offset(window)
        if found is not None:
            state.append(found)

    def conclude(self, state: Sequence[Seen], facts: Facts) -> Observation:
        """State the offset of the second look where there was one, else that of the fit."""
        offsets = [one for one in state if isinstance(one, FoundOffset)]
        if not offsets or facts.declared.events is None:
            return super().conclude(state, facts)
        late_s = np.array([one.late_s for one in offsets])
        error_s = max(float(np.ptp(late_s)) / 2, *(one.standard_error_s for one in offsets))
        bound_s = _jump_bias_s(max(one.coherent_delay_s for one in offsets), facts.declared.events)
        measured = self._offset(float(late_s.mean()), error_s, bound_s, facts.declared.events, facts)
        return Observation(level_coverage(state), (measured,))

    def state(self, found: Answer, declared: EventModel, facts: Facts) -> tuple[Measured, ...]:
        """State the offset in ms, and the rate in ppm."""
        fit = found.fit
        drifting = abs(fit.delay_rate) > DRIFT_KNOWN * fit.standard_errors.delay_rate
        offset = self._offset(
            fit.delay_s,
            fit.standard_errors.delay_s,
            found.model_errors.delay_s + _jump_bias_s(fit.coherent_delay_s, declared),
            declared,
            facts,
            drift_weight=0.85 if drifting else 0.1,
        )
        return offset, self._rate(found)

    def _offset(
        self,
        late_s: float,
        error_s: float,
        bound_s: float,
        declared: EventModel,
        facts: Facts,
        *,
        drift_weight: float = 0.1,
    ) -> Measured:
        expected, tick_error = _expected_delay_ms(declared, facts)
        late, error, bound = 1e3 * late_s, 1e3 * error_s, 1e3 * bound_s + tick_error
        offset = late - expected
        of_events, of_frames = _whose_offset(offset, facts)
        return Measured(
            name="time_offset",
            value=late,
            unit="ms",
            standard_error=error,
            expected=expected,
            allowance=bound,
            matters=self._MATTERS_MS,
            statement=f"Events are {abs(offset):.3g} +/- {hypot(error, bound):.2g} ms "
            f"{'late' if offset > 0 else 'early'} against the colour frames.",
            code="event_response.timing.offset",
            where=EVENTS,
            suspects=(
                Suspect("time_offset", "events", of_events, offset, "ms", hypot(error, bound)),
                Suspect("time_offset", "rgb", of_frames, -offset, "ms", hypot(error, bound)),
                Suspect("clock_rate", "events", drift_weight),
            ),
        )

    def _rate(self, found: Answer) -> Measured:
        ppm, error = 1e6 * found.fit.delay_rate, 1e6 * found.fit.standard_errors.delay_rate
        bound = 1e6 * found.model_errors.delay_rate
        return Measured(
            name="clock_rate",
            value=ppm,
            unit="ppm",
            standard_error=error,
            allowance=bound,
            matters=self._MATTERS_PPM,
            statement=f"The clock of the events runs {abs(ppm):.3g} +/- {error:.2g} ppm too "
            f"{'fast' if ppm > 0 else 'slow'} against that of the colour frames.",
            code="event_response.timing.rate",
            where=EVENTS,
            suspects=(
                Suspect("clock_rate", "events", 0.9, ppm, "ppm", hypot(error, bound)),
                Suspect("clock_rate", "rgb", 0.8, -ppm, "ppm", hypot(error, bound)),
            ),
        )


def _jump_bias_s(coherent_delay_s: float, declared: EventModel) -> float:
    """Bound how early events seem because levels jump at them; only those of the linear model fire once a step."""
    return HELD_LEVEL_BIAS * coherent_delay_s if declared.model == "linear" else 0.0


def _whose_offset(offset_ms: float, facts: Facts) -> tuple[float, float]:
    """Return the weights of an offset of the events, and of the frames: do those keep in step with depth and flow?

    A renderer draws colour, depth and flow at common times. Frames that leave them by the offset are moved themselves,
    and frames that still meet them were not.
    """
    clocks = [facts.clocks[stream] for stream in ("depth", *facts.flow_streams) if stream in facts.clocks]
    common_ns = np.unique(np.concatenate([clock.times_ns for clock in clocks])) if clocks else np.zeros(0, np.int64)
    frames_ns = facts.clocks["rgb"].times_ns
    if len(common_ns) < 2 or not len(frames_ns):
        return _EITHER
    near_ns = abs(offset_ms) * 1e6 / 4
    as_stamped = _median_distance(frames_ns, common_ns) < near_ns
    moved_back = _median_distance(frames_ns + round(1e6 * offset_ms), common_ns) < near_ns
    if as_stamped == moved_back:
        return _EITHER
    return _EITHER[::-1] if moved_back else (_EITHER[0], _EITHER[1] / 2)


def _median_distance(times_ns: NDArray[np.int64], grid_ns: NDArray[np.int64]) -> float:
    """Return the median distance of stamps from the nearest of a sorted grid of two or more."""
    after = np.clip(np.searchsorted(grid_ns, times_ns), 1, len(grid_ns) - 1)
    return float(np.median(np.minimum(np.abs(times_ns - grid_ns[after - 1]), np.abs(grid_ns[after] - times_ns))))


def _expected_delay_ms(declared: EventModel, facts: Facts) -> tuple[float, float]:
    """Return the mean lateness of events, and the error of that expectation."""
    low_pass_ms = 1e3 / (2 * pi * declared.bandwidth_hz) if declared.bandwidth_hz > 0 else 0.0
    tick_ms = tick_ns(facts) / 1e6
    if declared.model == "linear":
        return low_pass_ms, 0.0
    declared_ms = max(declared.packet_interval_us, 1) * NS_PER_US / 1e6
    # A grid that nobody declared may come from rounding up, down or to the nearest tick.
    return declared_ms / 2 + low_pass_ms, max(tick_ms - declared_ms, 0.0)
