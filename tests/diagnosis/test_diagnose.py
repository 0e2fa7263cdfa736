"""Findings are explained by the fewest causes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import pytest

from fedora_qa.checks.flow_geometry.endpoint import FieldsOff
from fedora_qa.checks.images.order import OutOfOrderIntervals
from fedora_qa.checks.pose.continuity import PoseJump
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.candidates import CauseCandidate
from fedora_qa.diagnosis.clock_grids import ClockPlace
from fedora_qa.diagnosis.conclusion import UndoTrial
from fedora_qa.diagnosis.diagnose import choose_causes, rank_candidates
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.image_part import ImagePart
from fedora_qa.faults.pixels import PixelShift
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Diagnosis, Finding, Measurement, Result, Where

Explained = tuple[Alarm, tuple[Hypothesis, ...]]
"""An alarm with its hypotheses."""


def alarm(number: int, *hypotheses: Hypothesis, code: str = "toy.rule", stream: str = "events") -> Explained:
    where = Where(stream=stream)
    statistic = Statistic("toy", 1.0, "1", 0.0, "off", code, where)
    return Alarm(Finding(f"F{number}", code, "error", "off", where), statistic), hypotheses


def diagnosed(
    explained: Sequence[Explained],
    trials: Mapping[tuple[str, str], UndoTrial] = MappingProxyType({}),
    results: Mapping[str, Result] = MappingProxyType({}),
    places: Mapping[str, ClockPlace] = MappingProxyType({}),
) -> tuple[Diagnosis, ...]:
    alarms = [each for each, _ in explained]
    return choose_causes(alarms, {a.finding.id: hypotheses for a, hypotheses in explained}, trials, results, places)


def rank_of(explained: Sequence[Explained], results: Mapping[str, Result]) -> list[CauseCandidate]:
    return rank_candidates([each for each, _ in explained], {a.finding.id: h for a, h in explained}, results)


def test_one_cause_is_preferred_over_several() -> None:
    """A late event clock that explains three findings is one diagnosis, not three."""
    late = Hypothesis("time_offset", "events", 0.8, 2.06, "ms", 0.03)
    found = diagnosed(
        [
            alarm(1, Hypothesis("threshold_misdeclared", "events", 0.85), late),
            alarm(2, Hypothesis("index_off_by_one", "rgb_to_event", 0.9), late),
            alarm(3, late),
        ]
    )
    assert (found[0].cause, found[0].stream) == ("time_offset", "events")
    assert found[0].explains == ("F1", "F2", "F3")
    assert (found[0].magnitude, found[0].unit, found[0].standard_error) == (2.06, "ms", 0.03)
    assert len(found) == 1


def test_sizes_of_either_sign_are_no_one_fault() -> None:
    """An offset that is late by one finding and early by another explains only those that agree."""
    late, early = (Hypothesis("time_offset", "rgb", 0.45, size, "ms") for size in (20.0, -20.0))
    frozen = Hypothesis("frozen_frames", "rgb", 0.95, 3.0, "samples")
    found = diagnosed([alarm(1, late), alarm(2, late), alarm(3, early), alarm(4, frozen)])
    assert [(d.cause, d.explains) for d in found[:2]] == [("frozen_frames", ("F4",)), ("time_offset", ("F1", "F2"))]
    assert found[1].magnitude == 20.0


def test_a_finding_keeps_the_size_of_the_sign_that_the_others_have() -> None:
    """Two measurements of a rate by one finding, of which the weaker one agrees with the other findings, explain it."""
    fast, slow = (Hypothesis("clock_rate", "imu", 0.8, size, "ppm") for size in (60.0, -90.0))
    weaker = Hypothesis("clock_rate", "imu", 0.6, 50.0, "ppm")
    found = diagnosed([alarm(1, fast), alarm(2, fast), alarm(3, slow, weaker)])
    assert [(d.cause, d.explains) for d in found] == [("clock_rate", ("F1", "F2", "F3"))]
    assert (found[0].magnitude or 0) > 0


def test_a_size_that_is_not_known_contradicts_nothing() -> None:
    """A hypothesis without a size stands beside those of either sign."""
    early, some = Hypothesis("time_offset", "rgb", 0.9, -2.0, "ms"), Hypothesis("time_offset", "rgb", 0.3)
    assert diagnosed([alarm(1, early), alarm(2, some)])[0].explains == ("F1", "F2")


def test_two_faults_are_two_diagnoses() -> None:
    """What one cause does not explain is left to another."""
    found = diagnosed(
        [alarm(1, Hypothesis("polarity_inverted", "events", 0.9)), alarm(2, Hypothesis("teleport", "pose", 0.9))]
    )
    assert {(d.cause, d.stream) for d in found} == {("polarity_inverted", "events"), ("teleport", "pose")}


def test_all_rates_of_flow_together_are_flow() -> None:
    """A gain that one rate and the flow as a whole show is one fault of the flow."""
    found = diagnosed(
        [
            alarm(1, Hypothesis("flow_gain", "flow", 0.8, 10.0, "percent")),
            alarm(2, Hypothesis("flow_gain", "flow/10hz", 0.8, 10.0, "percent")),
        ]
    )
    assert [(d.stream, d.explains) for d in found] == [("flow", ("F1", "F2"))]


def test_one_check_with_many_findings_is_one_witness() -> None:
    """A check that states its misfit for every rate, as a mean and at its worst, does not outvote three others."""
    inverted, shifted = (
        Hypothesis("quaternion_inverted", "pose", 0.95),
        Hypothesis("flow_interval_shifted", "flow", 1.0),
    )
    of_flow = [alarm(i, shifted, code="flow_geometry.endpoint.error") for i in range(1, 7)]
    of_pose = [alarm(7 + i, inverted, code=f"{check}.rule") for i, check in enumerate(("pose.a", "imu.b", "imu.c"))]
    found = diagnosed([*of_flow, *of_pose])
    assert [(d.cause, len(d.explains)) for d in found] == [("quaternion_inverted", 3), ("flow_interval_shifted", 6)]


def test_what_any_fault_of_a_stream_explains_goes_to_the_one_that_is_named() -> None:
    """Flow that another pose would mend is explained by what else is wrong with the pose, and by nothing of the IMU."""
    another_pose = Hypothesis("teleport", "pose", 0.6, 0.5, "m"), Hypothesis(ANY_CAUSE, "pose", 0.5)
    named = Hypothesis("lever_arm", "pose", 0.9, 0.2, "m"), Hypothesis("accel_bias", "imu", 0.4)
    alarms = [alarm(1, *another_pose, code="flow.rule"), alarm(2, *named, code="pose.rule")]
    found = diagnosed(alarms)[0]
    assert (found.cause, set(found.explains), found.magnitude) == ("lever_arm", {"F1", "F2"}, 0.2)


def test_what_is_hardly_hypothesised_is_not_drawn_in() -> None:
    """A cause that no check names in earnest gains nothing from what any would explain."""
    another_pose = Hypothesis("teleport", "pose", 0.6), Hypothesis(ANY_CAUSE, "pose", 0.55)
    weak = tuple(Hypothesis(cause, "pose", 0.02) for cause in ("unsorted", "time_unit"))
    found = diagnosed([alarm(1, *another_pose, code="flow.rule"), alarm(2, *another_pose, *weak, code="depth.rule")])
    assert [d.cause for d in found] == ["teleport"]


def test_one_finding_of_many_is_still_named() -> None:
    """What one of thirty findings of a check needs a cause of its own for gets it."""
    many = [alarm(i, Hypothesis("flow_gain", "flow", 0.9)) for i in range(30)]
    found = diagnosed([*many, alarm(30, Hypothesis("teleport", "pose", 0.9))])
    assert [d.cause for d in found] == ["flow_gain", "teleport"]


def test_nothing_fits_is_unknown() -> None:
    """A finding without a hypothesis is not passed over in silence."""
    found = diagnosed([alarm(1), alarm(2, Hypothesis("teleport", "pose", 0.9))])
    assert [d.cause for d in found] == ["teleport", "unknown"]
    assert found[1].explains == ("F1",)


def test_what_is_unknown_of_all_rates_is_unknown_of_flow() -> None:
    """What nothing explains in two rates is one thing that is not known; in one rate, that rate is named."""
    found = diagnosed([alarm(1, stream="flow/10hz"), alarm(2, stream="flow/25hz"), alarm(3, stream="pose")])
    assert [(d.stream, d.explains) for d in found] == [("flow", ("F1", "F2")), ("pose", ("F3",))]
    assert diagnosed([alarm(1, stream="flow/10hz")])[0].stream == "flow/10hz"


def test_no_alarm_no_diagnosis() -> None:
    """Diagnosis runs only after an alarm."""
    assert diagnosed([]) == ()


@dataclass(frozen=True)
class Undone:
    """A fault of a size that a test states, which is never planted."""

    cause: str
    stream: str
    magnitude: float | None = None


def tried(
    *cleared: str, left: Mapping[str, float] | None = None, caused: Sequence[str] = (), size: float = 2.0
) -> UndoTrial:
    fault: Any = Undone("a cause", "a stream", size)
    return UndoTrial(fault, "it is undone", frozenset(cleared), left or {}, tuple(caused), 4)


LATE = Hypothesis("time_offset", "events", 0.5, 2.0, "ms", 0.1)
SHIFTED = Hypothesis("spatial_offset", "events", 0.9, 3.0, "px", 0.1)
BOTH = [alarm(1, LATE, SHIFTED), alarm(2, LATE, SHIFTED, code="other.rule")]
IS_LATE, IS_SHIFTED = ("time_offset", "events"), ("spatial_offset", "events")


def test_what_clears_the_findings_is_the_cause() -> None:
    """However well another cause fits: undone, it leaves them."""
    found = diagnosed(BOTH, {IS_LATE: tried("F1", "F2"), IS_SHIFTED: tried(left={"F1": 0.9, "F2": 1.3})})
    assert [(d.cause, d.status, d.cleared) for d in found] == [("time_offset", "confirmed", ("F1", "F2"))]


def test_what_a_weak_cause_clears_of_a_check_that_it_leaves_is_chance() -> None:
    """A measurement is preferred; a cause that clears all findings of another check keeps its trial."""
    weak = Hypothesis("exposure_or_gamma", "rgb", 0.3)
    lost = Hypothesis("dropped_samples", "events", 0.4)
    pixels = "event_response.conservation.pixels"
    shown = [alarm(1, weak, lost, code=pixels), alarm(2, weak, lost, code="event_response.conservation.region")]
    of_curve = {("exposure_or_gamma", "rgb"): tried("F2", left={"F1": 0.7})}
    assert [(d.cause, d.status) for d in diagnosed(shown, of_curve)] == [("dropped_samples", "suggested")]
    shown = [alarm(1, weak, lost, code=pixels), alarm(2, weak, lost, code="images.exposure.jump")]
    assert diagnosed(shown, of_curve)[0].cause == "exposure_or_gamma"


def test_timestamps_that_were_moved_off_a_grid_were_not_late() -> None:
    """Any offset, and any rate, takes timestamps off the grid on which they were: that explains no grid."""
    grid = alarm(1, Hypothesis("quantised_time", "events", 0.95, 1.0, "ms"), code="clocks.resolution.partial_grid")
    late = Hypothesis("time_offset", "events", 0.5, 2.0, "ms")
    found = diagnosed([grid, alarm(2, late)], {IS_LATE: tried("F1", left={"F2": 0.4})})
    assert found[0].cause == "quantised_time"
    assert all("F1" not in d.explains for d in found if d.cause == "time_offset")


def test_what_vanishes_by_construction_is_no_evidence() -> None:
    """Sorted timestamps are in order, whatever has disordered them: a clock that was set back stays ahead."""
    set_back, unsorted = Hypothesis("time_offset", "events", 0.97, 4.0, "ms"), Hypothesis("unsorted", "events", 0.3)
    of_order = {("unsorted", "events"): tried("F1"), IS_LATE: tried(left={"F1": 1.0})}
    shown = [alarm(1, set_back, unsorted, code="clocks.order.backward_steps")]
    assert [(d.cause, d.status) for d in diagnosed(shown, of_order)] == [("time_offset", "suggested")]
    shown = [alarm(1, unsorted, code="clocks.order.backward_steps")]
    assert [(d.cause, d.status) for d in diagnosed(shown, of_order)] == [("unsorted", "confirmed")]


def test_events_that_are_left_out_repeat_no_more() -> None:
    """Whether they were written twice, or were given one timestamp; what else their trial brings about counts not."""
    twice, together = Hypothesis("duplicated_samples", "events", 0.9), Hypothesis("quantised_time", "events", 0.5)
    trials = {("duplicated_samples", "events"): tried("F1", caused=("event_response.conservation.pixels",))}
    code = "event_stream.duplicates.event"
    assert diagnosed([alarm(1, twice, together, code=code)], trials)[0].cause == "duplicated_samples"
    less = replace(twice, support=0.2)
    assert diagnosed([alarm(1, less, together, code=code)], trials)[0].cause == "quantised_time"


def test_what_is_only_suggested_comes_behind_what_was_measured() -> None:
    """However many findings it would explain."""
    flow_gain, steps = Hypothesis("flow_gain", "flow", 0.5), Hypothesis("quantised_values", "flow", 0.95)
    shown = [
        *(alarm(i, flow_gain, code=f"rule.{i}") for i in (1, 2, 3)),
        alarm(4, steps, code="integrity.resolution.a"),
    ]
    assert [(d.id, d.cause, d.status) for d in diagnosed(shown)] == [
        ("D1", "quantised_values", "supported"),
        ("D2", "flow_gain", "suggested"),
    ]


@pytest.mark.parametrize(("others", "status"), [((), "confirmed"), (("clocks.gaps.jump",), "supported")])
def test_a_rate_is_not_confirmed_beside_another_finding_of_clocks(others: tuple[str, ...], status: str) -> None:
    """Stretched timestamps have the nominal period by construction; a jump beside it asks for another cause of both."""
    rate = alarm(1, Hypothesis("clock_rate", "events", 0.8, 9400.0, "ppm"), code="clocks.rate.error")
    lost = Hypothesis("dropped_samples", "events", 0.5)
    found = diagnosed([rate, *(alarm(2, lost, code=code) for code in others)], {("clock_rate", "events"): tried("F1")})
    assert [d.status for d in found if d.cause == "clock_rate"] == [status]


@pytest.mark.parametrize(
    ("factor", "trial", "cause"),
    [
        pytest.param(0.4, tried("F1"), "truncated", id="by construction"),
        pytest.param(0.4, replace(tried("F1"), agreeing=frozenset({"imu.timing"})), "time_unit", id="content agrees"),
        pytest.param(0.4, replace(tried("F1"), agreeing=frozenset({"imu.noise"})), "truncated", id="no comparison"),
        pytest.param(0.4, tried("F1", "F2"), "time_unit", id="clears content"),
        pytest.param(0.4, tried("F1", "F2", caused=("imu.timing.time_offset",)), "truncated", id="brings some about"),
        pytest.param(1e3, tried("F1"), "time_unit", id="known unit"),
    ],
)
def test_a_stream_that_is_short_has_another_unit_where_its_content_agrees_with_it_undone(
    factor: float, trial: UndoTrial, cause: str
) -> None:
    """Stretched to the span of the others, a stream that was cut off ends with them, and agrees with none of them."""
    unit, cut = Hypothesis("time_unit", "imu", 0.7, factor, "1"), Hypothesis("truncated", "imu", 0.8, 60.0, "percent")
    shown = [alarm(1, unit, cut, code="clocks.span.ends_early")]
    if "F2" in trial.cleared:
        shown.append(alarm(2, Hypothesis("other_sequence", "imu", 0.3), code="imu.rotation.residual"))
    of_imu: Any = Undone("time_unit", "imu", factor)
    assert diagnosed(shown, {("time_unit", "imu"): replace(trial, fault=of_imu)})[0].cause == cause


def test_what_only_brings_about_findings_is_no_cause() -> None:
    """Undoing it leaves nothing that could be judged, clears nothing, and other findings appear."""
    assert diagnosed(BOTH, {IS_SHIFTED: tried()})[0].cause == "spatial_offset"
    assert diagnosed(BOTH, {IS_SHIFTED: tried(caused=("other.rule",))})[0].cause == "time_offset"


def test_what_clears_all_of_several_checks_outweighs_a_measurement_at_a_place() -> None:
    """A delay fits a part of the file, and undoing it leaves a part; a focal length clears what all checks show."""
    late = Hypothesis("time_offset", "events", 0.95)
    focal = Hypothesis("intrinsics_focal", "metadata", 0.6, 2.0, "percent")
    shown = [
        alarm(1, late, code="event_response.conservation.region"),
        alarm(2, Hypothesis("time_offset", "events", 0.5), code="alignment.events.shift"),
        alarm(3, focal, code="flow_photometric.residual.gain", stream="flow"),
    ]
    of_focal, of_delay = ("intrinsics_focal", "metadata"), tried(left={"F1": 0.3, "F3": 1.0})
    found = diagnosed(shown, {IS_LATE: of_delay, of_focal: tried("F1", "F3")})
    assert (found[0].cause, found[0].explains) == ("intrinsics_focal", ("F3", "F1"))
    # Where something is left, what no check would explain by the cause counts as chance first.
    found = diagnosed(shown, {IS_LATE: of_delay, of_focal: tried("F1", left={"F3": 0.9})})
    assert found[0].cause == "time_offset"
    # But for what the error of a fitted size leaves.
    found = diagnosed(shown, {IS_LATE: of_delay, of_focal: tried("F1", left={"F3": 0.018})})
    assert found[0].cause == "intrinsics_focal"


def test_nothing_is_confirmed_while_a_rival_is_untested() -> None:
    """A rival that could be undone and was not may clear as much."""
    assert [d.status for d in diagnosed(BOTH, {IS_LATE: tried("F1", "F2")})] == ["supported"]


def test_a_fault_that_was_undone_in_a_rectangle_lies_there() -> None:
    """The finding states the pixel where it is worst; a trial that clears nothing moves it nowhere."""
    part: Any = ImagePart(PixelShift("rgb", 3), (10, 20, 30, 40))
    for cleared, tile in ((("F1", "F2"), (10, 20, 30, 40)), ((), None)):
        trial = replace(tried(*cleared), fault=part)
        first, *_ = diagnosed(BOTH, {IS_SHIFTED: trial})
        assert (first.cause, first.where.tile) == ("spatial_offset", tile)


def test_rivals_that_clear_alike_are_all_named() -> None:
    """The better supported of two is named first, with the other among what was tried; neither is confirmed."""
    found = diagnosed(BOTH, {IS_LATE: tried("F1", "F2"), IS_SHIFTED: tried("F1", "F2")})
    assert [(d.cause, d.status, len(d.tried)) for d in found] == [("spatial_offset", "supported", 2)]


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
    of_poses = tried(*({"F1"} - left.keys()), left=left, caused=("flow_geometry.endpoint.error",))
    trials = {("gravity_magnitude", "imu"): tried("F1"), ("lever_arm", "pose"): of_poses}
    (diagnosis,) = diagnosed(findings, trials)
    assert (diagnosis.cause, diagnosis.status) == ("gravity_magnitude", status)


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
    assert rank_of([contradiction], results)[0].cause == first


@pytest.mark.parametrize(("lines", "first"), [(0.12, "interpolated_frames"), (0.02, "dropped_samples")])
def test_lines_between_frames_of_a_while_explain_what_contradicts_the_law(lines: float, first: str) -> None:
    """They exceed the limit of a correct file, and are too few to matter in the whole."""
    explained = [alarm(1, Hypothesis("dropped_samples", "events", 0.5), code="event_response.conservation.pixels")]
    measurement = Measurement("lines_between_renders", lines, "1", 0.005, 0.0, 0.03, 0.05, side="upper")
    check = "event_response.interpolation"
    ranked = rank_of(explained, {check: Result(check, "passed", "?", measurements=(measurement,))})
    assert ranked[0].cause == first


@pytest.mark.parametrize(("share", "cause"), [(0.9, "interpolated_frames"), (0.2, "clock_rate")])
def test_lines_of_most_changes_explain_times_that_deviate(share: float, cause: str) -> None:
    """Events that are interpolated have no rate of their own."""
    deviation = [alarm(1, Hypothesis("clock_rate", "events", 0.9, 600.0, "ppm"), code="event_response.timing.offset")]
    measurement = Measurement("lines_between_renders", share, "1", 0.005, 0.0, 0.03, 0.05, side="upper")
    check = "event_response.interpolation"
    ranked = rank_of(deviation, {check: Result(check, "failed", "?", measurements=(measurement,))})
    assert [candidate.cause for candidate in ranked] == [cause]


def test_a_clock_out_of_place_is_the_odd_stream() -> None:
    """Of two clocks whose offset clears alike, that which leaves the grid of all others is late."""
    events, rgb = LATE, Hypothesis("time_offset", "rgb", 0.4, -2.0, "ms", 0.1)
    trials = {IS_LATE: tried("F1"), ("time_offset", "rgb"): tried("F1")}
    explained = [alarm(1, events, rgb)]
    assert diagnosed(explained, trials)[0].stream == "events"
    assert diagnosed(explained, trials, places={"rgb": ClockPlace("out", 20.0)})[0].stream == "rgb"
    assert [(d.stream, d.status) for d in diagnosed(explained, trials, places={"rgb": ClockPlace("in", 20.0)})] == [
        ("events", "confirmed")
    ]


def test_what_a_trial_causes_counts_against_it() -> None:
    """A cause that clears two findings and brings two others about is not confirmed."""
    trials = {IS_LATE: tried("F1", "F2", caused=("a.new.one", "another.new.one")), IS_SHIFTED: tried(left={"F1": 1.0})}
    assert [(d.cause, d.status) for d in diagnosed(BOTH, trials)] == [("time_offset", "supported")]


def test_a_cause_whose_undoing_clears_all_comes_before_one_that_leaves_some() -> None:
    """However much else the other one would explain, where two checks agree: one check may be cleared by chance."""
    further = Hypothesis("spatial_offset", "events", 0.9, 3.0, "px", 0.1)
    alarms = [*BOTH, *(alarm(i, further, code=f"rule.{i}") for i in (3, 4, 5))]
    nearly = tried("F1", left={"F2": 0.18})
    assert diagnosed(alarms, {IS_LATE: tried("F1"), IS_SHIFTED: nearly})[0].cause == "spatial_offset"
    assert diagnosed(alarms, {IS_LATE: tried("F1", "F2"), IS_SHIFTED: nearly})[0].cause == "time_offset"
    with_others = tried("F1", "F2", caused=("a.new.one",))
    assert diagnosed(alarms, {IS_LATE: with_others, IS_SHIFTED: nearly})[0].cause == "spatial_offset"
    of_one_check = [alarm(1, LATE, SHIFTED), alarm(2, LATE, SHIFTED), *alarms[2:]]
    assert diagnosed(of_one_check, {IS_LATE: tried("F1", "F2"), IS_SHIFTED: nearly})[0].cause == "spatial_offset"


def test_a_direct_measurement_supports_what_cannot_be_undone() -> None:
    """A check whose business a cause is measures it; another check's finding merely suggests it."""
    lost = Hypothesis("dropped_samples", "imu", 0.6)
    assert diagnosed([alarm(1, lost, code="clocks.gaps.missing", stream="imu")])[0].status == "supported"
    assert diagnosed([alarm(1, lost, code="imu.rotation.worst", stream="imu")])[0].status == "suggested"


