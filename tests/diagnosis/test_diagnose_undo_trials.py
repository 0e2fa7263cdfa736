"""What undoing a fault clears, leaves or brings about decides between causes."""

from dataclasses import replace
from typing import Any

import pytest

from fedora_qa.diagnosis.clock_grids import ClockPlace
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.faults.image_part import ImagePart
from fedora_qa.faults.pixels import PixelShift
from tests.support.explained_alarms import BOTH, IS_LATE, IS_SHIFTED, LATE, SHIFTED, alarm, diagnoses_of, undo_trial


def test_what_clears_the_findings_is_the_cause() -> None:
    """However well another cause fits: undone, it leaves them."""
    diagnoses = diagnoses_of(
        BOTH, {IS_LATE: undo_trial("F1", "F2"), IS_SHIFTED: undo_trial(left={"F1": 0.9, "F2": 1.3})}
    )
    assert [(d.cause, d.status, d.cleared) for d in diagnoses] == [("time_offset", "confirmed", ("F1", "F2"))]


def test_what_a_weak_cause_clears_of_a_check_that_it_leaves_is_chance() -> None:
    """A measurement is preferred; a cause that clears all findings of another check keeps its trial."""
    weak = Hypothesis("exposure_or_gamma", "rgb", 0.3)
    lost = Hypothesis("dropped_samples", "events", 0.4)
    pixels = "event_response.conservation.pixels"
    explained = [alarm(1, weak, lost, code=pixels), alarm(2, weak, lost, code="event_response.conservation.region")]
    of_curve = {("exposure_or_gamma", "rgb"): undo_trial("F2", left={"F1": 0.7})}
    assert [(d.cause, d.status) for d in diagnoses_of(explained, of_curve)] == [("dropped_samples", "suggested")]
    explained = [alarm(1, weak, lost, code=pixels), alarm(2, weak, lost, code="images.exposure.jump")]
    assert diagnoses_of(explained, of_curve)[0].cause == "exposure_or_gamma"


def test_what_vanishes_by_construction_is_no_evidence() -> None:
    """Sorted timestamps are in order, whatever has disordered them: a clock that was set back stays ahead."""
    set_back, unsorted = Hypothesis("time_offset", "events", 0.97, 4.0, "ms"), Hypothesis("unsorted", "events", 0.3)
    of_order = {("unsorted", "events"): undo_trial("F1"), IS_LATE: undo_trial(left={"F1": 1.0})}
    explained = [alarm(1, set_back, unsorted, code="clocks.order.backward_steps")]
    assert [(d.cause, d.status) for d in diagnoses_of(explained, of_order)] == [("time_offset", "suggested")]
    explained = [alarm(1, unsorted, code="clocks.order.backward_steps")]
    assert [(d.cause, d.status) for d in diagnoses_of(explained, of_order)] == [("unsorted", "confirmed")]


def test_events_that_are_left_out_repeat_no_more() -> None:
    """Whether they were written twice, or were given one timestamp; what else their trial brings about counts not."""
    twice, together = Hypothesis("duplicated_samples", "events", 0.9), Hypothesis("quantised_time", "events", 0.5)
    trials = {("duplicated_samples", "events"): undo_trial("F1", caused=("event_response.conservation.pixels",))}
    code = "event_stream.duplicates.event"
    assert diagnoses_of([alarm(1, twice, together, code=code)], trials)[0].cause == "duplicated_samples"
    less = replace(twice, support=0.2)
    assert diagnoses_of([alarm(1, less, together, code=code)], trials)[0].cause == "quantised_time"


@pytest.mark.parametrize(("others", "status"), [((), "confirmed"), (("clocks.gaps.jump",), "supported")])
def test_a_rate_is_not_confirmed_beside_another_finding_of_clocks(others: tuple[str, ...], status: str) -> None:
    """Stretched timestamps have the nominal period by construction; a jump beside it asks for another cause of both."""
    rate = alarm(1, Hypothesis("clock_rate", "events", 0.8, 9400.0, "ppm"), code="clocks.rate.error")
    lost = Hypothesis("dropped_samples", "events", 0.5)
    diagnoses = diagnoses_of(
        [rate, *(alarm(2, lost, code=code) for code in others)], {("clock_rate", "events"): undo_trial("F1")}
    )
    assert [d.status for d in diagnoses if d.cause == "clock_rate"] == [status]


