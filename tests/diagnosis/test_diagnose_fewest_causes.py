"""Findings are explained by the fewest causes, without trials."""

from dataclasses import replace

import pytest

from fedora_qa.checks.flow_geometry.endpoint import FieldsOff
from fedora_qa.checks.images.order import OutOfOrderIntervals
from fedora_qa.checks.pose.continuity import PoseJump
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Measurement, Result
from tests.support.explained_alarms import IS_LATE, alarm, candidates_of, diagnoses_of, undo_trial


def test_one_cause_is_preferred_over_several() -> None:
    """A late event clock that explains three findings is one diagnosis, not three."""
    late = Hypothesis("time_offset", "events", 0.8, 2.06, "ms", 0.03)
    diagnoses = diagnoses_of(
        [
            alarm(1, Hypothesis("threshold_misdeclared", "events", 0.85), late),
            alarm(2, Hypothesis("index_off_by_one", "rgb_to_event", 0.9), late),
            alarm(3, late),
        ]
    )
    assert (diagnoses[0].cause, diagnoses[0].stream) == ("time_offset", "events")
    assert diagnoses[0].explains == ("F1", "F2", "F3")
    assert (diagnoses[0].magnitude, diagnoses[0].unit, diagnoses[0].standard_error) == (2.06, "ms", 0.03)
    assert len(diagnoses) == 1


def test_two_faults_are_two_diagnoses() -> None:
    """What one cause does not explain is left to another."""
    diagnoses = diagnoses_of(
        [alarm(1, Hypothesis("polarity_inverted", "events", 0.9)), alarm(2, Hypothesis("teleport", "pose", 0.9))]
    )
    assert {(d.cause, d.stream) for d in diagnoses} == {("polarity_inverted", "events"), ("teleport", "pose")}


def test_all_rates_of_flow_together_are_flow() -> None:
    """A gain that one rate and the flow as a whole show is one fault of the flow."""
    diagnoses = diagnoses_of(
        [
            alarm(1, Hypothesis("flow_gain", "flow", 0.8, 10.0, "percent")),
            alarm(2, Hypothesis("flow_gain", "flow/10hz", 0.8, 10.0, "percent")),
        ]
    )
    assert [(d.stream, d.explains) for d in diagnoses] == [("flow", ("F1", "F2"))]


def test_one_check_with_many_findings_is_one_witness() -> None:
    """A check that states its misfit for every rate, as a mean and at its worst, does not outvote three others."""
    inverted, shifted = (
        Hypothesis("quaternion_inverted", "pose", 0.95),
        Hypothesis("flow_interval_shifted", "flow", 1.0),
    )
    of_flow = [alarm(i, shifted, code="flow_geometry.endpoint.error") for i in range(1, 7)]
    of_pose = [alarm(7 + i, inverted, code=f"{check}.rule") for i, check in enumerate(("pose.a", "imu.b", "imu.c"))]
    diagnoses = diagnoses_of([*of_flow, *of_pose])
    assert [(d.cause, len(d.explains)) for d in diagnoses] == [("quaternion_inverted", 3), ("flow_interval_shifted", 6)]


def test_what_any_fault_of_a_stream_explains_goes_to_the_one_that_is_named() -> None:
    """Flow that another pose would mend is explained by what else is wrong with the pose, and by nothing of the IMU."""
    another_pose = Hypothesis("teleport", "pose", 0.6, 0.5, "m"), Hypothesis(ANY_CAUSE, "pose", 0.5)
    named = Hypothesis("lever_arm", "pose", 0.9, 0.2, "m"), Hypothesis("accel_bias", "imu", 0.4)
    alarms = [alarm(1, *another_pose, code="flow.rule"), alarm(2, *named, code="pose.rule")]
    diagnoses = diagnoses_of(alarms)[0]
    assert (diagnoses.cause, set(diagnoses.explains), diagnoses.magnitude) == ("lever_arm", {"F1", "F2"}, 0.2)


def test_what_is_hardly_hypothesised_is_not_drawn_in() -> None:
    """A cause that no check names in earnest gains nothing from what any would explain."""
    another_pose = Hypothesis("teleport", "pose", 0.6), Hypothesis(ANY_CAUSE, "pose", 0.55)
    weak = tuple(Hypothesis(cause, "pose", 0.02) for cause in ("unsorted", "time_unit"))
    diagnoses = diagnoses_of(
        [alarm(1, *another_pose, code="flow.rule"), alarm(2, *another_pose, *weak, code="depth.rule")]
    )
    assert [d.cause for d in diagnoses] == ["teleport"]


def test_one_finding_of_many_is_still_named() -> None:
    """What one of thirty findings of a check needs a cause of its own for gets it."""
    many = [alarm(i, Hypothesis("flow_gain", "flow", 0.9)) for i in range(30)]
    diagnoses = diagnoses_of([*many, alarm(30, Hypothesis("teleport", "pose", 0.9))])
    assert [d.cause for d in diagnoses] == ["flow_gain", "teleport"]