def test_what_any_fault_would_explain_names_none() -> None:
    """A cause that no check supports well, and that was not tested, is no answer."""
    weak = tuple(Hypothesis(cause, "events", 0.3) for cause in ("hot_pixels", "dead_region", "time_jitter"))
    assert [(d.cause, d.status) for d in diagnosed([alarm(1, *weak)])] == [("unknown", "unidentified")]


def test_a_vector_has_its_length_for_a_size() -> None:
    """Three findings state one component each; the fault that was undone states the vector."""
    components = [alarm(i, Hypothesis("gyro_bias", "imu", 0.9, 0.01 * i, "rad/s", 0.001)) for i in (1, 2, 3)]
    found = diagnosed(components, {("gyro_bias", "imu"): tried("F1", "F2", "F3", size=0.0374)})
    assert (found[0].magnitude, found[0].unit) == (0.0374, "rad/s")


def test_components_of_a_vector_have_signs_of_their_own() -> None:
    """A bias towards +x and -z is one fault, whose undoing explains both findings."""
    components = [alarm(i, Hypothesis("gyro_bias", "imu", 0.9, size, "rad/s")) for i, size in ((1, 0.05), (2, -0.09))]
    assert [d.explains for d in diagnosed(components)] == [("F1", "F2")]
    rates = [alarm(i, Hypothesis("clock_rate", "imu", 0.9, size, "ppm")) for i, size in ((1, 50.0), (2, -90.0))]
    assert [d.explains for d in diagnosed(rates) if d.cause == "clock_rate"] == [("F1",)]