def test_what_only_brings_about_findings_is_no_cause() -> None:
    """Undoing it leaves nothing that could be judged, clears nothing, and other findings appear."""
    assert diagnoses_of(BOTH, {IS_SHIFTED: undo_trial()})[0].cause == "spatial_offset"
    assert diagnoses_of(BOTH, {IS_SHIFTED: undo_trial(caused=("other.rule",))})[0].cause == "time_offset"


def test_what_clears_all_of_several_checks_outweighs_a_measurement_at_a_place() -> None:
    """A delay fits a part of the file, and undoing it leaves a part; a focal length clears what all checks show."""
    late = Hypothesis("time_offset", "events", 0.95)
    focal = Hypothesis("intrinsics_focal", "metadata", 0.6, 2.0, "percent")
    explained = [
        alarm(1, late, code="event_response.conservation.region"),
        alarm(2, Hypothesis("time_offset", "events", 0.5), code="alignment.events.shift"),
        alarm(3, focal, code="flow_photometric.residual.gain", stream="flow"),
    ]
    of_focal, of_delay = ("intrinsics_focal", "metadata"), undo_trial(left={"F1": 0.3, "F3": 1.0})
    diagnoses = diagnoses_of(explained, {IS_LATE: of_delay, of_focal: undo_trial("F1", "F3")})
    assert (diagnoses[0].cause, diagnoses[0].explains) == ("intrinsics_focal", ("F3", "F1"))
    # Where something is left, what no check would explain by the cause counts as chance first.
    diagnoses = diagnoses_of(explained, {IS_LATE: of_delay, of_focal: undo_trial("F1", left={"F3": 0.9})})
    assert diagnoses[0].cause == "time_offset"
    # But for what the error of a fitted size leaves.
    diagnoses = diagnoses_of(explained, {IS_LATE: of_delay, of_focal: undo_trial("F1", left={"F3": 0.018})})
    assert diagnoses[0].cause == "intrinsics_focal"


def test_nothing_is_confirmed_while_a_rival_is_untested() -> None:
    """A rival that could be undone and was not may clear as much."""
    assert [d.status for d in diagnoses_of(BOTH, {IS_LATE: undo_trial("F1", "F2")})] == ["supported"]


def test_a_fault_that_was_undone_in_a_rectangle_lies_there() -> None:
    """The finding states the pixel where it is worst; a trial that clears nothing moves it nowhere."""
    part: Any = ImagePart(PixelShift("rgb", 3), (10, 20, 30, 40))
    for cleared, tile in ((("F1", "F2"), (10, 20, 30, 40)), ((), None)):
        trial = replace(undo_trial(*cleared), fault=part)
        first, *_ = diagnoses_of(BOTH, {IS_SHIFTED: trial})
        assert (first.cause, first.where.tile) == ("spatial_offset", tile)


def test_rivals_that_clear_alike_are_all_named() -> None:
    """The better supported of two is named first, with the other among what was tried; neither is confirmed."""
    diagnoses = diagnoses_of(BOTH, {IS_LATE: undo_trial("F1", "F2"), IS_SHIFTED: undo_trial("F1", "F2")})
    assert [(d.cause, d.status, len(d.tried)) for d in diagnoses] == [("spatial_offset", "supported", 2)]


@pytest.mark.parametrize(
    ("code", "left", "status"),
    [
        ("imu.translation.lever", {}, "supported"),
        ("imu.translation.lever", {"F1": 0.9}, "confirmed"),
        ("flow_geometry.endpoint.error", {}, "confirmed"),
    ],
)
def test_the_arm_of_the_imu_is_tried_as_that_of_the_poses(code: str, left: dict[str, float], status: str) -> None:
    """Undoing the arm of the poses clears what the IMU states, or leaves it; what flow states is of the poses alone."""
    arm = Hypothesis("lever_arm", "imu", 0.9, 0.1, "m")
    findings = [alarm(1, Hypothesis("gravity_magnitude", "imu", 0.95, 0.1, "m/s^2"), arm, code=code)]
    of_poses = undo_trial(*({"F1"} - left.keys()), left=left, caused=("flow_geometry.endpoint.error",))
    trials = {("gravity_magnitude", "imu"): undo_trial("F1"), ("lever_arm", "pose"): of_poses}
    (diagnosis,) = diagnoses_of(findings, trials)
    assert (diagnosis.cause, diagnosis.status) == ("gravity_magnitude", status)


