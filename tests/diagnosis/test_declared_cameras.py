"""An improbable declaration of a camera is proposed with its correction, and a correct one is not."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.causes import CAUSES
from fedora_qa.checks.metadata.cameras import PrincipalPoint
from fedora_qa.checks.protocol import Statistic
from fedora_qa.conventions import R_BODY_OPTICAL
from fedora_qa.diagnosis.candidates import FITS
from fedora_qa.diagnosis.declared_cameras import of_declared_cameras
from fedora_qa.diagnosis.declared_intrinsics import (
    centres_from_middle,
    film_focal_lengths,
    normalised_intrinsics,
    other_views,
    resized_images,
    sizes_of_images,
    unequal_focal_lengths,
)
from fedora_qa.diagnosis.declared_mountings import inverted_mountings, mountings_of_other_bodies, odd_mounting
from fedora_qa.diagnosis.metadata import propose_cameras
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.faults.intrinsic_units import NormalisedUnit
from fedora_qa.faults.mountings import CameraAxes, InvertedMounting
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.declared import Camera, Lens
from fedora_qa.sequence.facts import Facts
from tests.support.memory_sequence import EVENT_HEIGHT, EVENT_WIDTH, facts_of, memory_sequence

ALL = ("rgb", "depth", "events")
VIEW_RAD = np.deg2rad(60.0)


def alarm(code: str) -> Alarm:
    return Alarm(Finding("F1", code, "error", "off", Where()), Statistic("toy", 1.0, "1", 0.0, "off", code, Where()))


def declared(facts: Facts, change: Callable[[Camera], Camera], names: tuple[str, ...]) -> Facts:
    cameras = {name: change(camera) if name in names else camera for name, camera in facts.declared.cameras.items()}
    return replace(facts, declared=replace(facts.declared, cameras=cameras))


def transposed(camera: Camera) -> Camera:
    return replace(camera, K=camera.K.T)


def times(factor: float) -> Callable[[Camera], Camera]:
    """Cameras 0.1 m ahead of the origin of the body, in another unit."""

    def change(camera: Camera) -> Camera:
        T = camera.T_body_camera.copy()
        T[:3, 3] = factor * np.array([0.1, 0.0, -0.03])
        return replace(camera, T_body_camera=T)

    return change


def of_twice_the_size(camera: Camera) -> Camera:
    """K of an image of twice the size: pixel centres at (i + 1/2) / 2 - 1/2."""
    K = np.diag([2.0, 2.0, 1.0]) @ camera.K
    K[:2, 2] += 0.5
    return replace(camera, K=K)


def of_an_image_of(width: int, height: int) -> Callable[[Camera], Camera]:
    """K of the image before it was resized, and cut to another shape about its middle."""

    def change(camera: Camera) -> Camera:
        focal_px = camera.K[0, 0] * width / camera.width
        return replace(camera, K=np.array([[focal_px, 0, (width - 1) / 2], [0, focal_px, (height - 1) / 2], [0, 0, 1]]))

    return change


def halved(camera: Camera) -> Camera:
    """K of an image of half the size whose principal point was calibrated: pixel centres at 2 i + 1/2."""
    K = camera.K.copy()
    K[:2, 2] += 0.05 * camera.width, -0.02 * camera.height
    K = np.diag([0.5, 0.5, 1.0]) @ K
    K[:2, 2] -= 0.25
    return replace(camera, K=K)


def with_multiplied_rows(camera: Camera) -> Camera:
    """K of an image of half the size, without a thought of where its first pixel lies."""
    return replace(camera, K=np.diag([0.5, 0.5, 1.0]) @ camera.K)


def on(R_body_camera: object) -> Callable[[Camera], Camera]:
    """Cameras with these axes, 0.1 m ahead of the origin of the body."""

    def change(camera: Camera) -> Camera:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = np.asarray(R_body_camera), (0.1, 0.0, -0.03)
        return replace(camera, T_body_camera=T)

    return change


def inverted(camera: Camera) -> Camera:
    return replace(camera, T_body_camera=np.linalg.inv(camera.T_body_camera))


def of_body(*body_axes: tuple[int, int, int]) -> Callable[[Camera], Camera]:
    """Mountings on a body with other axes."""

    def change(camera: Camera) -> Camera:
        T = np.eye(4)
        T[:3, :3] = body_axes
        return replace(camera, T_body_camera=T @ camera.T_body_camera)

    return change


def from_the_middle(camera: Camera) -> Camera:
    K = camera.K.copy()
    K[:2, 2] -= (camera.width - 1) / 2, (camera.height - 1) / 2
    return replace(camera, K=K)


def in_mm_of_film(camera: Camera) -> Camera:
    """Focal lengths in mm of a film of 36 mm, as Blender states them."""
    return replace(camera, K=camera.K * with_focal_gains(36 / camera.width, 36 / camera.width))


def rows_upwards(camera: Camera) -> Camera:
    """A negative focal length along rows, as where rows count upwards."""
    return replace(camera, K=camera.K * with_focal_gains(1.0, -1.0))


def with_focal_gains(along_columns: float, along_rows: float) -> np.ndarray:
    return np.array([[along_columns, 1.0, 1.0], [1.0, along_rows, 1.0], [1.0, 1.0, 1.0]])


def facts_with_sizes() -> Facts:
    """Colour and depth of twice the size of the events, with principal points in the middle."""
    facts = facts_of(memory_sequence())
    events = facts.declared.cameras["events"]
    K = events.K.copy()
    K[:2, 2] = (events.width - 1) / 2, (events.height - 1) / 2
    events = replace(events, K=K)
    larger = replace(of_twice_the_size(events), width=2 * events.width, height=2 * events.height)
    cameras = {"rgb": larger, "depth": larger, "events": events}
    return replace(facts, declared=replace(facts.declared, cameras=cameras))


CASES = [
    ("flow_geometry.endpoint.error", transposed, ALL, "intrinsics_centre"),
    ("event_response.alignment.shift", transposed, ("rgb",), "intrinsics_centre"),
    ("depth.scale.factor", times(1000.0), ALL, "lever_arm"),
    ("depth.consistency.frame", times(100.0), ALL, "lever_arm"),
    ("event_response.orientation.unrelated", of_twice_the_size, ("events",), "intrinsics_focal"),
    ("flow_geometry.endpoint.error", of_an_image_of(1440, 1080), ALL, "intrinsics_focal"),
    ("event_response.conservation.pixels", of_an_image_of(1440, 1080), ("rgb",), "intrinsics_focal"),
    ("flow_geometry.endpoint.error", with_multiplied_rows, ALL, "intrinsics_focal"),
    ("event_response.alignment.scale", with_multiplied_rows, ("rgb",), "intrinsics_focal"),
    ("event_response.timing.offset", from_the_middle, ("rgb",), "intrinsics_centre"),
    ("depth.scale.factor", from_the_middle, ALL, "intrinsics_centre"),
    ("flow_geometry.endpoint.error", rows_upwards, ALL, "intrinsics_focal"),
    ("flow_geometry.endpoint.error", rows_upwards, ("depth",), "intrinsics_focal"),
]


@pytest.mark.parametrize(("code", "change", "names", "cause"), CASES)
def test_a_declaration_is_corrected(
    code: str, change: Callable[[Camera], Camera], names: tuple[str, ...], cause: str
) -> None:
    """The cause is proposed with its size, and one of the first faults that are undone leads back to the cameras."""
    correct = declared(facts_with_sizes(), times(1.0), ALL)
    facts = declared(correct, change, names)
    (hypothesis,) = of_declared_cameras(alarm(code), facts)
    assert (hypothesis.cause, hypothesis.stream, hypothesis.unit) == (cause, "metadata", CAUSES[cause].unit)
    undone = [
        fault.undo(facts, memory_sequence()).declared
        for fault in list(faults_for(cause, "metadata", hypothesis.magnitude, (), {}, facts))[:2]
    ]
    assert any(each is not None and are_alike(each.cameras, correct.declared.cameras) for each in undone)


def are_alike(some: Mapping[str, Camera], others: Mapping[str, Camera]) -> bool:
    return all(
        np.allclose(some[name].K, camera.K) and np.allclose(some[name].T_body_camera, camera.T_body_camera)
        for name, camera in others.items()
    )


@pytest.mark.parametrize("code", [case[0] for case in CASES])
def test_correct_cameras_propose_nothing(code: str) -> None:
    """Neither cameras of other sizes on a body, nor a crop whose K follows it, are improbable."""
    facts = declared(facts_with_sizes(), times(1.0), ALL)
    assert of_declared_cameras(alarm(code), facts) == ()

    def cropped(camera: Camera) -> Camera:
        K = camera.K.copy()
        K[0, 2] -= 3.0
        return replace(camera, K=K, width=camera.width - 6)

    assert of_declared_cameras(alarm(code), declared(facts, cropped, ("events",))) == ()


def test_the_size_of_a_resized_image_is_rounded_to_a_common_ratio() -> None:
    """Where the principal point was calibrated, and lies in the middle of no image."""
    facts = declared(facts_with_sizes(), halved, ALL)
    for fault in resized_images(facts):
        camera = facts.declared.cameras[fault.camera]
        assert (2 * fault.width, 2 * fault.height) == (camera.width, camera.height)
        assert fault.percent == pytest.approx(-50.0)
    assert {fault.camera for fault in resized_images(facts)} == set(ALL)
    # All of them together are tried first.
    first = sizes_of_images(facts)[0].undo(facts, memory_sequence()).declared
    assert first is not None
    for name, camera in first.cameras.items():
        np.testing.assert_allclose(camera.K[0, 0], facts_with_sizes().declared.cameras[name].K[0, 0])


def test_a_principal_point_beside_the_middle_is_of_the_image_itself() -> None:
    """A calibrated one lies within a tenth of the size from the middle; one of another shape belongs to no image."""

    def moved(right: float, down: float) -> Callable[[Camera], Camera]:
        def change(camera: Camera) -> Camera:
            K = camera.K.copy()
            K[:2, 2] += right * camera.width, down * camera.height
            return replace(camera, K=K)

        return change

    for shift in ((0.09, 0.09), (-0.09, 0.05), (0.3, 0.0), (0.0, -0.3), (-0.5, 0.0), (0.4, -0.4)):
        facts = declared(facts_with_sizes(), moved(*shift), ("rgb",))
        assert resized_images(facts) == ()
        assert centres_from_middle(facts) == ()


def test_a_principal_point_outside_of_the_image_is_that_of_another_size_first() -> None:
    """The check of the declarations proposes the focal length of the resized image beside the principal point."""
    facts = declared(facts_with_sizes(), of_an_image_of(1440, 1080), ("rgb",))
    statistic = Statistic("toy", 1.0, "1", 0.0, "off", "toy", Where(), features=(PrincipalPoint(900.0),))
    outside = replace(alarm("metadata.cameras.principal_point_outside"), statistic=statistic)
    causes = [(h.cause, h.magnitude) for h in propose_cameras(outside, facts)]
    percent = 100 * (1440 / facts.declared.cameras["rgb"].width - 1)
    assert causes == [("intrinsics_focal", pytest.approx(percent)), ("intrinsics_centre", 900.0)]


PITCHED = Rotation.from_euler("y", 20.0, degrees=True).as_matrix() @ np.array(R_BODY_OPTICAL)


@pytest.mark.parametrize("name", ALL)
def test_an_inverted_mounting_is_inverted_back(name: str) -> None:
    """By the axes of the other cameras; a rotation that leaves it in its place is not proposed beside."""
    correct = declared(facts_with_sizes(), on(R_BODY_OPTICAL), ALL)
    facts = declared(correct, inverted, (name,))
    assert inverted_mountings(correct) == ()
    assert inverted_mountings(facts) == (InvertedMounting(name),)
    (hypothesis,) = of_declared_cameras(alarm("alignment.depth.shift"), facts)
    assert (hypothesis.cause, hypothesis.stream) == ("frame_convention", "metadata")
    undone = next(faults_for("frame_convention", "metadata", None, (), {}, facts)).undo(facts, memory_sequence())
    assert undone.declared is not None
    assert are_alike(undone.declared.cameras, correct.declared.cameras)


@pytest.mark.parametrize(("name", "cause"), [("events", "frame_convention"), ("rgb", "lever_arm")])
def test_centres_that_an_inverse_brings_together_have_no_wrong_arm(name: str, cause: str) -> None:
    """An inverted mounting of colour leaves depth and events where they are."""
    facts = declared(declared(facts_with_sizes(), on(R_BODY_OPTICAL), ALL), inverted, (name,))
    if name == "rgb":
        facts = declared(facts, times(2.0), ("depth",))
    (hypothesis,) = propose_cameras(alarm("metadata.cameras.depth_to_events_centre"), facts)
    assert hypothesis.cause == cause


@pytest.mark.parametrize("R_body_camera", [np.array(R_BODY_OPTICAL), PITCHED], ids=["straight", "pitched"])
@pytest.mark.parametrize(
    "change",
    [
        of_body((1, 0, 0), (0, -1, 0), (0, 0, -1)),
        of_body((0, -1, 0), (1, 0, 0), (0, 0, 1)),
        of_body((0, -1, 0), (0, 0, -1), (1, 0, 0)),
        inverted,
    ],
    ids=["Z down", "Y ahead", "optical", "inverted"],
)
def test_mountings_on_another_body_are_put_back(R_body_camera: np.ndarray, change: Callable[[Camera], Camera]) -> None:
    """One of the conventions that are tried first leads back to all cameras, and none is named without a trial."""
    correct = declared(facts_with_sizes(), on(R_body_camera), ALL)
    facts = declared(correct, change, ALL)
    (hypothesis,) = of_declared_cameras(alarm("flow_geometry.endpoint.error"), facts)
    assert hypothesis.cause == "frame_convention"
    assert hypothesis.support < FITS
    faults = list(faults_for("frame_convention", "metadata", None, (), {}, facts))[:3]
    undone = [fault.undo(facts, memory_sequence()).declared for fault in faults]
    assert any(each is not None and are_alike(each.cameras, correct.declared.cameras) for each in undone)


def test_cameras_that_are_not_rotated_have_the_axes_of_the_body_first() -> None:
    """Work may suffice for one trial."""
    facts = declared(facts_with_sizes(), on(np.eye(3)), ALL)
    assert next(faults_for("frame_convention", "metadata", None, (), {}, facts)) == CameraAxes()


def test_cameras_that_look_ahead_are_on_the_body() -> None:
    """Whatever their pitch, as far as they look ahead rather than down; other checks have no poses."""
    for R in (R_BODY_OPTICAL, PITCHED):
        assert mountings_of_other_bodies(declared(facts_with_sizes(), on(R), ALL)) == ()
    down = Rotation.from_euler("y", 90.0, degrees=True).as_matrix() @ np.array(R_BODY_OPTICAL)
    facts = declared(facts_with_sizes(), on(down), ALL)
    assert mountings_of_other_bodies(facts) != ()
    assert of_declared_cameras(alarm("event_response.orientation.unrelated"), facts) == ()


def large(camera: Camera) -> Camera:
    """Sixteen times the size, with the same view."""
    K = np.diag([16.0, 16.0, 1.0]) @ camera.K
    return replace(camera, K=K, width=16 * camera.width, height=16 * camera.height)


@pytest.mark.parametrize("names", [ALL, ("rgb",)])
def test_focal_lengths_in_millimetres_of_a_film_are_put_back(names: tuple[str, ...]) -> None:
    """All cameras are tried first, then those whose view no lens has; views of lenses propose no film."""
    correct = declared(facts_with_sizes(), large, ALL)
    assert film_focal_lengths(correct) == ()
    facts = declared(correct, in_mm_of_film, names)
    (hypothesis,) = of_declared_cameras(alarm("event_response.orientation.unrelated"), facts)
    assert (hypothesis.cause, hypothesis.stream, hypothesis.unit) == ("intrinsics_focal", "metadata", "percent")
    faults = [fault for fault in film_focal_lengths(facts) if fault.film_mm == 36.0]
    assert [fault.names for fault in faults] == [*dict.fromkeys((ALL, names))]
    undone = faults[-1].undo(facts, memory_sequence()).declared
    assert undone is not None
    assert are_alike(undone.cameras, correct.declared.cameras)


def in_units_of(unit: NormalisedUnit, depth_entry: float = 1.0) -> Callable[[Camera], Camera]:
    """K in sides from the corner, in halves of the sides from the middle, or in longer sides from the middle."""

    def change(camera: Camera) -> Camera:
        W, H, fx, fy = camera.width, camera.height, camera.K[0, 0], camera.K[1, 1]
        cx, cy = camera.K[0, 2] + 0.5, camera.K[1, 2] + 0.5
        L = max(W, H)
        match unit:
            case "sides":
                K = [[fx / W, 0, cx / W], [0, fy / H, cy / H], [0, 0, 1]]
            case "halves":
                K = [[2 * fx / W, 0, 2 * cx / W - 1], [0, 2 * fy / H, 2 * cy / H - 1], [0, 0, depth_entry]]
            case "longer_side":
                K = [[fx / L, 0, (cx - W / 2) / L], [0, fy / L, (cy - H / 2) / L], [0, 0, 1]]
        return replace(camera, K=np.array(K))

    return change


@pytest.mark.parametrize("names", [ALL, ("rgb",)])
@pytest.mark.parametrize(
    ("unit", "depth_entry"), [("sides", 1.0), ("halves", 1.0), ("halves", -1.00002), ("longer_side", 1.0)]
)
def test_intrinsics_in_units_of_the_image_are_put_back(
    unit: NormalisedUnit, depth_entry: float, names: tuple[str, ...]
) -> None:
    """Undone, K is that of the pixels; neither a film nor a principal point is proposed beside it."""
    correct = declared(facts_with_sizes(), large, ALL)
    assert normalised_intrinsics(correct) == ()
    facts = declared(correct, in_units_of(unit, depth_entry), names)
    assert (film_focal_lengths(facts), centres_from_middle(facts)) == ((), ())
    (hypothesis,) = of_declared_cameras(alarm("images.exposure.jump"), facts)
    assert (hypothesis.cause, hypothesis.stream, hypothesis.unit) == ("intrinsics_focal", "metadata", "percent")
    first = next(faults_for("intrinsics_focal", "metadata", hypothesis.magnitude, (), {}, facts))
    undone = first.undo(facts, memory_sequence()).declared
    assert undone is not None
    assert are_alike(undone.cameras, correct.declared.cameras)
    (of_form,) = propose_cameras(alarm("metadata.cameras.K_form"), facts)
    assert (of_form.cause, of_form.magnitude) == (hypothesis.cause, hypothesis.magnitude)


def test_a_camera_concerns_the_checks_that_use_it() -> None:
    """K of the events that is wrong is no cause of a contradiction between depth and poses."""
    facts = declared(facts_with_sizes(), of_twice_the_size, ("events",))
    assert of_declared_cameras(alarm("depth.scale.factor"), facts) == ()
    assert of_declared_cameras(alarm("imu.rotation.residual"), facts) == ()


def test_only_a_transposed_matrix_is_named() -> None:
    """K with skew has no known cause."""
    facts, code = facts_with_sizes(), "metadata.cameras.K_form"
    (hypothesis,) = propose_cameras(alarm(code), declared(facts, transposed, ("rgb",)))
    assert hypothesis.cause == "intrinsics_centre"

    def with_skew(camera: Camera) -> Camera:
        K = camera.K.copy()
        K[0, 1] = 0.5
        return replace(camera, K=K)

    (hypothesis,) = propose_cameras(alarm(code), declared(facts, with_skew, ("rgb",)))
    assert hypothesis.cause == "unknown"


def same_views(**scale: float) -> Facts:
    """Facts of cameras of one view along the columns; of some the focal length is multiplied."""
    facts = facts_of(memory_sequence())
    cameras = {}
    for name, camera in facts.declared.cameras.items():
        K = camera.K.copy()
        K[0, 0] = K[1, 1] = scale.get(name, 1.0) * camera.width / (2 * np.tan(VIEW_RAD / 2))
        cameras[name] = replace(camera, K=K)
    return replace(facts, declared=replace(facts.declared, cameras=cameras))


@pytest.mark.parametrize(
    "factor",
    [
        EVENT_HEIGHT / EVENT_WIDTH,
        np.hypot(EVENT_WIDTH, EVENT_HEIGHT) / EVENT_WIDTH,
        np.tan(VIEW_RAD / 2) / np.tan(VIEW_RAD),
        np.tan(VIEW_RAD / 2) / np.tan(VIEW_RAD / 4),
        np.tan(VIEW_RAD / 2) ** 2,
    ],
    ids=["height", "diagonal", "not halved", "halved twice", "times tangent"],
)
def test_a_focal_length_by_a_wrong_formula_is_undone(factor: float) -> None:
    """The angle along the columns was taken for that along another side, or a half or the tangent is wrong."""
    camera = same_views().declared.cameras["events"]
    facts = same_views(events=factor)
    (fault,) = other_views(facts)
    assert fault.camera == "events"
    undone = fault.undo(facts, memory_sequence()).declared
    assert undone is not None
    assert undone.cameras["events"].K[0, 0] == pytest.approx(camera.K[0, 0])
    hypotheses = of_declared_cameras(alarm("event_response.alignment.shift"), facts)
    assert ("intrinsics_focal", "metadata") in {(each.cause, each.stream) for each in hypotheses}


@pytest.mark.parametrize("factor", [1.0, 1.05])
def test_other_views_are_those_of_no_side(factor: float) -> None:
    """Neither cameras of one view, nor a focal length that is wrong by any number."""
    assert other_views(same_views(events=factor)) == ()


@pytest.mark.parametrize(("axis", "percent"), [(1, 4.0), (1, -9.0), (0, 4.0)])
def test_of_unequal_focal_lengths_the_one_of_another_view_is_wrong(axis: int, percent: float) -> None:
    """Undone, the pixels are square, and the view is that of the other cameras."""
    facts = same_views()
    K = facts.declared.cameras["depth"].K.copy()
    K[axis, axis] *= 1 + percent / 100
    cameras = {**facts.declared.cameras, "depth": replace(facts.declared.cameras["depth"], K=K)}
    wrong = replace(facts, declared=replace(facts.declared, cameras=cameras))
    first, _ = unequal_focal_lengths(wrong)
    undone = first.undo(wrong, memory_sequence()).declared
    assert undone is not None
    assert pytest.approx(facts.declared.cameras["depth"].K) == undone.cameras["depth"].K
    assert first in set(faults_for("intrinsics_focal", "metadata", first.magnitude, (), {}, wrong))
    for code, is_named in (("flow_geometry.endpoint.error", True), ("event_response.alignment.shift", False)):
        causes = {(each.cause, each.stream) for each in of_declared_cameras(alarm(code), wrong)}
        assert (("intrinsics_focal", "metadata") in causes) == is_named


def test_square_pixels_and_those_of_all_cameras_are_right() -> None:
    """Neither a rig of square pixels nor one whose cameras all have others."""
    facts = same_views()
    assert unequal_focal_lengths(facts) == ()
    stretched = {name: replace(camera, K=camera.K * np.array([[1.0], [1.1], [1.0]]))
                 for name, camera in facts.declared.cameras.items()}  # fmt: skip
    assert unequal_focal_lengths(replace(facts, declared=replace(facts.declared, cameras=stretched))) == ()


def rig(**rotations_deg: tuple[float, float, float]) -> Facts:
    """Facts of parallel cameras, some of which are rotated."""
    facts = facts_of(memory_sequence())
    cameras = dict(facts.declared.cameras)
    for name, rotation_deg in rotations_deg.items():
        T_body_camera = cameras[name].T_body_camera.copy()
        T_body_camera[:3, :3] = T_body_camera[:3, :3] @ Rotation.from_rotvec(rotation_deg, degrees=True).as_matrix()
        cameras[name] = replace(cameras[name], T_body_camera=T_body_camera)
    return replace(facts, declared=replace(facts.declared, cameras=cameras))


@pytest.mark.parametrize("name", ["rgb", "depth", "events"])
def test_the_odd_camera_is_identified_with_its_rotation(name: str) -> None:
    """Undone, it is parallel to the others."""
    facts = rig(**{name: (0.31, -1.27, 0.83)})
    odd = odd_mounting(facts)
    assert odd is not None
    assert odd.camera == name
    assert odd.rotation_deg == pytest.approx((0.31, -1.27, 0.83))
    undone = odd.undo(facts, memory_sequence()).declared
    assert undone is not None
    first, *others = (camera.T_body_camera[:3, :3] for camera in undone.cameras.values())
    assert all(np.allclose(first, other, atol=1e-12) for other in others)
    (hypothesis,) = of_declared_cameras(alarm("alignment.depth.shift"), facts)
    assert hypothesis.magnitude == pytest.approx(-np.linalg.norm((0.31, -1.27, 0.83)))
    # Flow and poses are compared by the depth camera alone.
    assert bool(of_declared_cameras(alarm("flow_geometry.endpoint.error"), facts)) == (name == "depth")


@pytest.mark.parametrize("rotation_deg", [(31.3, -12.7, 8.3), (0.0, 0.0, 90.0), (0.0, 45.0, 0.0)])
def test_a_camera_that_looks_elsewhere_is_odd(rotation_deg: tuple[float, float, float]) -> None:
    """By whatever angle, also one that somebody chose."""
    odd = odd_mounting(rig(events=rotation_deg))
    assert odd is not None
    assert (odd.camera, odd.rotation_deg) == ("events", pytest.approx(rotation_deg))


@pytest.mark.parametrize(
    "rotations",
    [
        pytest.param({}, id="parallel"),
        pytest.param({"depth": (5.0, 0.0, 0.0)}, id="an angle that somebody chose"),
        pytest.param({"depth": (0.31, -1.27, 0.83), "rgb": (1.0, 0.2, -0.4)}, id="all differ"),
    ],
)
def test_no_camera_is_odd(rotations: dict[str, tuple[float, float, float]]) -> None:
    """Rigs of designers, and of cameras that are all calibrated, have none."""
    assert odd_mounting(rig(**rotations)) is None


def test_a_distorted_camera_beside_its_rectified_views_is_not_odd() -> None:
    """Rectification turns the views against the camera, by an angle that nobody chose."""
    facts = rig(events=(0.31, -1.27, 0.83))
    cameras = dict(facts.declared.cameras)
    cameras["events"] = replace(cameras["events"], lens=Lens("radtan", (-0.1, 0.2, 0.0, 0.0)))
    assert odd_mounting(replace(facts, declared=replace(facts.declared, cameras=cameras))) is None