def test_a_measurement_in_order_contradicts_a_cause() -> None:
    """A passed check of the size itself, or of the correlation of a stream, rules a cause out."""
    size = Measurement("time_offset", 0.04, "ms", 0.05, 0.0, 0.3, 0.5)
    passed = Result("event_response.timing", "passed", "?", measurements=(size,))
    assert [d.cause for d in diagnosed(BOTH, results={"event_response.timing": passed})] == ["spatial_offset"]
    failed = replace(passed, outcome="failed")
    assert "time_offset" in {h.cause for h in rank_of(BOTH, {"event_response.timing": failed})}
    other = [alarm(1, Hypothesis("other_sequence", "events", 0.9))]
    related = Result("event_response.orientation", "passed", "?")
    assert diagnosed(other)[0].cause == "other_sequence"
    assert diagnosed(other, results={"event_response.orientation": related})[0].cause == "unknown"


@pytest.mark.parametrize(
    ("cause", "components"),
    [("intrinsics_focal", ("focal",)), ("flow_gain", ("gain",)), ("intrinsics_centre", ("centre_u", "centre_v"))],
)
def test_frames_that_follow_the_flow_contradict_a_fault_of_it(cause: str, components: tuple[str, ...]) -> None:
    """A focal length that flow and declaration do not share is the declared one, where frames agree with the flow."""
    measurements = tuple(Measurement(f"flow/10hz {name}", 0.1, "1", 0.1, 0.0, 0.6, 1.0) for name in components)
    frames = "flow_photometric.residual"
    passed = {frames: Result(frames, "passed", "?", measurements=measurements)}
    for size, stream in ((3.0, "metadata"), (0.5, "flow")):
        of_flow, of_camera = Hypothesis(cause, "flow", 0.9, size, "1"), Hypothesis(cause, "metadata", 0.8, -size, "1")
        both = [alarm(1, of_flow, of_camera, code="flow_geometry.endpoint.error")]
        assert diagnosed(both, results=passed)[0].stream == stream
        assert diagnosed(both)[0].stream == "flow"