def test_nothing_fits_is_unknown() -> None:
    """A finding without a hypothesis is not passed over in silence."""
    diagnoses = diagnoses_of([alarm(1), alarm(2, Hypothesis("teleport", "pose", 0.9))])
    assert [d.cause for d in diagnoses] == ["teleport", "unknown"]
    assert diagnoses[1].explains == ("F1",)


def test_what_is_unknown_of_all_rates_is_unknown_of_flow() -> None:
    """What nothing explains in two rates is one thing that is not known; in one rate, that rate is named."""
    diagnoses = diagnoses_of([alarm(1, stream="flow/10hz"), alarm(2, stream="flow/25hz"), alarm(3, stream="pose")])
    assert [(d.stream, d.explains) for d in diagnoses] == [("flow", ("F1", "F2")), ("pose", ("F3",))]
    assert diagnoses_of([alarm(1, stream="flow/10hz")])[0].stream == "flow/10hz"


def test_no_alarm_no_diagnosis() -> None:
    """Diagnosis runs only after an alarm."""
    assert diagnoses_of([]) == ()


def test_timestamps_that_were_moved_off_a_grid_were_not_late() -> None:
    """Any offset, and any rate, takes timestamps off the grid on which they were: that explains no grid."""
    grid = alarm(1, Hypothesis("quantised_time", "events", 0.95, 1.0, "ms"), code="clocks.resolution.partial_grid")
    late = Hypothesis("time_offset", "events", 0.5, 2.0, "ms")
    diagnoses = diagnoses_of([grid, alarm(2, late)], {IS_LATE: undo_trial("F1", left={"F2": 0.4})})
    assert diagnoses[0].cause == "quantised_time"
    assert all("F1" not in d.explains for d in diagnoses if d.cause == "time_offset")


def test_what_is_only_suggested_comes_behind_what_was_measured() -> None:
    """However many findings it would explain."""
    flow_gain, steps = Hypothesis("flow_gain", "flow", 0.5), Hypothesis("quantised_values", "flow", 0.95)
    explained = [
        *(alarm(i, flow_gain, code=f"rule.{i}") for i in (1, 2, 3)),
        alarm(4, steps, code="integrity.resolution.a"),
    ]
    assert [(d.id, d.cause, d.status) for d in diagnoses_of(explained)] == [
        ("D1", "quantised_values", "supported"),
        ("D2", "flow_gain", "suggested"),
    ]


@pytest.mark.parametrize(
    ("towards", "error", "first"),
    [(0.8, 0.13, "channel_order"), (0.8, 0.3, "mirrored"), (0.4, 0.05, "mirrored")],
)
def test_colours_nearer_to_another_order_are_tried_first(towards: float, error: float, first: str) -> None:
    """Though the check does not state the order: where its bound is large, or colours are few, it may not."""
    measurements = (
        Measurement("towards_BGR", towards, "1", error, 0.0, 1.5, 2.0, side="upper"),
        Measurement("towards_GRB", 0.1, "1", error, 0.0, 1.5, 2.0, side="upper"),
    )
    results = {"images.channels": Result("images.channels", "not_observable", "few colours", measurements=measurements)}
    contradiction = alarm(1, *(Hypothesis(cause, "rgb", 0.3) for cause in ("mirrored", "channel_order")))
    assert candidates_of([contradiction], results)[0].cause == first


@pytest.mark.parametrize(("lines", "first"), [(0.12, "interpolated_frames"), (0.02, "dropped_samples")])
def test_lines_between_frames_of_a_while_explain_what_contradicts_the_law(lines: float, first: str) -> None:
    """They exceed the limit of a correct file, and are too few to matter in the whole."""
    explained = [alarm(1, Hypothesis("dropped_samples", "events", 0.5), code="event_response.conservation.pixels")]
    measurement = Measurement("lines_between_renders", lines, "1", 0.005, 0.0, 0.03, 0.05, side="upper")
    check = "event_response.interpolation"
    ranked = candidates_of(explained, {check: Result(check, "passed", "?", measurements=(measurement,))})
    assert ranked[0].cause == first


@pytest.mark.parametrize(("share", "cause"), [(0.9, "interpolated_frames"), (0.2, "clock_rate")])
def test_lines_of_most_changes_explain_times_that_deviate(share: float, cause: str) -> None:
    """Events that are interpolated have no rate of their own."""
    deviation = [alarm(1, Hypothesis("clock_rate", "events", 0.9, 600.0, "ppm"), code="event_response.timing.offset")]
    measurement = Measurement("lines_between_renders", share, "1", 0.005, 0.0, 0.03, 0.05, side="upper")
    check = "event_response.interpolation"
    ranked = candidates_of(deviation, {check: Result(check, "failed", "?", measurements=(measurement,))})
    assert [candidate.cause for candidate in ranked] == [cause]


def test_a_direct_measurement_supports_what_cannot_be_undone() -> None:
    """A check whose business a cause is measures it; another check's finding merely suggests it."""
    lost = Hypothesis("dropped_samples", "imu", 0.6)
    assert diagnoses_of([alarm(1, lost, code="clocks.gaps.missing", stream="imu")])[0].status == "supported"
    assert diagnoses_of([alarm(1, lost, code="imu.rotation.worst", stream="imu")])[0].status == "suggested"


