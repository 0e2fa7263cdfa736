"""Hypotheses for events that agree with the frames in another orientation, or whose clock is off."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.checks.event_response.alignment import CameraErrorFits, EventShift
from fedora_qa.checks.event_response.frames import ChangeAnomalies
from fedora_qa.checks.event_response.jitter import TimestampScatter
from fedora_qa.checks.event_response.orientation import EventSymmetry
from fedora_qa.checks.event_response.threshold import DomainPreference, EventStepSize
from fedora_qa.checks.event_response.timing import DelayCourses, delay_courses
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.candidates import FITS
from fedora_qa.diagnosis.event_response import hypotheses_of_symmetry, propose_alignment, whose_offset, with_clock_reset
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.estimators.events.change_courses import longest_unrelated
from fedora_qa.estimators.events.delays import DelayStep
from fedora_qa.estimators.events.orientation import SYMMETRIES
from fedora_qa.estimators.events.shift_field import ShiftFieldFit, ShiftFieldModel
from fedora_qa.faults.intrinsics import FocalLength
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import EventScan, EventStep, clock_of
from fedora_qa.views.clock_resets import clock_reset
from fedora_qa.views.event_clock_offset import LocalOffset
from tests.support.facts import MS, exact_facts
from tests.support.memory_sequence import facts_of, memory_sequence
from tests.support.proposals import named, proposed


def test_mirrored_frames_are_hypotheses_beside_mirrored_events() -> None:
    """Against frames alone one cannot tell which of the two is mirrored; exchanged axes only events can have."""
    for rival in range(2 * len(SYMMETRIES) - 1):
        symmetry = EventSymmetry.numbered(rival)
        words, causes = symmetry.text, {(each.cause, each.stream) for each in hypotheses_of_symmetry(symmetry)}
        assert (("mirrored", "rgb") in causes) == ("mirrored" in words and "axes" not in words)
        assert (("mirrored", "events") in causes) == ("mirrored" in words)


def spans_ns(count: int) -> NDArray[np.int64]:
    """Windows of 200 ms."""
    starts_ns = 200 * MS * np.arange(count, dtype=np.int64)
    return np.stack([starts_ns, starts_ns + 200 * MS], axis=1)


@pytest.mark.parametrize(
    ("delays_ms", "chosen", "begin_ms", "end_ms"),
    [
        pytest.param([0, 0, 0, 5, 5], [1, 1, 1, 0, 0], 600, None, id="the rest is late"),
        pytest.param([0, 0, 0, 5, 5], [0, 0, 0, 1, 1], 600, None, id="the part is late"),
        pytest.param([0, 0, 2, 8, 8], [1, 1, 1, 0, 0], 550, None, id="from within a window"),
        pytest.param([-6, -6, -3, 0, 0], [1, 1, 0, 0, 0], None, 500, id="until within a window"),
        pytest.param([0, 4, 4, 0, 0], [0, 1, 1, 0, 0], 200, 600, id="for a while"),
    ],
)
def test_a_step_of_the_clock_is_a_segment(
    delays_ms: list[int], chosen: list[int], begin_ms: int | None, end_ms: int | None
) -> None:
    """Events that are late from an instant on are no drift, whichever side of the step differs from the other."""
    delays_s = 1e-3 * np.array(delays_ms, dtype=float)
    local = LocalOffset(DelayStep(np.array(chosen, bool), 5e-3, 2e-4, 10), delays_s, np.full(5, 2e-4))
    courses, segment = delay_courses(local, spans_ns(5), 0.0)
    assert segment is not None
    assert courses.segment > 0.99
    assert segment.offset_ms == pytest.approx(max(delays_ms, key=abs))
    assert (segment.begin_ns, segment.end_ns) == tuple(
        None if ms is None else pytest.approx(ms * MS) for ms in (begin_ms, end_ms)
    )


def test_a_drift_is_no_segment() -> None:
    delays_s = 1e-3 * np.array([0.8, 2.4, 4.0, 5.6, 7.2])
    local = LocalOffset(DelayStep(np.arange(5) > 2, 4e-3, 2e-4, 10), delays_s, np.full(5, 2e-4))
    courses, _ = delay_courses(local, spans_ns(5), 0.0)
    assert courses.drift > 0.99


def segment_only(chosen: list[bool]) -> DelayCourses:
    """Windows whose delays are, for certain, those of a segment."""
    count = len(chosen)
    local = LocalOffset(DelayStep(np.array(chosen), 7e-3, 1e-4, 10), np.zeros(count), np.full(count, 1e-4))
    courses, _ = delay_courses(local, spans_ns(count), 0.0)
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
    reset = clock_reset(EventScan(1000, 0, 200 * MS, 1, 700, 1000, (), 10 * MS, 60, steps))
    courses = with_clock_reset(segment_only(chosen), reset)
    assert (courses.drift > courses.segment) == gains
    assert courses.drift + courses.segment == pytest.approx(1.0)


def test_a_shift_of_frames_is_in_their_own_pixels() -> None:
    """Three pixels of the events to the right and four down are ten to the left and up at twice the focal length."""
    cameras = {
        name: Camera(64, 48, np.array([[focal, 0, 32], [0, focal, 24], [0, 0, 1.0]]), np.eye(4))
        for name, focal in (("rgb", 200.0), ("events", 100.0))
    }
    facts = exact_facts()
    facts = replace(facts, declared=replace(facts.declared, cameras=cameras))
    where, shift = Where(stream="events"), EventShift(3.0, 4.0, (0.01, 0.02))
    code = "event_response.alignment.shift"
    statistic = Statistic("shift_right", 3.0, "px", 0.01, "off", code, where, features=(shift,))
    shifts = {
        h.stream: (h.magnitude, h.standard_error)
        for h in propose_alignment(Alarm(Finding("F1", code, "error", "off", where), statistic), facts)
        if h.cause == "spatial_offset"
    }
    # The error along (3, 4): sqrt((3 x 0.01)^2 + (4 x 0.02)^2) / 5.
    assert shifts["events"] == pytest.approx((5.0, np.hypot(0.03, 0.08) / 5))
    assert shifts["rgb"] == pytest.approx((-10.0, np.hypot(0.06, 0.16) / 5))


def fit(model: ShiftFieldModel, beyond: float, *parameters: float) -> ShiftFieldFit:
    return ShiftFieldFit(model, 0.9, beyond, parameters)


def test_an_error_of_a_camera_is_supported_by_what_no_shift_explains() -> None:
    """An image of events that is a tenth wider: f is declared 9% too short."""
    fits = CameraErrorFits((fit("shift", 0.0, 0.1, 0.2), fit("focal", 0.8, 0.1), fit("rotation", 0.1, 0.0, 0.0, 0.01)))
    hypotheses = {(h.cause, h.stream): h for h in proposed("event_response.alignment.scale", fits)}
    focal, rotation = hypotheses["intrinsics_focal", "metadata"], hypotheses["extrinsic_rotation", "metadata"]
    assert focal.magnitude == pytest.approx(100 / 1.1 - 100)
    assert rotation.magnitude == pytest.approx(np.rad2deg(0.01))
    assert focal.support > 0.7
    assert rotation.support < 0.2


def test_a_focal_length_along_one_axis_is_undone_along_it() -> None:
    """Of the event camera, or the opposite of the colour camera."""
    fits = CameraErrorFits((fit("focal_by_axis", 0.8, 0.0, 0.05),))
    facts = facts_of(memory_sequence())
    code = "event_response.alignment.scale"
    statistic = Statistic("scale", 2.5, "percent", 0.01, "off", code, features=(fits,))
    alarms = [Alarm(Finding("F1", code, "error", "off", Where()), statistic)]
    of_events, of_rgb, *_ = faults_for("intrinsics_focal", "metadata", -4.8, alarms, {}, facts)
    assert isinstance(of_events, FocalLength)
    assert isinstance(of_rgb, FocalLength)
    assert (of_events.camera, of_rgb.camera) == ("events", "rgb")
    assert (of_events.percent, of_events.rows_percent) == (0, pytest.approx(100 / 1.05 - 100))
    assert (of_rgb.percent, of_rgb.rows_percent) == (0, pytest.approx(5.0))


def test_scatter_of_stamps_is_jitter_with_its_size() -> None:
    """A lower bound has no size; events of noise come second."""
    sized, noise = proposed("event_response.jitter.spread", TimestampScatter(1.5, 0.2, saturated=False))
    assert sized == Hypothesis("time_jitter", "events", 0.9, 1.5, "ms", 0.2)
    assert noise == Hypothesis("noise_misdeclared", "events", 0.3)
    bound, _ = proposed("event_response.jitter.spread", TimestampScatter(1.5, 0.2, saturated=True))
    assert bound == Hypothesis("time_jitter", "events", 0.9, None, "ms")


@pytest.mark.parametrize(("length", "is_named"), [(2, False), (3, True)])
def test_frames_that_change_without_their_events_are_of_another_sequence(length: int, is_named: bool) -> None:
    """Two intervals lie beside one wrong frame; a run of three belongs to frames, or events, of another scene."""
    change = np.ones(12)
    correlations = np.full(12, 0.9)
    correlations[4 : 4 + length] = -0.05
    run = longest_unrelated(change, change, correlations)
    assert run == length
    hypotheses = proposed("event_response.frames.change", ChangeAnomalies(0, 0, run))
    assert (("other_sequence", "rgb") in named(hypotheses[:1])) == is_named


def test_frames_of_another_sequence_do_not_stand_out_of_their_like() -> None:
    """Where no interval correlates, that is a fault of the whole file."""
    assert longest_unrelated(np.ones(9), np.ones(9), np.zeros(9)) == 0


@pytest.mark.parametrize(("frames_ms", "first"), [(6.4, "rgb"), (0.0, "events")])
def test_frames_that_left_the_grid_with_depth_are_late_and_not_the_events(frames_ms: float, first: str) -> None:
    """Colour still meets depth, and not flow, IMU and poses; where nothing moved, the events did."""
    facts = facts_of(memory_sequence())
    late = {"rgb": frames_ms, "depth": frames_ms}
    clocks = {name: clock_of(facts.clocks[name].times_ns + round(by * MS), None) for name, by in late.items()}
    of_events, of_frames = whose_offset(-6.4, replace(facts, clocks={**facts.clocks, **clocks}))
    assert (of_frames > of_events) == (first == "rgb")


@pytest.mark.parametrize(("log_residual_ratio", "is_named"), [(0.0, True), (1.0, False)])
def test_an_exposure_that_follows_the_scene_is_left_where_no_threshold_is_wrong(
    log_residual_ratio: float, is_named: bool
) -> None:
    """Without a trial, too; where the other model of events fits, the model is the cause."""
    features = EventStepSize(16.1, 9.78, 0.15, 0.0), DomainPreference(log_residual_ratio, 0.01)
    supports = {h.cause: h.support for h in proposed("event_response.threshold.size", *features, stream="events")}
    assert (supports["exposure_or_gamma"] >= FITS) is is_named