def test_depth_that_turns_with_the_poses_contradicts_conventions_of_attitudes() -> None:
    """Where the gyro alone turns otherwise; another world would turn neither, and is contradicted by neither."""
    of_pose, of_imu = (Hypothesis("frame_convention", s, w) for s, w in (("pose", 0.95), ("imu", 0.9)))
    shown = [alarm(1, of_pose, of_imu, code="imu.rotation.residual", stream="imu")]
    depth, gyro = Result("depth.consistency", "passed", "?"), Result("imu.rotation", "failed", "?")
    assert diagnosed(shown, results={depth.check: depth, gyro.check: gyro})[0].stream == "imu"
    for results in (
        (depth,),
        (gyro,),
        (replace(depth, outcome="failed"), gyro),
        (depth, replace(gyro, outcome="passed")),
    ):
        assert diagnosed(shown, results={result.check: result for result in results})[0].stream == "pose"


def test_a_projection_in_order_contradicts_lengths_of_rays() -> None:
    """Divided by the lengths of rays, depth of another scale has the declared one; its exponent says that it is z."""
    shown = [alarm(1, Hypothesis("depth_ray_not_z", "depth", 0.9), code="depth.scale.factor", stream="depth")]
    ray = Result("depth.projection", "passed", "?")
    assert diagnosed(shown)[0].cause == "depth_ray_not_z"
    assert diagnosed(shown, results={ray.check: ray})[0].cause == "unknown"
    for begins, cause in ((0, "unknown"), (7, "depth_ray_not_z")):
        # Lengths of a part of the file alter the exponent of the whole by little.
        where = Where(stream="depth", index_start=begins, index_stop=20)
        finding = Finding("F9", "depth.consistency.frame", "error", "off", where)
        pairs = Result("depth.consistency", "failed", "?", findings=(finding,))
        assert diagnosed(shown, results={ray.check: ray, pairs.check: pairs})[0].cause == cause