def test_what_any_fault_would_explain_names_none() -> None:
    """A cause that no check supports well, and that was not tested, is no answer."""
    weak = tuple(Hypothesis(cause, "events", 0.3) for cause in ("hot_pixels", "dead_region", "time_jitter"))
    assert [(d.cause, d.status) for d in diagnoses_of([alarm(1, *weak)])] == [("unknown", "unidentified")]


def test_a_silence_with_events_that_are_off_is_a_clock_that_was_set() -> None:
    """A silence alone is a loss; beside a part of the events that are late it is the step of their clock."""
    silence = alarm(
        1,
        Hypothesis("dropped_samples", "events", 0.95, 900.0, "samples"),
        Hypothesis("time_offset", "events", 0.3),
        code="event_stream.gaps.silence",
    )
    late = alarm(2, Hypothesis("time_offset", "events", 0.95, 20.0, "ms"), code="event_response.conservation.region")
    lost = alarm(2, Hypothesis("dropped_samples", "events", 0.5), code="event_response.conservation.region")
    assert diagnoses_of([silence])[0].cause == diagnoses_of([silence, lost])[0].cause == "dropped_samples"
    assert (diagnoses_of([silence, late])[0].cause, diagnoses_of([silence, late])[0].magnitude) == ("time_offset", 20.0)


@pytest.mark.parametrize(("beside", "first"), [(1, "unknown"), (0, "dropped_samples")])
def test_a_suggestion_for_half_of_the_findings_comes_behind_what_no_cause_explains(beside: int, first: str) -> None:
    """One fault is likelier than two, and the suggested one leaves the others."""
    lost = Hypothesis("dropped_samples", "events", 0.4)
    alarms = [
        alarm(1, lost, code="event_response.conservation.pixels"),
        alarm(2, lost, code="event_response.frames.off"),
        *(alarm(3 + n, code=f"flow_photometric.r{n}.off", stream="flow") for n in range(1 + beside)),
    ]
    diagnoses = diagnoses_of(alarms)
    assert diagnoses[0].cause == first
    assert {d.cause for d in diagnoses} == {"dropped_samples", "unknown"}
    assert [d.id for d in diagnoses] == ["D1", "D2"]


def test_frames_that_stand_still_are_not_exchanged() -> None:
    """The displacements of exchanged frames are 2, -1 and 2 of the flow."""
    explained = alarm(1, Hypothesis("swapped_frames", "rgb", 0.8), Hypothesis("frozen_frames", "rgb", 0.5))
    for ratios, first in (((0.0, 0.02, 0.1), "frozen_frames"), ((2.0, -1.0, 2.0), "swapped_frames")):
        intervals = OutOfOrderIntervals(ratios, None, False)
        statistic = replace(explained[0].statistic, features=(intervals,))
        assert diagnoses_of([(Alarm(explained[0].finding, statistic), explained[1])])[0].cause == first


@pytest.mark.parametrize(("repeats", "beside", "cause"), [(0, False, "teleport"), (0, True, "frozen_frames"),
                                                          (2, False, "frozen_frames")])  # fmt: skip
def test_a_pose_that_never_repeats_is_not_frozen(repeats: int, beside: bool, cause: str) -> None:
    """Repeats are counted bit by bit, of poses and, at a jump, of positions alone."""
    counted = Measurement("frozen", repeats, "poses", 0.0, 0.0, 0.0, 1.0)
    results = {"pose.continuity": Result("pose.continuity", "failed", "", measurements=(counted,))}
    still, moved = Hypothesis("frozen_frames", "pose", 0.9), Hypothesis("teleport", "pose", 0.8)
    failure, hypotheses = alarm(1, still, moved, code="pose.continuity.position", stream="pose")
    jump = replace(failure.statistic, features=(PoseJump(beside),))
    assert diagnoses_of([(Alarm(failure.finding, jump), hypotheses)], results=results)[0].cause == cause


@pytest.mark.parametrize("part", [None, (45, 35, 135, 102)])
@pytest.mark.parametrize("cause", ["time_offset", "swapped_frames"])
def test_whole_images_are_not_moved_where_a_part_deviates(cause: str, part: tuple[int, int, int, int] | None) -> None:
    """A clock has no part of the image; beside a finding of timestamps it is still the cause."""
    rate = "flow/50hz"
    moved, shifted = Hypothesis(cause, "flow", 0.95), Hypothesis("flow_interval_shifted", "flow", 0.9)
    failure, hypotheses = alarm(1, moved, shifted, code="flow_geometry.endpoint.error", stream=rate)
    of_part = replace(failure.statistic, features=(FieldsOff(5, 0.2, part is not None, 0, 0, part, 0, 80),))
    explained = [(Alarm(failure.finding, of_part), hypotheses)]
    assert diagnoses_of(explained)[0].cause == (cause if part is None else "flow_interval_shifted")
    stamped = alarm(2, moved, code="flow_geometry.interval_timestamps.start", stream=rate)
    assert diagnoses_of([*explained, stamped])[0].cause == cause
