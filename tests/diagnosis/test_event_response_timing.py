"""Which clock is off, and how: hypotheses for delays of events."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.checks.event_response.timing import DelayCourses, OffsetSize, delay_courses
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.event_response.timing import with_clock_reset
from fedora_qa.diagnosis.hypotheses import hypotheses_of
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.estimators.events.delays import DelayStep
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.facts import EventScan, EventStep
from fedora_qa.views.clock_resets import set_clock
from fedora_qa.views.event_clock_offset import ClockOffset, LocalOffset
from tests.support.facts import MS, exact_facts


def segment_only(chosen: list[bool]) -> DelayCourses:
    """Windows whose delays are, for certain, those of a segment."""
    count = len(chosen)
    local = LocalOffset(DelayStep(np.array(chosen), 7e-3, 1e-4, 10), np.zeros(count), np.full(count, 1e-4))
    courses = delay_courses(local, np.linspace(0.1, 0.7, count), 0.0)
    return replace(courses, constant=0.0, drift=0.0, segment=1.0)


@pytest.mark.parametrize(
    ("chosen", "gains"),
    [
        pytest.param([False, True, True, False], True, id="within"),
        pytest.param([True, True, True, False], False, id="from the start"),
        pytest.param([False, False, False, True], False, id="to the end"),
    ],
)
def test_a_late_segment_within_a_file_needs_two_steps(chosen: list[bool], gains: bool) -> None:
    """With a step back only, a segment within the file gained; one at an end of it was late at once."""
    steps = EventStep(1, 0, MS), EventStep(700, 90 * MS, 80 * MS), EventStep(800, 95 * MS, 96 * MS)
    reset = set_clock(EventScan(1000, 0, 200 * MS, 1, 700, 1000, (), 10 * MS, 60, steps))
    courses = with_clock_reset(segment_only(chosen), reset)
    assert (courses.drift > courses.segment) == gains
    assert courses.drift + courses.segment == pytest.approx(1.0)


def hypotheses(rule: str, *features: Feature, value: float = 4.0, expected: float = 0.5) -> tuple[Hypothesis, ...]:
    code, where = f"event_response.timing.{rule}", Where(stream="events")
    statistic = Statistic(rule, value, "ms", 0.1, "off", code, where, expected=expected, features=features)
    return hypotheses_of(Alarm(Finding("F1", code, "error", "off", where), statistic), exact_facts())


ESTIMATE = ClockOffset(4e-3, 1e-4, 0.0, 0.0, 3e-6, 4e-6, 1e-2)


def test_an_offset_of_all_pixels_has_a_size() -> None:
    """It is the offset beyond the expected delay, of either clock, with the error that the check gives."""
    offset = hypotheses("offset", ESTIMATE, OffsetSize(0.2, of_all_pixels=True))[0]
    assert (offset.cause, offset.stream, offset.magnitude, offset.standard_error) == ("time_offset", "events", 3.5, 0.2)
    local = hypotheses("offset", ESTIMATE, OffsetSize(0.2, of_all_pixels=False))[0]
    assert (local.cause, local.magnitude) == ("time_offset", None)


def test_delays_that_grow_are_a_rate() -> None:
    """Where drift explains the delays the rate is supported, and its error includes the bound."""
    courses = DelayCourses(0.0, 1.0, 0.0, reaches_end=False)
    best = max(hypotheses("rate", ESTIMATE, courses), key=lambda hypothesis: hypothesis.support)
    assert (best.cause, best.stream, best.support) == ("clock_rate", "events", 0.9)
    assert best.standard_error == pytest.approx(5.0)


def test_a_late_region_is_of_events_only() -> None:
    """Frames have one time for all pixels."""
    assert {hypothesis.stream for hypothesis in hypotheses("region")} == {"events"}