def test_what_another_fault_leaves_excludes_nothing() -> None:
    """The windows of a trial show only a finding that the cause would not explain."""
    late = Hypothesis("time_offset", "events", 0.8, 2.0, "ms", 0.1)
    lost = Hypothesis("dropped_samples", "depth", 0.5)
    shown = [alarm(1, late, code="event_response.timing.offset"), alarm(2, lost, code="clocks.gaps.gap")]
    of_other, of_own = ({IS_LATE: tried(left={finding: 1.0})} for finding in ("F2", "F1"))
    assert [(d.cause, d.status) for d in diagnosed(shown, of_other)] == [
        ("dropped_samples", "supported"),
        ("time_offset", "suggested"),
    ]
    assert "time_offset" not in {d.cause for d in diagnosed(shown, of_own)}


def test_a_whole_that_correlates_excludes_no_part() -> None:
    """Frames of another sequence for a while leave most of the file as it was."""
    other = [alarm(1, Hypothesis("other_sequence", "rgb", 0.9), code="event_response.frames.change", stream="rgb")]
    related = Result("event_response.orientation", "passed", "?")
    single = Result("event_response.frames", "failed", "?")
    assert diagnosed(other, results={related.check: related})[0].cause == "unknown"
    assert diagnosed(other, results={related.check: related, single.check: single})[0].cause == "other_sequence"


