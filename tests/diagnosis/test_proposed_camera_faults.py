"""Errors of declared cameras and mountings that are proposed: focal length, principal point, rotation and lever arm."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.diagnosis.declared_intrinsics import hypotheses_of_centres
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.faults.intrinsics import FocalLength, IntrinsicsOfAnotherImage, PrincipalPointShift
from fedora_qa.faults.mountings import MountingLeverArm, MountingRotation
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_comparison import FlowParameterFit
from fedora_qa.views.flow_conventions import ConventionTrial
from tests.support.memory_sequence import facts_of, memory_sequence
from tests.support.proposed_faults import alarm, failed_result


def test_the_place_of_the_camera_that_flow_fits_is_undone() -> None:
    """Flow of a camera 3 mm forward and 4 mm left of its declared place: the depth camera is tried before all."""
    fit = FlowParameterFit("lever_arm", 0.005, "m", 1e-5, 0.9, (0.003, 0.004, 0.0))
    alarms = [alarm("flow_geometry.endpoint.error", fit)]
    faults = list(faults_for("lever_arm", "metadata", 0.005, alarms, {}, facts_of(memory_sequence())))
    assert faults == [MountingLeverArm((0.003, 0.004, 0.0), camera) for camera in ("depth", None)]


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
    """The camera errors that remain are tried separately."""
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


def test_frames_of_a_turned_camera_are_undone_about_its_axis_first() -> None:
    """As far, and in the sense, as the camera of the flow would be turned."""
    facts = facts_of(memory_sequence())
    sizes = {"flow/10hz mounting_pitch": 0.2, "flow/10hz mounting_yaw": -0.1, "flow/10hz mounting_roll": -1.0}
    results = dict([failed_result("flow_photometric.residual", **sizes)])
    first, second, *_ = faults_for("extrinsic_rotation", "metadata", 1.0, (), results, facts)
    assert first == MountingRotation("metadata", (0.0, 0.0, -1.0), "rgb")
    assert second == MountingRotation("metadata", (0.2, -0.1, -1.0), "rgb")
