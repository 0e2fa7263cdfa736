"""Every proposal is a fault of the table, of its own cause and stream, with the size that was fitted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.checks.depth.consistency import PairsOff
from fedora_qa.checks.event_response.timing import DelayedSegment
from fedora_qa.checks.flow_geometry.endpoint import FieldsOff
from fedora_qa.checks.flow_geometry.interval_timestamps import TimestampPattern
from fedora_qa.checks.images.order import DisplacedFrames, OutOfOrderIntervals
from fedora_qa.checks.protocol import Statistic
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.declared_intrinsics import hypotheses_of_centres
from fedora_qa.diagnosis.length_units import is_length_unit
from fedora_qa.diagnosis.proposed_faults import faults_for, is_testable
from fedora_qa.estimators.imu.conventions import InertialConvention
from fedora_qa.faults.axes import VectorAxes
from fedora_qa.faults.clocks import ClockRate, ClockShift
from fedora_qa.faults.fault import is_of_part
from fedora_qa.faults.image_part import ImagePart
from fedora_qa.faults.images import DecodedTwice, PowerCurve, RayLength
from fedora_qa.faults.intrinsics import FocalLength, IntrinsicsOfAnotherImage, PrincipalPointShift
from fedora_qa.faults.motion import AngleSense, QuaternionOrder
from fedora_qa.faults.mountings import MountingLeverArm, MountingRotation
from fedora_qa.faults.name_order import FramesInOrderOfNames
from fedora_qa.faults.pixels import PixelShift
from fedora_qa.faults.row_order import DelayedFrames, RotatedFrames, SwappedFrames
from fedora_qa.faults.table import faults_of
from fedora_qa.faults.units import AngleUnit, FlowGain, LengthUnit
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.record.types import Finding, Measurement, Result, Where
from fedora_qa.sequence.facts import Facts, clock_of
from fedora_qa.views.flow_comparison import FlowParameterFit
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.inertial_agreement import InertialConventionTrial
from tests.support.memory_sequence import facts_of, memory_sequence

NEED_ROWS = {"teleport", "noise_misdeclared"}
"""Causes whose faults need rows, or numbers, that no check states yet: they are not undone."""


def result(check: str, **values: float) -> tuple[str, Result]:
    measurements = tuple(Measurement(name, value, "1", 0.1, 0.0, 0.2, 0.3) for name, value in values.items())
    return check, Result(check, "failed", "?", measurements=measurements)


def alarm(code: str, *features: Feature) -> Alarm:
    statistic = Statistic("toy", 1.0, "1", 0.0, "off", code, Where(), features=features)
    return Alarm(Finding("F1", code, "error", "off", Where()), statistic)


RESULTS = dict(
    [
        result("imu.rotation", bias_x=0.1, bias_y=-0.2, bias_z=0.05),
        result("imu.translation", bias_x=0.1, bias_y=-0.2, bias_z=0.05, lever_x=0.3, lever_y=0.0, lever_z=-0.1),
        result("event_response.threshold", threshold_on=25.0, threshold_off=-20.0),
        result("images.channels", towards_BGR=0.9, towards_RBG=0.2),
        result("images.transfer", exponent=2.2),
    ]
)


def size_of(cause: str) -> float:
    """Return a size that is legal for a cause."""
    return 1000.0 if CAUSES[cause].unit == "1" and cause != "quaternion_not_unit" else 2.0


@pytest.mark.parametrize(
    ("cause", "stream"),
    [(cause, stream) for cause in CAUSES for stream in CAUSES[cause].streams if faults_of(cause, stream)],
)
def test_proposals_are_of_the_table(cause: str, stream: str) -> None:
    """Causes with an inverse are proposed, in each stream, but for those that need rows."""
    facts = facts_of(memory_sequence())
    faults = list(faults_for(cause, stream, size_of(cause), (), RESULTS, facts))
    # Axes are known from a trial of conventions only, which has no alarm here.
    without = cause in NEED_ROWS or (cause in ("axes_swapped", "frame_convention") and stream in ("imu", "pose"))
    assert bool(faults) or without or (cause, stream) == ("lever_arm", "metadata")
    for fault in faults:
        assert isinstance(fault, faults_of(cause, stream))
        assert (fault.cause, stream_family(fault.stream)) == (cause, stream)


def test_a_size_that_was_not_fitted_is_not_undone() -> None:
    """A late stream without a delay; a mirrored one needs no size."""
    facts = facts_of(memory_sequence())
    assert not is_testable("time_offset", "events", None)
    assert not is_testable("time_offset", "events", 0.0)
    assert not list(faults_for("time_offset", "events", float("nan"), (), RESULTS, facts))
    assert is_testable("mirrored", "events", None)
    assert not is_testable("dropped_samples", "events", 3.0)


@pytest.mark.parametrize(("fitted", "first"), [(0.9, 1.0), (-0.9, -1.0), (0.0, 1.0)])
def test_rays_are_undone_in_the_direction_that_was_fitted(fitted: float, first: float) -> None:
    """Depth that was divided by the length of the ray is multiplied first; the other direction is tried as well."""
    results = dict([result("depth.projection", ray_exponent=fitted)])
    faults = list(faults_for("depth_ray_not_z", "depth", None, (), results, facts_of(memory_sequence())))
    assert faults == [RayLength(first), RayLength(-first)]


def test_components_that_were_put_first_twice_turn_body_and_world() -> None:
    """Quaternions z, w, x, y are those of a body that is turned about Z, and of a world that is turned about X."""
    facts, order = facts_of(memory_sequence()), QuaternionOrder((2, 3, 0, 1))
    q = np.random.default_rng(0).normal(size=(20, 4))
    i, k = Rotation.from_quat([1.0, 0.0, 0.0, 0.0]), Rotation.from_quat([0.0, 0.0, 1.0, 0.0])
    expected = i * Rotation.from_quat(q) * k.inv()
    assert np.allclose((Rotation.from_quat(q[:, list(order.order)]) * expected.inv()).magnitude(), 0.0, atol=1e-7)
    axes = ((-1, 0, 0), (0, -1, 0), (0, 0, 1))
    convention = InertialConvention(sensor_axes=axes, residual=1.0, declared_residual=9.0, count=9)
    shown = alarm("imu.rotation.disagreement", InertialConventionTrial(convention))
    assert ("quaternion_order", "pose") in [(h.cause, h.stream) for h in hypotheses_of(shown, facts)]
    assert list(faults_for("quaternion_order", "pose", None, (shown,), {}, facts)) == [order, QuaternionOrder()]
    assert list(faults_for("quaternion_order", "pose", None, (), {}, facts)) == [QuaternionOrder()]


def of_pairs(first: int, last: int) -> Alarm:
    """Pairs of depth frames deviate, from that of the first frame to that of the last."""
    code, where = "depth.consistency.frame", Where(stream="depth", index_start=first, index_stop=last + 1)
    return Alarm(Finding("F1", code, "error", "off", where), Statistic("toy", 1.0, "1", 0.0, "off", code, where))


@pytest.mark.parametrize(
    ("first", "last", "part"),
    [(1, 3, (2, 3)), (0, 3, (0, 3)), (1, -1, (2, None)), (0, -1, None)],
    ids=["within", "from the first frame", "to the last frame", "all"],
)
def test_a_fault_of_depth_is_undone_between_the_pairs_that_deviate(
    first: int, last: int, part: tuple[int, int | None] | None
) -> None:
    """Where a fault begins and ends, one frame of a pair has it; at an end of the file no pair shows that."""
    facts = facts_of(memory_sequence())
    count = len(facts.clocks["depth"].times_ns)
    alarms = (of_pairs(first, last % count),)
    period_ms = float(np.median(np.diff(facts.clocks["depth"].times_ns))) / NS_PER_MS

    def undone(cause: str, size: float | None) -> list[object]:
        return [fault for fault in faults_for(cause, "depth", size, alarms, {}, facts) if is_of_part(fault)]

    of_part = [part] if part else []
    assert undone("depth_ray_not_z", None) == [RayLength(1.0, rows) for rows in of_part]
    assert undone("unit_mm_m", 1000.0) == [LengthUnit("depth", 1000.0, rows) for rows in of_part]
    # Frames that were lost before the part leave the timestamps of all that follow too early.
    lost = [ClockShift("depth", -2 * period_ms * NS_PER_MS, rows) for rows in of_part if rows[1] is None]
    delayed = [DelayedFrames(-2, -2 * period_ms, rows) for rows in of_part]
    assert undone("time_offset", -2.01 * period_ms) == [*lost, *delayed]
    assert undone("time_offset", 2.0 * period_ms) == [DelayedFrames(2, 2 * period_ms, rows) for rows in of_part]
    assert not undone("time_offset", -1.5 * period_ms)


@pytest.mark.parametrize(("fitted", "exact"), [(0.3034, 0.3048), (994.2, 1000.0), (0.0995, 0.1)])
def test_a_ratio_of_units_is_exact(fitted: float, exact: float) -> None:
    """The ratio is undone first, then the one that was fitted."""
    for stream in ("depth", "pose"):
        faults = list(faults_for("unit_mm_m", stream, fitted, (), {}, facts_of(memory_sequence())))
        assert faults == [LengthUnit(stream, exact), LengthUnit(stream, fitted)]


@pytest.mark.parametrize(
    ("farthest_m", "error", "undone"), [(120.0, 0.1, 4.0), (120.0, 0.001, 3.95), (60.0, 0.1, 3.95)]
)
def test_a_factor_leaves_depths_in_their_range(farthest_m: float, error: float, undone: float) -> None:
    """Of the factors within three errors of the fitted one that with which the farthest depth is 30 m at most."""
    scale = Measurement("scale", 3.95, "1", error, 1.0, 0.2, 0.3)
    farthest = Measurement("farthest", farthest_m, "m", 0.0, 30.0, 0.0, 0.0, side="upper")
    results = {
        "depth.scale": Result("depth.scale", "failed", "off", measurements=(scale,)),
        "depth.range": Result("depth.range", "failed", "off", measurements=(farthest,)),
    }
    (fault,) = faults_for("unit_mm_m", "depth", 3.9, (), results, facts_of(memory_sequence()))
    assert fault == LengthUnit("depth", undone)


def test_the_place_of_the_camera_that_flow_fits_is_undone() -> None:
    """Flow of a camera 3 mm forward and 4 mm left of its declared place: the depth camera is tried before all."""
    fit = FlowParameterFit("lever_arm", 0.005, "m", 1e-5, 0.9, (0.003, 0.004, 0.0))
    alarms = [alarm("flow_geometry.endpoint.error", fit)]
    faults = list(faults_for("lever_arm", "metadata", 0.005, alarms, {}, facts_of(memory_sequence())))
    assert faults == [MountingLeverArm((0.003, 0.004, 0.0), camera) for camera in ("depth", None)]


def test_factors_of_both_axes_are_undone_first() -> None:
    """Those of the field that follows them most closely; the fitted gain of both axes is tried as well."""
    features = [
        ConventionTrial("flow/10hz", "scaled_by_axis", "flow", share, v_percent, (0.0, v_percent))
        for share, v_percent in ((0.7, 13.0), (0.99, 14.0), (0.4, 15.0))
    ]
    faults = list(
        faults_for("flow_gain", "flow", 4.0, (alarm("toy.toy.off", *features),), {}, facts_of(memory_sequence()))
    )
    assert faults == [FlowGain("flow", 0.0, v_percent=14.0), FlowGain("flow", 4.0)]
    assert (
        list(
            faults_for("flow_gain", "flow", 4.0, (alarm("toy.toy.off", features[2]),), {}, facts_of(memory_sequence()))
        )
        == faults[1:]
    )


def test_thresholds_are_those_that_were_fitted() -> None:
    """Steps 25% larger than declared: the declaration is a fifth too small; 20% smaller: a quarter too large."""
    (fault,) = faults_for("threshold_misdeclared", "events", 2.0, (), RESULTS, facts_of(memory_sequence()))
    assert fault.on_percent == pytest.approx(-20.0)  # type: ignore[attr-defined]  # of this class of faults
    assert fault.off_percent == pytest.approx(25.0)  # type: ignore[attr-defined]


def test_no_threshold_has_the_sign_that_a_fit_of_another_cause_has() -> None:
    """A fit that is -0.3 of the declared threshold is 130% too small, and none is undone."""
    fitted = dict([result("event_response.threshold", threshold_on=-130.0, threshold_off=4.0)])
    assert not list(faults_for("threshold_misdeclared", "events", 2.0, (), fitted, facts_of(memory_sequence())))


def test_a_shift_of_depth_is_opposite_to_that_of_the_edges_of_colour() -> None:
    """Colour lies 3 px left of the steps of depth: depth lies 3 px right. What is within its limit comes last."""
    values = {"shift_right": (-3.1, 0.3), "shift_down": (4.0, 6.0)}
    measurements = tuple(
        Measurement(name, value, "px", 0.1, 0.0, limit, 0.3) for name, (value, limit) in values.items()
    )
    aligned = {"alignment.depth": Result("alignment.depth", "failed", "shifted", measurements=measurements)}
    facts = facts_of(memory_sequence())
    shifts = list(faults_for("spatial_offset", "depth", 2.0, (), aligned, facts))
    assert shifts[:2] == [PixelShift("depth", 3, 0), PixelShift("depth", 3, -4)]


def test_a_shift_of_colour_is_in_its_own_pixels() -> None:
    """Events lie 2.5 px right and 5 px up of frames whose pixels are finer by 10.39 to 8.66: 3 px, and 6 px."""
    shifted = dict([result("event_response.alignment", shift_right=2.5, shift_down=-5.0)])
    facts = facts_of(memory_sequence())
    assert next(iter(faults_for("spatial_offset", "rgb", 6.0, (), shifted, facts))) == PixelShift("rgb", -3, 6)
    assert next(iter(faults_for("spatial_offset", "events", 5.0, (), shifted, facts))) == PixelShift("events", 2, -5)


def test_a_shift_after_which_little_of_an_image_is_left_is_not_tried() -> None:
    """A second fit extrapolates: what is shifted out of the image takes its findings with it."""
    facts = facts_of(memory_sequence())
    half_px = max(facts.layout.bindings["path/depth"].shape[1:]) // 2
    assert PixelShift("depth", 0, half_px) in faults_for("spatial_offset", "depth", half_px, (), {}, facts)
    assert not list(faults_for("spatial_offset", "depth", half_px + 1.0, (), {}, facts))


@pytest.mark.parametrize(("right_px", "is_tried"), [(4.0, True), (6.0, False)])
def test_a_shift_after_which_little_of_a_part_is_left_is_not_tried(right_px: float, is_tried: bool) -> None:
    """Depth deviates in 10 columns alone."""
    facts = facts_of(memory_sequence())
    rate = facts.flow_streams[0]
    shown = alarm("flow_geometry.endpoint.error", FieldsOff(3, 0.5, True, 0, 0, (0, 0, 10, 40)))
    shown = replace(shown, finding=replace(shown.finding, where=Where(stream=rate)))
    faults = list(faults_for("spatial_offset", "depth", right_px, [shown], {}, facts))
    assert (ImagePart(PixelShift("depth", right_px, 0), (0, 0, 10, 40)) in faults) is is_tried


def test_a_shift_is_tried_along_the_axes_too() -> None:
    """The measured shift may be at the end of its range, where another check fits a larger one."""
    shifted = dict([result("event_response.alignment", shift_right=5.0, shift_down=0.0)])
    faults = list(faults_for("spatial_offset", "events", 20.0, (), shifted, facts_of(memory_sequence())))
    assert faults == [PixelShift("events", 5, 0), PixelShift("events", 20, 0), PixelShift("events", 0, 20)]


@pytest.mark.parametrize(
    ("codes", "cameras"),
    [
        (("flow_photometric.residual.template",), ["rgb", "events"]),
        (("flow_geometry.endpoint.error",), ["depth", None]),
        (("flow_geometry.endpoint.error", "event_response.alignment.shift"), [None, "rgb", "depth", "events"]),
    ],
)
def test_the_camera_that_others_contradict_is_suspected(codes: tuple[str, ...], cameras: list[str | None]) -> None:
    """Depth that agrees with flow and poses clears its camera; frames and events that agree clear theirs."""
    alarms = [alarm(code) for code in codes]
    faults = list(faults_for("intrinsics_focal", "metadata", 2.0, alarms, {}, facts_of(memory_sequence())))
    assert faults == [FocalLength("metadata", 2.0, camera) for camera in cameras]


def test_the_vector_of_which_the_size_is_the_norm_is_undone() -> None:
    """Flow of a camera that is turned by (3, 0, -4) deg: the declared camera is turned by the opposite."""
    fit = FlowParameterFit("extrinsic_rotation", -5.0, "deg", 0.1, 0.9, (3.0, 0.0, -4.0))
    alarms = [alarm("flow_geometry.endpoint.error", fit)]
    facts = facts_of(memory_sequence())
    (of_flow,) = faults_for("extrinsic_rotation", "flow", -5.0, alarms, {}, facts)
    assert of_flow == MountingRotation("flow", (3.0, 0.0, -4.0))
    of_camera = next(iter(faults_for("extrinsic_rotation", "metadata", 5.0, alarms, {}, facts)))
    assert of_camera == MountingRotation("metadata", (-3.0, 0.0, 4.0), "depth")


def test_flow_of_axes_that_are_turned_far_is_undone_the_other_way_round() -> None:
    """A mounting that follows flow and depth is that of the flow where it is not that of the declared camera."""
    trial = ConventionTrial("flow/10hz", "turned_mounting", "metadata", 0.99, 120.0, (69.3, -69.3, 69.3))
    alarms, facts = [alarm("flow_geometry.endpoint.error", trial)], facts_of(memory_sequence())
    of_camera = next(iter(faults_for("extrinsic_rotation", "metadata", 120.0, alarms, {}, facts)))
    of_flow = next(iter(faults_for("extrinsic_rotation", "flow", -120.0, alarms, {}, facts)))
    assert of_camera == MountingRotation("metadata", (69.3, -69.3, 69.3), "depth")
    assert of_flow == MountingRotation("flow", (-69.3, 69.3, -69.3))


def test_both_components_of_a_shift_of_flow_are_undone() -> None:
    """Near whole pixels these come first: undoing them loses nothing."""
    facts = facts_of(memory_sequence())
    for components, whole in (((0.28, 0.24), []), ((-6.01, 2.02), [PixelShift("flow", -6, 2)]), ((0.02, 0.05), [])):
        size = float(np.copysign(np.hypot(*components), max(components, key=abs)))
        fit = FlowParameterFit("spatial_offset", size, "px", 0.01, 0.9, components)
        alarms = [alarm("flow_geometry.endpoint.error", fit)]
        faults = list(faults_for("spatial_offset", "flow", size, alarms, {}, facts))
        assert faults == [*whole, PixelShift("flow", *components)]


@pytest.mark.parametrize("offset_px", [0.5, 1.0, 0.3, -4.7])
def test_a_principal_point_by_another_convention_or_by_none_is_moved_back(offset_px: float) -> None:
    """That of W/2 of one camera is the first to be tried, and one that lies apart from those of all other cameras."""
    facts = with_camera(facts_of(memory_sequence()), "events", from_middle_px=offset_px)
    first = next(faults_for("intrinsics_centre", "metadata", 0.5, (), {}, facts))
    assert isinstance(first, PrincipalPointShift)
    assert first.camera == "events"
    assert (first.columns_px, first.rows_px) == pytest.approx((offset_px, offset_px))
    assert [each.magnitude for each in hypotheses_of_centres(facts)] == pytest.approx([first.magnitude])


def test_the_view_and_the_centre_of_the_others_are_tried_together() -> None:
    """K of one camera that has neither is that of other images; one that has the view has its centre moved alone."""
    facts = with_camera(facts_of(memory_sequence()), "events", from_middle_px=0.3)
    declared = facts.declared
    cameras = dict(declared.cameras)
    tangent = cameras["rgb"].width / cameras["rgb"].K[0, 0]
    for name, camera in cameras.items():
        view = 1.07 if name == "events" else 1.0
        K = camera.K * np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, 1]])
        K += np.diag([camera.width / tangent * view, camera.width / tangent * view, 0.0])
        cameras[name] = replace(camera, K=K)
    apart = replace(facts, declared=replace(declared, cameras=cameras))
    first = next(faults_for("intrinsics_centre", "metadata", 0.3, (), {}, apart))
    assert isinstance(first, IntrinsicsOfAnotherImage)
    assert (first.camera, first.percent) == ("events", pytest.approx(7.0))
    assert (first.columns_px, first.rows_px) == pytest.approx((0.3, 0.3))
    assert isinstance(next(faults_for("intrinsics_centre", "metadata", 0.3, (), {}, facts)), PrincipalPointShift)


def test_one_convention_of_all_cameras_is_undone_in_all() -> None:
    """Those that remain are tried one by one."""
    facts = facts_of(memory_sequence())
    for name in facts.declared.cameras:
        facts = with_camera(facts, name, from_middle_px=1.0)
    faults = list(faults_for("intrinsics_centre", "metadata", 1.0, (), {}, facts))
    shifts = [fault for fault in faults if isinstance(fault, PrincipalPointShift)]
    assert [shift.camera for shift in shifts[:4]] == [None, *facts.declared.cameras]
    assert {(shift.columns_px, shift.rows_px) for shift in shifts[:4]} == {(1.0, 1.0)}


def test_principal_points_of_calibrations_propose_nothing() -> None:
    """Where two cameras have one by no convention, as cameras that were measured do, or none has, no camera is odd."""
    facts = with_camera(facts_of(memory_sequence()), "depth", from_middle_px=0.0)
    assert not hypotheses_of_centres(facts)
    both = with_camera(with_camera(facts, "depth", from_middle_px=-1.2), "events", from_middle_px=0.3)
    assert not hypotheses_of_centres(both)


def with_camera(facts: Facts, name: str, *, from_middle_px: float) -> Facts:
    """Return facts with the principal point of one camera so far right of the middle and down."""
    cameras = {}
    for key, camera in facts.declared.cameras.items():
        K = camera.K.copy()
        if key == name:
            K[:2, 2] = (camera.width - 1) / 2 + from_middle_px, (camera.height - 1) / 2 + from_middle_px
        cameras[key] = replace(camera, K=K)
    return replace(facts, declared=replace(facts.declared, cameras=cameras))


@pytest.mark.parametrize(("offset_ms", "other_ms"), [(2.0, -18.0), (-9.0, 11.0)])
def test_an_offset_from_frames_is_known_up_to_their_step(offset_ms: float, other_ms: float) -> None:
    """Depth frames are 20 ms apart: 18 ms early looks like 2 ms late. Offsets that events measure are no such ones."""
    facts = facts_of(memory_sequence())
    steps_ms = np.diff(facts.clocks["depth"].times_ns) / NS_PER_MS
    np.testing.assert_array_equal(steps_ms, 20.0)
    from_frames = alarm("flow_geometry.validity.off_frames", TimestampPattern("constant", offset_ms, 1.0, "depth"))
    for alarms, sizes_ms in (((from_frames,), [offset_ms, other_ms]), ((), [offset_ms])):
        faults = faults_for("time_offset", "depth", offset_ms, alarms, {}, facts)
        assert [fault.magnitude for fault in faults] == pytest.approx(sizes_ms)


@pytest.mark.parametrize("stream", ["imu", "pose", "depth"])
def test_an_offset_of_a_part_of_a_clock_is_undone_there_first(stream: str) -> None:
    """The rows that left the line of the clock have the median of their offsets; the whole clock comes second."""
    facts = facts_of(memory_sequence())
    clock = facts.clocks[stream]
    times_ns = clock.times_ns.copy()
    first, stop = len(times_ns) // 3, len(times_ns) // 2 + 1
    times_ns[first:stop] += 70_000
    moved = replace(facts, clocks={**facts.clocks, stream: replace(clock, times_ns=times_ns)})
    local, whole = faults_for("time_offset", stream, 0.05, (), {}, moved)
    assert (local, whole) == (ClockShift(stream, 70_000.0, (first, stop)), ClockShift(stream, 50_000.0))
    assert list(faults_for("time_offset", stream, 0.05, (), {}, facts)) == [whole]


@pytest.mark.parametrize("periods", [-0.4, 0.3, 3])
def test_a_step_of_a_clock_is_undone_on_either_side(periods: float) -> None:
    """Whole periods are a gap of lost samples, unless the IMU contradicts the poses; all else is no gap."""
    facts = facts_of(memory_sequence())
    clock = facts.clocks["imu"]
    step_ns, row = round(periods * int(np.median(np.diff(clock.times_ns)))), len(clock.times_ns) // 3
    times_ns = clock.times_ns + step_ns * (np.arange(len(clock.times_ns)) >= row)
    moved = replace(facts, clocks={**facts.clocks, "imu": replace(clock, times_ns=times_ns)})
    whole = ClockShift("imu", 2.0 * NS_PER_MS)
    steps = [ClockShift("imu", step_ns, (row, None)), ClockShift("imu", -step_ns, (0, row))]
    gap, contradiction = alarm("clocks.gaps.missing"), alarm("imu.timing.time_offset")
    assert list(faults_for("time_offset", "imu", 2.0, (gap, contradiction), {}, moved)) == [*steps, whole]
    tried = list(faults_for("time_offset", "imu", 2.0, (gap,), {}, moved))
    assert not set(steps) & set(tried)
    assert whole in tried


def test_a_silence_is_a_step_of_the_clock_where_events_are_late() -> None:
    """Behind the silence events are late, or before it early. Without a delay they were lost."""
    facts = facts_of(memory_sequence())
    silence = alarm("event_stream.gaps.silence")
    place = Where("events", facts.to_file_us(30_000_000), facts.to_file_us(36_000_000))
    silence = replace(
        silence, finding=replace(silence.finding, where=place), statistic=replace(silence.statistic, value=6.0)
    )
    late = ClockShift("events", 6_000_000, while_ns=(30_000_000, None))
    early = ClockShift("events", -6_000_000, while_ns=(None, 36_000_001))
    delay = alarm("event_response.timing.offset", DelayedSegment(5.8, 0.2, 28_000_000, None))
    by_delay = ClockShift("events", 5.8 * NS_PER_MS, while_ns=(28_000_000, None))
    whole = ClockShift("events", 6.0 * NS_PER_MS)
    assert list(faults_for("time_offset", "events", 6.0, (silence, delay), {}, facts)) == [late, early, by_delay, whole]
    assert list(faults_for("time_offset", "events", 6.0, (silence,), {}, facts)) == [whole]


@pytest.mark.parametrize("stream", ["rgb", "depth"])
def test_a_clock_that_is_late_by_varying_times_is_made_regular_first(stream: str) -> None:
    """Frames that are stamped when they are recorded are 6 ms late, and up to 3 ms more. Those of a drift are not."""
    facts = facts_of(memory_sequence())
    times_ns = facts.clocks[stream].times_ns[0] + 20_000_000 * np.arange(26)
    late_ns = 6_000_000 + 1000 * (np.arange(len(times_ns)) * 7919 % 3001)
    recorded = replace(facts, clocks={**facts.clocks, stream: clock_of(times_ns + late_ns, None)})
    first, whole = faults_for("time_offset", stream, 7.0, (), {}, recorded)
    assert isinstance(first, ClockShift)
    assert (first.offset_ns, first.regular_ns) == (float(np.median(late_ns)), (float(times_ns[0]), 20e6))
    assert whole == ClockShift(stream, 7.0 * NS_PER_MS)
    drifting = replace(facts, clocks={**facts.clocks, stream: clock_of(times_ns * 1003 // 1000, None)})
    assert list(faults_for("time_offset", stream, 7.0, (), {}, drifting)) == [whole]


def test_a_rate_of_a_part_of_a_clock_is_undone_there_first() -> None:
    """A part of the IMU that runs 1000 ppm fast is slowed from its first rows on: all lie on the clock's line again."""
    facts = facts_of(memory_sequence())
    clock = facts.clocks["imu"]
    times_ns, rows = clock.times_ns.copy(), slice(20, len(clock.times_ns) // 2)
    times_ns[rows] += np.rint(1e-6 * (times_ns[rows] - times_ns[rows.start])).astype(np.int64) * 1000
    moved = replace(facts, clocks={**facts.clocks, "imu": replace(clock, times_ns=times_ns)})
    local, *whole = faults_for("clock_rate", "imu", 300.0, (), {}, moved)
    assert isinstance(local, ClockRate)
    assert local.rate_error_ppm == pytest.approx(1000.0, rel=0.1)
    assert local.rows is not None
    assert (local.rows[0], local.rows[1]) == (pytest.approx(rows.start, abs=2), rows.stop)
    undo = local.undo(moved, memory_sequence()).rows[timestamps_of("imu")]
    undone_ns = undo(lambda start, stop: times_ns[start:stop], 0, len(times_ns))
    np.testing.assert_allclose(undone_ns, clock.times_ns, rtol=0, atol=1500)
    assert len(whole) == len(list(faults_for("clock_rate", "imu", 300.0, (), {}, facts)))


@pytest.mark.parametrize(
    ("missing", "ratio", "counts"), [(2, 3.1, (2,)), (2, 2.2, (2, 1)), (0, 3.1, (2,))], ids=["both", "far", "padded"]
)
def test_frames_behind_a_loss_are_undone_as_early(missing: int, ratio: float, counts: tuple[int, ...]) -> None:
    """Frames were lost before frame 2 and the others renumbered: they are early by the periods that the end lacks.

    A displacement over several intervals may be measured too short; a file may be cut to its shortest stream.
    """
    facts = facts_of(memory_sequence())
    clock = facts.clocks["rgb"]
    kept = replace(clock, times_ns=clock.times_ns[: len(clock.times_ns) - missing])
    lost = replace(facts, clocks={**facts.clocks, "rgb": kept})
    moves_on = OutOfOrderIntervals((ratio,), frames_return=False, isolated=True)
    of_order = alarm("images.order.share", moves_on)
    of_order = replace(of_order, finding=replace(of_order.finding, where=Where(stream="rgb", frame=2)))
    period_ns = float(np.median(np.diff(clock.times_ns)))
    first, second = hypotheses_of(of_order, lost)[:2]
    assert (first.cause, first.magnitude) == ("time_offset", -counts[0] * period_ns / NS_PER_MS)
    assert (second.cause, second.magnitude) == ("dropped_samples", counts[0])
    *parts, whole = faults_for("time_offset", "rgb", first.magnitude, (of_order,), {}, lost)
    assert parts == [ClockShift("rgb", -count * period_ns, (2, None)) for count in counts]
    assert whole == ClockShift("rgb", -counts[0] * period_ns)


def test_colour_of_other_frames_for_a_while_is_undone_there() -> None:
    """Frames that hold the values of the one before them are given back, as many as lie between the intervals."""
    facts = facts_of(memory_sequence())
    period_ms = float(np.median(np.diff(facts.clocks["rgb"].times_ns))) / NS_PER_MS
    shown = alarm("images.order.share", OutOfOrderIntervals((0.0, 2.0), False, True, DisplacedFrames(2, 4, 1)))
    fault = next(iter(faults_for("time_offset", "rgb", period_ms, [shown], {}, facts)))
    assert fault == DelayedFrames(1, period_ms, (2, 4), "rgb")
    undone = fault.undo(facts, memory_sequence()).rows["path/rgb"]
    sequence = memory_sequence()
    stored = np.asarray(sequence.rows("path/rgb", 0, facts.sizes["path/rgb"]))
    frames = undone(lambda first, last: stored[first:last], 0, len(stored))
    np.testing.assert_array_equal(frames[2], stored[3])
    # The one that was lost lies between those around it.
    np.testing.assert_allclose(frames[3], (stored[3].astype(float) + stored[4]) / 2, atol=0.5)
    np.testing.assert_array_equal(np.delete(frames, [2, 3], axis=0), np.delete(stored, [2, 3], axis=0))


def test_codes_that_get_brighter_may_have_been_decoded_once_too_often() -> None:
    """An exponent that may be that of a display has the exact curve first; one far from it has a power alone."""
    facts = facts_of(memory_sequence())
    for exponent, first in ((0.5, DecodedTwice("srgb")), (0.9, PowerCurve(1 / 0.9)), (2.2, PowerCurve(1 / 2.2))):
        bent = dict([result("images.transfer", exponent_at_declared_thresholds=exponent)])
        assert next(iter(faults_for("exposure_or_gamma", "rgb", None, (), bent, facts))) == first


@pytest.mark.parametrize(
    "intervals",
    [
        OutOfOrderIntervals((2.0,), frames_return=True, isolated=False),
        OutOfOrderIntervals((-1.0,), frames_return=False, isolated=True),
        OutOfOrderIntervals((3.0, 3.1), frames_return=False, isolated=True),
        OutOfOrderIntervals((3.0,), frames_return=None, isolated=True),
    ],
    ids=["returns", "backwards", "twice", "not measured"],
)
def test_other_frames_out_of_order_were_not_renumbered(intervals: OutOfOrderIntervals) -> None:
    """A frame that returns to its place, or an image that is moved, leaves the others where they are."""
    facts, of_order = facts_of(memory_sequence()), alarm("images.order.share", intervals)
    of_order = replace(of_order, finding=replace(of_order.finding, where=Where(stream="rgb", frame=2)))
    assert all(hypothesis.cause != "time_offset" for hypothesis in hypotheses_of(of_order, facts))
    assert list(faults_for("time_offset", "rgb", 3.0, (of_order,), {}, facts)) == [ClockShift("rgb", 3.0 * NS_PER_MS)]


def test_a_slew_is_undone_with_the_offset_that_it_leaves() -> None:
    """An IMU whose clock runs 20000 ppm fast for a third of the file, and stays ahead, is undone as a part."""
    facts = facts_of(memory_sequence())
    clock = facts.clocks["imu"]
    first_ns, last_ns = int(clock.times_ns[0]), int(clock.times_ns[-1])
    start_ns, duration_ns = first_ns + (last_ns - first_ns) // 4, (last_ns - first_ns) // 3
    gained_ns = 0.02 * np.clip(clock.times_ns - start_ns, 0, duration_ns)
    times_ns = clock.times_ns + 1000 * np.rint(gained_ns / 1000).astype(np.int64)
    slewed = replace(facts, clocks={**facts.clocks, "imu": replace(clock, times_ns=times_ns)})
    local, *whole = faults_for("clock_rate", "imu", 300.0, (), {}, slewed)
    assert isinstance(local, ClockRate)
    assert is_of_part(local)
    assert local.rate_error_ppm == pytest.approx(20_000.0, rel=0.01)
    undo = local.undo(slewed, memory_sequence()).rows[timestamps_of("imu")]
    undone_ns = undo(lambda start, stop: times_ns[start:stop], 0, len(times_ns))
    np.testing.assert_allclose(undone_ns, clock.times_ns, rtol=0, atol=2000)
    assert len(whole) == len(list(faults_for("clock_rate", "imu", 300.0, (), {}, facts)))
    # No part of it has an offset of its own.
    assert not any(is_of_part(fault) for fault in faults_for("time_offset", "imu", 1.0, (), {}, slewed))


def test_a_convention_of_a_part_is_undone_in_its_place() -> None:
    """Rates in deg/s and exchanged axes from 50 to 150 ms of a file whose clock begins at 7 s."""
    facts = replace(facts_of(memory_sequence()), origin_us=7_000_000.0)
    exchanged = ((0, 1, 0), (1, 0, 0), (0, 0, 1))
    convention = InertialConvention(sensor_axes=exchanged, rate_unit=57.3)
    disagreement = alarm("imu.rotation.disagreement", InertialConventionTrial(convention, (0.05, 0.15)))
    place = Where("imu", 7_050_000.0, 7_150_000.0)
    of_part = replace(disagreement, finding=replace(disagreement.finding, where=place))
    rows = tuple(np.searchsorted(facts.clocks["imu"].times_ns, [50 * NS_PER_MS, 150 * NS_PER_MS]).tolist())
    local, whole = faults_for("unit_deg_rad", "imu", 57.3, (of_part,), {}, facts)
    assert (local, whole) == (AngleUnit(57.3, rows), AngleUnit(57.3))
    turned, of_gyro = faults_for("axes_swapped", "imu", None, (of_part,), {}, facts)
    assert isinstance(turned, VectorAxes)
    assert of_gyro == replace(turned, sensors=("gyro",))
    assert turned.rows == rows
    assert [is_of_part(fault) for fault in (local, whole, turned)] == [True, False, True]


def test_units_of_length() -> None:
    """Millimetres, feet and nautical miles; a calibration that is off by some percent is none."""
    assert all(is_length_unit(factor) for factor in (1000.0, 0.001, 0.3048, 1 / 0.3048, 1852.0, 1000.4))
    assert not any(is_length_unit(factor) for factor in (1.0, 1.016, 0.95, 2.0, 500.0))


def test_poses_of_another_engine_are_undone_with_the_axes_of_world_and_body() -> None:
    """Specific forces state the vertical and the handedness, of which rates state neither."""
    up_y = InertialConvention(sensor_axes=((0, 0, 1), (-1, 0, 0), (0, 1, 0)), up=(0, 1, 0))
    turned = InertialConvention(sensor_axes=((0, 0, -1), (1, 0, 0), (0, -1, 0)))
    alarms = (
        alarm("imu.rotation.disagreement", InertialConventionTrial(turned)),
        alarm("imu.translation.disagreement", InertialConventionTrial(up_y, kind="translation")),
    )
    (fault,) = faults_for("frame_convention", "pose", None, alarms, {}, facts_of(memory_sequence()))
    assert isinstance(fault, VectorAxes)
    world, body = np.array(fault.axes), np.array(fault.body_axes)
    assert np.linalg.det(world) == np.linalg.det(body) == -1
    np.testing.assert_array_equal(world[:, 2], [0, 1, 0])
    np.testing.assert_array_equal(body, np.transpose(up_y.sensor_axes))


def test_a_heading_from_north_is_undone_with_the_turn_of_the_world() -> None:
    quarter = ((0, -1, 0), (1, 0, 0), (0, 0, 1))
    compass = InertialConvention(world_axes=quarter, angle_signs=(-1, 1, 1))
    compared = alarm("imu.translation.disagreement", InertialConventionTrial(compass, kind="translation"))
    facts = facts_of(memory_sequence())
    assert list(faults_for("frame_convention", "pose", None, (compared,), {}, facts)) == [
        AngleSense((-1, 1, 1), quarter)
    ]


def test_frames_of_a_turned_camera_are_undone_about_its_axis_first() -> None:
    """As far, and in the sense, as the camera of the flow would be turned."""
    facts = facts_of(memory_sequence())
    sizes = {"flow/10hz mounting_pitch": 0.2, "flow/10hz mounting_yaw": -0.1, "flow/10hz mounting_roll": -1.0}
    results = dict([result("flow_photometric.residual", **sizes)])
    first, second, *_ = faults_for("extrinsic_rotation", "metadata", 1.0, (), results, facts)
    assert first == MountingRotation("metadata", (0.0, 0.0, -1.0), "rgb")
    assert second == MountingRotation("metadata", (0.2, -0.1, -1.0), "rgb")


def fields_off(rate: str, facts: Facts, first: int, last: int) -> Alarm:
    """Fields of a rate deviate, from the first row to the last."""
    times_ns = facts.clocks[rate].times_ns
    count = last - first + 1
    extent = FieldsOff(count, count / len(times_ns), False, 0, 0, None, int(times_ns[first]), int(times_ns[last]))
    shown = alarm("flow_geometry.endpoint.error", extent)
    return replace(shown, finding=replace(shown.finding, where=Where(stream=rate)))


def test_fields_of_flow_state_the_part_of_depth_where_noise_of_the_poses_hides_pairs() -> None:
    """Fields begin at the depth frames that are wrong."""
    facts = facts_of(memory_sequence())
    rate = max(facts.flow_streams, key=lambda stream: len(facts.clocks[stream].times_ns))
    shown = fields_off(rate, facts, 1, 2)
    times_ns = facts.clocks["depth"].times_ns
    first, last = np.searchsorted(times_ns, facts.clocks[rate].times_ns[[1, 2]]).tolist()
    period_ms = float(np.median(np.diff(times_ns))) / NS_PER_MS
    fault = next(iter(faults_for("time_offset", "depth", period_ms, [shown], {}, facts)))
    assert fault == DelayedFrames(1, period_ms, (first, last + 1))
    of_pairs_alone = next(iter(faults_for("time_offset", "depth", period_ms, [shown, of_pairs(1, 3)], {}, facts)))
    assert of_pairs_alone == DelayedFrames(1, period_ms, (2, 3))


def test_frames_are_put_in_the_order_of_their_numbers_where_their_text_has_another() -> None:
    """Of depth only where most pairs deviate, of colour only where displacements of the frames are out of order."""
    facts = facts_of(memory_sequence())
    depth = facts.clocks["depth"]
    times_ns = depth.times_ns[0] + 20 * NS_PER_MS * np.arange(12)
    many = replace(depth, times_ns=times_ns, advancing=np.ones(12, bool))
    facts = replace(facts, clocks={**facts.clocks, "depth": many, "rgb": many})
    by_names = [FramesInOrderOfNames("depth", 0), FramesInOrderOfNames("depth", 1)]
    most = alarm("depth.consistency.frame", PairsOff(9, 11, 0))
    assert list(faults_for("swapped_frames", "depth", 1.0, [most], {}, facts))[:2] == by_names
    few, of_events = alarm("depth.consistency.frame", PairsOff(3, 11, 0)), alarm("event_response.conservation.pixels")
    for stream, shown in (("depth", few), ("rgb", of_events)):
        others = faults_for("swapped_frames", stream, 1.0, [shown], {}, facts)
        assert not any(isinstance(fault, FramesInOrderOfNames) for fault in others)


def test_frames_of_a_part_are_undone_as_a_ring_by_the_fitted_distance() -> None:
    """In both directions, before neighbours are exchanged; a distance beyond the part is none of its frames."""
    facts = facts_of(memory_sequence())
    first, second, *_ = faults_for("swapped_frames", "depth", 1.0, [of_pairs(1, 4)], {}, facts)
    assert (first, second) == (RotatedFrames("depth", (2, 4), -1), RotatedFrames("depth", (2, 4), 1))
    too_far = faults_for("swapped_frames", "depth", 2.0, [of_pairs(1, 4)], {}, facts)
    assert not any(isinstance(fault, RotatedFrames) for fault in too_far)


def test_frames_at_both_ends_of_what_is_out_of_order_are_exchanged_first() -> None:
    """Then all neighbours in pairs, as of two renderers that take turns."""
    facts = facts_of(memory_sequence())
    times_ns = facts.clocks["rgb"].times_ns
    shown = alarm("images.order.share", OutOfOrderIntervals((2.0, -1.0, 2.0), True, False))
    place = Where(stream="rgb", start_us=facts.to_file_us(int(times_ns[1])), stop_us=facts.to_file_us(int(times_ns[2])))
    shown = replace(shown, finding=replace(shown.finding, where=place))
    pair, neighbours = faults_for("swapped_frames", "rgb", 1.0, [shown], {}, facts)
    assert pair == SwappedFrames("rgb", ((1, 2),))
    assert isinstance(neighbours, SwappedFrames)
    assert neighbours.pairs[:2] == ((0, 1), (2, 3))