def test_a_stream_that_is_not_in_order_by_itself_is_no_other_sequence() -> None:
    """Quaternions of any length correlate with nothing for that reason, not because they belong elsewhere."""
    unrelated = [alarm(1, Hypothesis("other_sequence", "pose", 0.9))]
    own = Result("pose.orientation", "failed", "?")
    in_order = {"pose.orientation": replace(own, outcome="passed")}
    assert diagnosed(unrelated, results=in_order)[0].cause == "other_sequence"
    assert diagnosed(unrelated, results={"pose.orientation": own})[0].cause == "unknown"


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
    assert diagnosed([silence])[0].cause == diagnosed([silence, lost])[0].cause == "dropped_samples"
    assert (diagnosed([silence, late])[0].cause, diagnosed([silence, late])[0].magnitude) == ("time_offset", 20.0)


def test_unaltered_values_do_not_excuse_what_is_declared() -> None:
    """Undoing the polarity of values breaks them where the declaration is what is wrong."""
    opposite = alarm(1, Hypothesis("polarity_inverted", "events", 1.0), code="metadata.complete.malformed")
    of_values = {("polarity_inverted", "events"): tried(left={"F1": 1.0}, caused=("event_response.orientation.other",))}
    assert [(d.cause, d.status) for d in diagnosed([opposite], of_values)] == [("polarity_inverted", "supported")]


def test_a_factor_that_is_no_ratio_of_units_is_no_unit() -> None:
    """Lengths that are 2% too large are not in another unit."""
    assert diagnosed([alarm(1, Hypothesis("unit_mm_m", "depth", 0.9, 1.021, "1"))])[0].cause == "unknown"
    assert diagnosed([alarm(1, Hypothesis("unit_mm_m", "depth", 0.9, 1003.0, "1"))])[0].cause == "unit_mm_m"


def test_a_cause_is_named_once() -> None:
    """Undone, it clears one finding and leaves another entirely, which stays without a cause."""
    partly = tried("F1", left={"F2": 1.4}, caused=("a.new.one",))
    named = diagnosed(BOTH, {IS_LATE: partly, IS_SHIFTED: tried(left={"F1": 1.0, "F2": 1.0})})
    assert [(d.cause, d.explains) for d in named] == [("time_offset", ("F1",)), ("unknown", ("F2",))]


def test_what_its_own_checks_find_in_order_is_not_the_cause() -> None:
    """A curve may clear the violations of a window by chance, while exposure, curve and thresholds are in order."""
    curve, lost = Hypothesis("exposure_or_gamma", "rgb", 0.3), Hypothesis("dropped_samples", "events", 0.4)
    broken = [alarm(1, curve, lost, code="event_response.conservation.pixels")]
    clears = {("exposure_or_gamma", "rgb"): tried("F1")}
    own = ("images.exposure", "images.transfer", "event_response.threshold")
    in_order = {check: Result(check, "passed", "?") for check in own}
    assert diagnosed(broken, clears, in_order)[0].cause == "dropped_samples"
    unmeasured = {**in_order, own[0]: Result(own[0], "not_observable", "?")}
    assert diagnosed(broken, clears, unmeasured)[0].cause == "exposure_or_gamma"


def test_poses_in_order_by_themselves_neither_jump_nor_repeat() -> None:
    """A free motion fits a shifted depth as well; poses whose motion is continuous have no such jump."""
    jump = Hypothesis("teleport", "pose", 0.9, 0.4, "m")
    shown = [alarm(1, jump, Hypothesis("frozen_frames", "pose", 0.85), Hypothesis("spatial_offset", "depth", 0.5))]
    size = Measurement("position_jump", 0.0, "m", 1e-6, 0.0, 1e-5, 2e-5)
    passed = Result("pose.continuity", "passed", "?", measurements=(size,))
    assert diagnosed(shown)[0].cause == "teleport"
    assert [d.cause for d in diagnosed(shown, results={"pose.continuity": passed})] == ["spatial_offset"]
    # Noise hides a jump that is no larger than it.
    noisy = replace(passed, measurements=(replace(size, limit=0.5),))
    assert diagnosed(shown, results={"pose.continuity": noisy})[0].cause == "teleport"


def test_a_size_counts_once_a_check() -> None:
    """Three rates that one check measures have one voice on the sign of a size, as one finding of another check has."""
    of_frames = Hypothesis("intrinsics_focal", "metadata", 0.6, 7.0, "percent")
    of_depth = Hypothesis("intrinsics_focal", "metadata", 0.9, -8.0, "percent")
    rates = [alarm(i, of_frames, code="flow_photometric.residual.template", stream="flow") for i in (1, 2, 3)]
    first = diagnosed([*rates, alarm(4, of_depth, code="flow_geometry.endpoint.error", stream="flow")])[0]
    assert (first.magnitude, first.explains) == (-8.0, ("F4",))


@pytest.mark.parametrize(
    ("trial", "is_named"),
    [
        (tried("F1", "F2"), True),
        (tried("F1", left={"F2": 1e-3}), True),
        (tried("F1", left={"F2": 0.3}), False),
        (tried("F1", "F2", caused=("depth.projection.ray",)), False),
        (None, False),
    ],
)
def test_a_scale_of_lengths_that_is_no_unit_is_named_where_undoing_it_proves_it(
    trial: UndoTrial | None, is_named: bool
) -> None:
    """Any misfit of depths and path has a factor that fits best; the factor of a unit needs no proof."""
    explained = [
        alarm(1, Hypothesis("unit_mm_m", "depth", 0.9, 0.256, "1", 1e-5), code="depth.scale.factor", stream="depth"),
        alarm(2, Hypothesis("unit_mm_m", "depth", 0.9), code="depth.consistency.frame", stream="depth"),
    ]
    trials = {} if trial is None else {("unit_mm_m", "depth"): trial}
    assert any(diagnosis.cause == "unit_mm_m" for diagnosis in diagnosed(explained, trials)) == is_named


