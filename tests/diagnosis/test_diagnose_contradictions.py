"""Checks that pass contradict causes."""

from dataclasses import replace

import pytest

from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.record.types import Finding, Measurement, Result, Where
from tests.support.explained_alarms import BOTH, alarm, candidates_of, diagnoses_of, undo_trial


def test_a_measurement_in_order_contradicts_a_cause() -> None:
    """A passed check of the size itself, or of the correlation of a stream, rules a cause out."""
    size = Measurement("time_offset", 0.04, "ms", 0.05, 0.0, 0.3, 0.5)
    passed = Result("event_response.timing", "passed", "?", measurements=(size,))
    assert [d.cause for d in diagnoses_of(BOTH, results={"event_response.timing": passed})] == ["spatial_offset"]
    failed = replace(passed, outcome="failed")
    assert "time_offset" in {h.cause for h in candidates_of(BOTH, {"event_response.timing": failed})}
    other = [alarm(1, Hypothesis("other_sequence", "events", 0.9))]
    related = Result("event_response.orientation", "passed", "?")
    assert diagnoses_of(other)[0].cause == "other_sequence"
    assert diagnoses_of(other, results={"event_response.orientation": related})[0].cause == "unknown"


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
        assert diagnoses_of(both, results=passed)[0].stream == stream
        assert diagnoses_of(both)[0].stream == "flow"


def test_depth_that_turns_with_the_poses_contradicts_conventions_of_attitudes() -> None:
    """Where the gyro alone turns otherwise; another world would turn neither, and is contradicted by neither."""
    of_pose, of_imu = (Hypothesis("frame_convention", s, w) for s, w in (("pose", 0.95), ("imu", 0.9)))
    explained = [alarm(1, of_pose, of_imu, code="imu.rotation.residual", stream="imu")]
    depth, gyro = Result("depth.consistency", "passed", "?"), Result("imu.rotation", "failed", "?")
    assert diagnoses_of(explained, results={depth.check: depth, gyro.check: gyro})[0].stream == "imu"
    for results in (
        (depth,),
        (gyro,),
        (replace(depth, outcome="failed"), gyro),
        (depth, replace(gyro, outcome="passed")),
    ):
        assert diagnoses_of(explained, results={result.check: result for result in results})[0].stream == "pose"


def test_a_projection_in_order_contradicts_lengths_of_rays() -> None:
    """Divided by the lengths of rays, depth of another scale has the declared one; its exponent says that it is z."""
    explained = [alarm(1, Hypothesis("depth_ray_not_z", "depth", 0.9), code="depth.scale.factor", stream="depth")]
    ray = Result("depth.projection", "passed", "?")
    assert diagnoses_of(explained)[0].cause == "depth_ray_not_z"
    assert diagnoses_of(explained, results={ray.check: ray})[0].cause == "unknown"
    for begins, cause in ((0, "unknown"), (7, "depth_ray_not_z")):
        # Lengths of a part of the file alter the exponent of the whole by little.
        where = Where(stream="depth", index_start=begins, index_stop=20)
        finding = Finding("F9", "depth.consistency.frame", "error", "off", where)
        pairs = Result("depth.consistency", "failed", "?", findings=(finding,))
        assert diagnoses_of(explained, results={ray.check: ray, pairs.check: pairs})[0].cause == cause


def test_a_whole_that_correlates_excludes_no_part() -> None:
    """Frames of another sequence for a while leave most of the file as it was."""
    other = [alarm(1, Hypothesis("other_sequence", "rgb", 0.9), code="event_response.frames.change", stream="rgb")]
    related = Result("event_response.orientation", "passed", "?")
    single = Result("event_response.frames", "failed", "?")
    assert diagnoses_of(other, results={related.check: related})[0].cause == "unknown"
    assert diagnoses_of(other, results={related.check: related, single.check: single})[0].cause == "other_sequence"


def test_a_stream_that_is_not_in_order_by_itself_is_no_other_sequence() -> None:
    """Quaternions of any length correlate with nothing for that reason, not because they belong elsewhere."""
    unrelated = [alarm(1, Hypothesis("other_sequence", "pose", 0.9))]
    own = Result("pose.orientation", "failed", "?")
    in_order = {"pose.orientation": replace(own, outcome="passed")}
    assert diagnoses_of(unrelated, results=in_order)[0].cause == "other_sequence"
    assert diagnoses_of(unrelated, results={"pose.orientation": own})[0].cause == "unknown"


def test_what_its_own_checks_find_in_order_is_not_the_cause() -> None:
    """A curve may clear the violations of a window by chance, while exposure, curve and thresholds are in order."""
    curve, lost = Hypothesis("exposure_or_gamma", "rgb", 0.3), Hypothesis("dropped_samples", "events", 0.4)
    broken = [alarm(1, curve, lost, code="event_response.conservation.pixels")]
    clears = {("exposure_or_gamma", "rgb"): undo_trial("F1")}
    own = ("images.exposure", "images.transfer", "event_response.threshold")
    in_order = {check: Result(check, "passed", "?") for check in own}
    assert diagnoses_of(broken, clears, in_order)[0].cause == "dropped_samples"
    unmeasured = {**in_order, own[0]: Result(own[0], "not_observable", "?")}
    assert diagnoses_of(broken, clears, unmeasured)[0].cause == "exposure_or_gamma"


def test_poses_in_order_by_themselves_neither_jump_nor_repeat() -> None:
    """A free motion fits a shifted depth as well; poses whose motion is continuous have no such jump."""
    jump = Hypothesis("teleport", "pose", 0.9, 0.4, "m")
    explained = [alarm(1, jump, Hypothesis("frozen_frames", "pose", 0.85), Hypothesis("spatial_offset", "depth", 0.5))]
    size = Measurement("position_jump", 0.0, "m", 1e-6, 0.0, 1e-5, 2e-5)
    passed = Result("pose.continuity", "passed", "?", measurements=(size,))
    assert diagnoses_of(explained)[0].cause == "teleport"
    assert [d.cause for d in diagnoses_of(explained, results={"pose.continuity": passed})] == ["spatial_offset"]
    # Noise hides a jump that is no larger than it.
    noisy = replace(passed, measurements=(replace(size, limit=0.5),))
    assert diagnoses_of(explained, results={"pose.continuity": noisy})[0].cause == "teleport"


@pytest.mark.parametrize(("code", "cause"), [("metadata.units.label", "unit_mm_m"), ("depth.scale.factor", "unknown")])
def test_values_in_order_do_not_excuse_a_label(code: str, cause: str) -> None:
    """A unit that depths are labelled with is wrong where the depths agree with all else."""
    passed = {check: Result(check, "passed", "") for check in ("depth.scale", "depth.range", "depth.consistency")}
    metres = alarm(1, Hypothesis("unit_mm_m", "depth", 0.5, 0.001, "1"), code=code, stream="depth")
    assert diagnoses_of([metres], results=passed)[0].cause == cause