def test_a_clock_out_of_place_is_the_odd_stream() -> None:
    """Of two clocks whose offset clears alike, that which leaves the grid of all others is late."""
    events, rgb = LATE, Hypothesis("time_offset", "rgb", 0.4, -2.0, "ms", 0.1)
    trials = {IS_LATE: undo_trial("F1"), ("time_offset", "rgb"): undo_trial("F1")}
    explained = [alarm(1, events, rgb)]
    assert diagnoses_of(explained, trials)[0].stream == "events"
    assert diagnoses_of(explained, trials, places={"rgb": ClockPlace("out", 20.0)})[0].stream == "rgb"
    assert [(d.stream, d.status) for d in diagnoses_of(explained, trials, places={"rgb": ClockPlace("in", 20.0)})] == [
        ("events", "confirmed")
    ]


def test_what_a_trial_causes_counts_against_it() -> None:
    """A cause that clears two findings and brings two others about is not confirmed."""
    trials = {
        IS_LATE: undo_trial("F1", "F2", caused=("a.new.one", "another.new.one")),
        IS_SHIFTED: undo_trial(left={"F1": 1.0}),
    }
    assert [(d.cause, d.status) for d in diagnoses_of(BOTH, trials)] == [("time_offset", "supported")]


def test_a_cause_whose_undoing_clears_all_comes_before_one_that_leaves_some() -> None:
    """However much else the other one would explain, where two checks agree: one check may be cleared by chance."""
    further = Hypothesis("spatial_offset", "events", 0.9, 3.0, "px", 0.1)
    alarms = [*BOTH, *(alarm(i, further, code=f"rule.{i}") for i in (3, 4, 5))]
    nearly = undo_trial("F1", left={"F2": 0.18})
    assert diagnoses_of(alarms, {IS_LATE: undo_trial("F1"), IS_SHIFTED: nearly})[0].cause == "spatial_offset"
    assert diagnoses_of(alarms, {IS_LATE: undo_trial("F1", "F2"), IS_SHIFTED: nearly})[0].cause == "time_offset"
    with_others = undo_trial("F1", "F2", caused=("a.new.one",))
    assert diagnoses_of(alarms, {IS_LATE: with_others, IS_SHIFTED: nearly})[0].cause == "spatial_offset"
    of_one_check = [alarm(1, LATE, SHIFTED), alarm(2, LATE, SHIFTED), *alarms[2:]]
    assert (
        diagnoses_of(of_one_check, {IS_LATE: undo_trial("F1", "F2"), IS_SHIFTED: nearly})[0].cause == "spatial_offset"
    )


def test_a_cause_is_named_once() -> None:
    """Undone, it clears one finding and leaves another entirely, which stays without a cause."""
    partly = undo_trial("F1", left={"F2": 1.4}, caused=("a.new.one",))
    named = diagnoses_of(BOTH, {IS_LATE: partly, IS_SHIFTED: undo_trial(left={"F1": 1.0, "F2": 1.0})})
    assert [(d.cause, d.explains) for d in named] == [("time_offset", ("F1",)), ("unknown", ("F2",))]


def test_a_trial_that_doubles_more_than_it_clears_is_no_evidence() -> None:
    """A focal length that is fitted to depth of another sequence clears one finding, and enlarges what it leaves."""
    other, longer = Hypothesis("other_sequence", "depth", 0.7), Hypothesis("intrinsics_focal", "metadata", 0.6)
    alarms = [
        *(alarm(n, other, code=f"flow_geometry.endpoint.r{n}", stream="flow") for n in (1, 2)),
        alarm(3, longer, code="depth.consistency.frame", stream="depth"),
    ]
    trial = undo_trial("F3", left={"F1": 1.9, "F2": 5.3})
    assert diagnoses_of(alarms, {("intrinsics_focal", "metadata"): trial})[0].cause == "intrinsics_focal"
    trial = replace(trial, left={"F1": 2.1, "F2": 5.3})
    assert diagnoses_of(alarms, {("intrinsics_focal", "metadata"): trial})[0].cause == "other_sequence"