def test_a_scale_near_one_is_no_unit_whatever_undoing_it_proves() -> None:
    """Depths that are 2% too large are those of a wrong baseline."""
    scaled = alarm(1, Hypothesis("unit_mm_m", "depth", 0.9, 1.02, "1", 1e-5), code="depth.scale.factor", stream="depth")
    (diagnosis,) = diagnosed([scaled], {("unit_mm_m", "depth"): tried("F1")})
    assert diagnosis.cause == "unknown"


def test_frames_that_were_moved_out_of_the_windows_repeat_nothing_there() -> None:
    """Frames that repeat bit by bit do so at any time: a delay that clears them clears nothing of them."""
    late = Hypothesis("time_offset", "rgb", 0.6, 40.0, "ms")
    shown = [
        alarm(1, Hypothesis("frozen_frames", "rgb", 0.9, 8.0, "samples"), late, code="images.repeats.frames"),
        alarm(2, Hypothesis("frozen_frames", "rgb", 0.7), late, code="images.order.share"),
    ]
    first, *_ = diagnosed(shown, {("time_offset", "rgb"): tried("F1", "F2", size=40.0)})
    assert first.cause == "frozen_frames"


def test_a_factor_that_another_fault_has_bent_gives_no_size_beside_that_of_a_unit() -> None:
    """Positions in feet beside another fault: the one fit is 3.2808, and the other, with a smaller error, 2.9."""
    shown = [
        alarm(
            1, Hypothesis("unit_mm_m", "pose", 0.9, 3.2808, "1", 1e-3), code="imu.translation.residual", stream="imu"
        ),
        alarm(2, Hypothesis("unit_mm_m", "pose", 0.9, 2.9, "1", 1e-6), code="depth.scale.factor", stream="depth"),
    ]
    (candidate,) = rank_of(shown, {})
    assert candidate.size.magnitude == 3.2808


def test_what_a_check_measures_comes_before_what_leaves_it_in_the_whole_file() -> None:
    """Frames in another order have no clock that is late: moved in the whole file, all of it stays."""
    late = Hypothesis("time_offset", "rgb", 0.7, 20.0, "ms")
    of_order = Hypothesis("swapped_frames", "rgb", 0.6, 2.0, "samples")
    explained = [
        alarm(1, late, code="flow_photometric.residual.tile", stream="rgb"),
        alarm(2, late, code="flow_photometric.residual.field", stream="rgb"),
        alarm(3, replace(late, support=0.2), of_order, code="images.order.part", stream="rgb"),
    ]
    explained = [(a, (*h, replace(of_order, support=0.3)) if len(h) == 1 else h) for a, h in explained]
    assert diagnosed(explained)[0].cause == "time_offset"
    left = {"F1": 1.06, "F2": 1.48, "F3": 0.9}
    trials = {("time_offset", "rgb"): replace(tried(left=left), fault=ClockShift("rgb", 2e7))}
    assert diagnosed(explained, trials)[0].cause == "swapped_frames"
    # Of the orders in which frames may be, the one that was tried is not theirs, which says nothing of another.
    trials["swapped_frames", "rgb"] = tried(left=left)
    assert diagnosed(explained, trials)[0].cause == "swapped_frames"


def test_a_clock_that_was_set_within_the_file_is_not_ruled_out_by_a_trial_of_the_whole() -> None:
    """Moved in the whole file, the timestamps that were right are off."""
    fast = Hypothesis("clock_rate", "events", 0.9)
    for code, cause in (("clocks.order.backward_steps", "time_offset"), ("clocks.rate.period", "clock_rate")):
        explained = [
            alarm(1, fast, replace(LATE, magnitude=None), code=code),
            alarm(2, replace(LATE, support=0.8), code="index_maps.rgb.entry"),
        ]
        trials = {IS_LATE: tried(left={"F2": 1.0})}
        assert diagnosed(explained, trials)[0].cause == cause


def test_a_fault_of_a_stretch_is_not_ruled_out_by_a_trial_of_the_whole() -> None:
    """Mirrored everywhere, the rest of the events disagrees with the frames."""
    moved = Hypothesis("mirrored", "events", 0.97)
    for rule, cause in (("stretch", "mirrored"), ("other", "hot_pixels")):
        explained = [
            alarm(1, moved, Hypothesis("hot_pixels", "events", 0.5), code="event_stream.rates.hot_pixel"),
            alarm(2, replace(moved, support=0.95), code=f"event_response.orientation.{rule}"),
        ]
        trials = {("mirrored", "events"): tried(left={"F1": 3.0})}
        assert diagnosed(explained, trials)[0].cause == cause


@pytest.mark.parametrize(
    ("support", "rows", "code", "cause"),
    [
        (0.6, None, "depth.consistency.tile", "unknown"),
        (0.9, None, "depth.consistency.tile", "spatial_offset"),
        (0.9, (1, 4), "depth.consistency.tile", "unknown"),
        (0.6, None, "metadata.cameras.size", "spatial_offset"),
    ],
)
def test_a_guess_that_undoing_does_not_help_is_no_name(
    support: float, rows: tuple[int, int] | None, code: str, cause: str
) -> None:
    """A check that is certain of a cause means another place than was tried; what was declared cannot be undone."""
    moved = Hypothesis("spatial_offset", "depth", support, 4.0, "px")
    trial = replace(tried(left={"F1": 0.9}), fault=ClockShift("depth", 2e7, rows))
    alarms = [alarm(1, moved, code=code, stream="depth"), alarm(2, Hypothesis("unsorted", "imu", 0.9), stream="imu")]
    assert cause in {d.cause for d in diagnosed(alarms, {("spatial_offset", "depth"): trial})}
    # A trial of which the windows show another finding alone says nothing of the cause.
    trial = replace(trial, left={"F2": 0.9})
    assert "spatial_offset" in {d.cause for d in diagnosed(alarms, {("spatial_offset", "depth"): trial})}


