"""Hypotheses for events whose clock is off against the frames: by an offset or a rate, for all events or a part."""

from dataclasses import replace
from math import hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_response.timing import DelayCourses, OffsetSize
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.clock_resets import ClockReset, clock_reset
from fedora_qa.views.event_clock_offset import ClockOffset

_EVENTS: Final = support("event_response.clock_of_events")
_FRAMES: Final = support("event_response.clock_of_frames")

_NO_COURSES: Final = DelayCourses(
    support("event_response.course_constant"),
    support("event_response.course_drift"),
    support("event_response.course_segment"),
    reaches_end=False,
)
"""In place of courses that were not compared."""


def propose_timing(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Propose an offset and a rate of either clock, each as far as its course over time explains the delays."""
    statistic, rule = alarm.statistic, alarm.finding.code.rpartition(".")[2]
    wrong_model = Hypothesis("event_model_misdeclared", "events", support("event_response.model_spoils_delays"))
    if rule == "region":
        # A clock is one for all pixels: what moves a part of the image can only have moved its events.
        of_region = support("event_response.offset_of_region")
        offset = Hypothesis("time_offset", "events", of_region, statistic.value, "ms", statistic.standard_error)
        return offset, wrong_model
    compared = next((feature for feature in statistic.features if isinstance(feature, DelayCourses)), None)
    courses = _NO_COURSES if compared is None else with_clock_reset(compared, clock_reset(facts.events))
    if rule == "stretch":
        return (
            *_offsets(statistic.value, statistic.standard_error, facts, courses.segment),
            Hypothesis("clock_rate", "events", _EVENTS * courses.drift),
            Hypothesis("clock_rate", "rgb", _FRAMES * courses.drift),
            wrong_model,
        )
    estimate = next(feature for feature in statistic.features if isinstance(feature, ClockOffset))
    if rule == "rate":
        return (
            *_rates(estimate, 1.0 - courses.segment),
            Hypothesis("time_offset", "events", _EVENTS * courses.segment),
            Hypothesis("time_offset", "rgb", _FRAMES * courses.segment),
            wrong_model,
        )
    size = next(feature for feature in statistic.features if isinstance(feature, OffsetSize))
    # The mean offset of a file is that of the fault only where all events have it.
    sized = size.of_all_pixels and courses.constant > courses.segment
    error_ms = size.error_ms if sized else None
    return (
        *_offsets(statistic.value - statistic.expected, error_ms, facts, courses.constant + courses.segment),
        *_rates(estimate, courses.drift),
        wrong_model,
    )


def with_clock_reset(courses: DelayCourses, reset: ClockReset | None) -> DelayCourses:
    """Return the courses, that of a segment shared with drift as far as the steps of a reset clock say that it gained.

    Without a step forwards a segment that reaches an end of the known delays was late at once; others can only have
    gained.
    """
    if reset is None or (reset.forwards is None and courses.reaches_end):
        return courses
    gains, offset = reset.drift_agreement, reset.offset_agreement
    moved = courses.segment * gains / (gains + offset) if gains > 0 else 0.0
    return replace(courses, drift=courses.drift + moved, segment=courses.segment - moved)


def whose_offset(offset_ms: float, facts: Facts) -> tuple[float, float]:
    """Return the support of an offset of the events, and of the frames, which may keep in step with depth and flow.

    A renderer draws colour, depth and flow at common times. Frames that leave them by the offset are moved themselves,
    and frames that still meet them were not.
    """
    either = _EVENTS, _FRAMES
    clocks = [facts.clocks[stream] for stream in ("depth", *facts.flow_streams) if stream in facts.clocks]
    common_ns = np.unique(np.concatenate([clock.times_ns for clock in clocks])) if clocks else np.zeros(0, np.int64)
    frames_ns = facts.clocks["rgb"].times_ns
    if len(common_ns) < 2 or not len(frames_ns):
        return either
    # Ns per ms. A quarter of the offset separates a frame's place before the move from that after it.
    near_ns = abs(offset_ms) * 1e6 / 4
    as_timestamped = _median_distance(frames_ns, common_ns) < near_ns
    moved_back = _median_distance(frames_ns + round(1e6 * offset_ms), common_ns) < near_ns
    # Frames meet the common times with and without the move, or with neither: these times do not decide.
    if as_timestamped == moved_back:
        return either
    return either[::-1] if moved_back else (_EVENTS, support("event_response.clock_of_frames_in_step"))


def _median_distance(times_ns: NDArray[np.int64], grid_ns: NDArray[np.int64]) -> float:
    """Return the median distance of timestamps from the nearest of a sorted grid of two or more."""
    # The neighbours ``after - 1`` and ``after`` exist for timestamps beyond the ends of the grid as well.
    after = np.clip(np.searchsorted(grid_ns, times_ns), 1, len(grid_ns) - 1)
    return float(np.median(np.minimum(np.abs(times_ns - grid_ns[after - 1]), np.abs(grid_ns[after] - times_ns))))


def _offsets(offset_ms: float, error_ms: float | None, facts: Facts, explained: float) -> tuple[Hypothesis, ...]:
    """Return an offset of the events and of the frames, with its size where that has an error."""
    of_events, of_frames = (explained * of_clock for of_clock in whose_offset(offset_ms, facts))
    if error_ms is None:
        return Hypothesis("time_offset", "events", of_events), Hypothesis("time_offset", "rgb", of_frames)
    return (
        Hypothesis("time_offset", "events", of_events, offset_ms, "ms", error_ms),
        # Only the difference of two clocks is measured: events too late are frames too early.
        Hypothesis("time_offset", "rgb", of_frames, -offset_ms, "ms", error_ms),
    )


def _rates(estimate: ClockOffset, explained: float) -> tuple[Hypothesis, ...]:
    """Return a clock rate of the events and of the frames, with its size."""
    # From s/s to ppm. Statistical error and bound of the model error add in squares.
    ppm, error = 1e6 * estimate.rate, 1e6 * hypot(estimate.rate_error, estimate.rate_bound)
    return (
        Hypothesis("clock_rate", "events", _EVENTS * explained, ppm, "ppm", error),
        Hypothesis("clock_rate", "rgb", _FRAMES * explained, -ppm, "ppm", error),
    )