def test_a_cause_without_a_trial_comes_in_the_place_of_a_guess_that_undoing_does_not_help() -> None:
    """Poses that jump back and forth have noise: taking back one jump leaves all that they disturb."""
    jump, noise = Hypothesis("teleport", "pose", 0.95, 0.01, "m"), Hypothesis("noise_misdeclared", "pose", 0.85)
    alarms = [alarm(1, jump, noise, code="depth.consistency.frame", stream="depth")]
    trial = replace(tried(left={"F1": 1.0}), fault=ClockShift("pose", 2e7, (1, 4)))
    assert diagnosed(alarms)[0].cause == "teleport"
    assert [d.cause for d in diagnosed(alarms, {("teleport", "pose"): trial})] == ["noise_misdeclared"]


def test_a_trial_that_doubles_more_than_it_clears_is_no_evidence() -> None:
    """A focal length that is fitted to depth of another sequence clears one finding, and enlarges what it leaves."""
    other, longer = Hypothesis("other_sequence", "depth", 0.7), Hypothesis("intrinsics_focal", "metadata", 0.6)
    alarms = [
        *(alarm(n, other, code=f"flow_geometry.endpoint.r{n}", stream="flow") for n in (1, 2)),
        alarm(3, longer, code="depth.consistency.frame", stream="depth"),
    ]
    trial = tried("F3", left={"F1": 1.9, "F2": 5.3})
    assert diagnosed(alarms, {("intrinsics_focal", "metadata"): trial})[0].cause == "intrinsics_focal"
    trial = replace(trial, left={"F1": 2.1, "F2": 5.3})
    assert diagnosed(alarms, {("intrinsics_focal", "metadata"): trial})[0].cause == "other_sequence"


@pytest.mark.parametrize(("beside", "first"), [(1, "unknown"), (0, "dropped_samples")])
def test_a_suggestion_for_half_of_the_findings_comes_behind_what_no_cause_explains(beside: int, first: str) -> None:
    """One fault is likelier than two, and the suggested one leaves the others."""
    lost = Hypothesis("dropped_samples", "events", 0.4)
    alarms = [
        alarm(1, lost, code="event_response.conservation.pixels"),
        alarm(2, lost, code="event_response.frames.off"),
        *(alarm(3 + n, code=f"flow_photometric.r{n}.off", stream="flow") for n in range(1 + beside)),
    ]
    diagnoses = diagnosed(alarms)
    assert diagnoses[0].cause == first
    assert {d.cause for d in diagnoses} == {"dropped_samples", "unknown"}
    assert [d.id for d in diagnoses] == ["D1", "D2"]


@pytest.mark.parametrize(("code", "cause"), [("metadata.units.label", "unit_mm_m"), ("depth.scale.factor", "unknown")])
def test_values_in_order_do_not_excuse_a_label(code: str, cause: str) -> None:
    """A unit that depths are labelled with is wrong where the depths agree with all else."""
    passed = {check: Result(check, "passed", "") for check in ("depth.scale", "depth.range", "depth.consistency")}
    metres = alarm(1, Hypothesis("unit_mm_m", "depth", 0.5, 0.001, "1"), code=code, stream="depth")
    assert diagnosed([metres], results=passed)[0].cause == cause


def test_frames_that_stand_still_are_not_exchanged() -> None:
    """The displacements of exchanged frames are 2, -1 and 2 of the flow."""
    explained = alarm(1, Hypothesis("swapped_frames", "rgb", 0.8), Hypothesis("frozen_frames", "rgb", 0.5))
    for ratios, first in (((0.0, 0.02, 0.1), "frozen_frames"), ((2.0, -1.0, 2.0), "swapped_frames")):
        intervals = OutOfOrderIntervals(ratios, None, False)
        statistic = replace(explained[0].statistic, features=(intervals,))
        assert diagnosed([(Alarm(explained[0].finding, statistic), explained[1])])[0].cause == first


@pytest.mark.parametrize(("repeats", "beside", "cause"), [(0, False, "teleport"), (0, True, "frozen_frames"),
                                                          (2, False, "frozen_frames")])  # fmt: skip
def test_a_pose_that_never_repeats_is_not_frozen(repeats: int, beside: bool, cause: str) -> None:
    """Repeats are counted bit by bit, of poses and, at a jump, of positions alone."""
    counted = Measurement("frozen", repeats, "poses", 0.0, 0.0, 0.0, 1.0)
    results = {"pose.continuity": Result("pose.continuity", "failed", "", measurements=(counted,))}
    still, moved = Hypothesis("frozen_frames", "pose", 0.9), Hypothesis("teleport", "pose", 0.8)
    shown, hypotheses = alarm(1, still, moved, code="pose.continuity.position", stream="pose")
    jump = replace(shown.statistic, features=(PoseJump(beside),))
    assert diagnosed([(Alarm(shown.finding, jump), hypotheses)], results=results)[0].cause == cause


@pytest.mark.parametrize("part", [None, (45, 35, 135, 102)])
@pytest.mark.parametrize("cause", ["time_offset", "swapped_frames"])
def test_whole_images_are_not_moved_where_a_part_deviates(cause: str, part: tuple[int, int, int, int] | None) -> None:
    """A clock has no part of the image; beside a finding of timestamps it is still the cause."""
    rate = "flow/50hz"
    moved, shifted = Hypothesis(cause, "flow", 0.95), Hypothesis("flow_interval_shifted", "flow", 0.9)
    shown, hypotheses = alarm(1, moved, shifted, code="flow_geometry.endpoint.error", stream=rate)
    of_part = replace(shown.statistic, features=(FieldsOff(5, 0.2, part is not None, 0, 0, part, 0, 80),))
    explained = [(Alarm(shown.finding, of_part), hypotheses)]
    assert diagnosed(explained)[0].cause == (cause if part is None else "flow_interval_shifted")
    stamped = alarm(2, moved, code="flow_geometry.interval_timestamps.start", stream=rate)
    assert diagnosed([*explained, stamped])[0].cause == cause
