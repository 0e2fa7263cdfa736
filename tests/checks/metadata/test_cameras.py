"""Declared cameras: possible, and fitting the images."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.checks.metadata.cameras import MetadataCameras
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.judgement.judge import exceeds_limit, tolerance_for
from fedora_qa.layout.dialect import load_choice
from fedora_qa.layout.metadata import rounding_of
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Camera, Declared
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import open_sequence
from tests.support.checked import diagnoses_of, rules, run_check
from tests.support.dsec_folder import write_dsec_folder
from tests.support.handmade import write_handmade

Floats = NDArray[np.float64]
Change = Callable[[Floats], Floats]
Document = dict[str, Any]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The handmade file, to be altered."""
    return write_handmade(tmp_path / "hand.h5")


def change_matrix(path: Path, camera: str, name: str, change: Change) -> None:
    with h5py.File(path, "r+") as file:
        attrs = file[f"metadata/cameras/{camera}"].attrs
        attrs[name] = change(np.array(attrs[name]))


def entry(row: int, column: int, value: float) -> Change:
    def change(matrix: Floats) -> Floats:
        matrix[row, column] = value
        return matrix

    return change


def moved(distance_m: float) -> Change:
    return lambda T: T + distance_m * np.eye(4)[[0]].T @ np.eye(4)[[3]]


@pytest.mark.parametrize(
    ("name", "change", "rule", "cause"),
    [
        ("K", np.transpose, "K_form", None),
        ("K", entry(0, 1, 0.5), "K_form", None),
        ("K", entry(2, 2, 2.0), "K_form", None),
        ("K", entry(1, 1, -20.0), "focal_lengths_not_positive", "intrinsics_focal"),
        ("K", entry(0, 2, 360.0), "principal_point_outside", "intrinsics_centre"),
        ("K", entry(1, 2, -90.0), "principal_point_outside", "intrinsics_centre"),
        ("T_body_camera", np.transpose, None, None),
        ("T_body_camera", lambda T: T * [1, 1, 1.01, 1], "T_body_camera_rigid", "frame_convention"),
        ("T_body_camera", entry(3, 0, 0.2), "T_body_camera_rigid", "frame_convention"),
        ("T_body_camera", lambda T: T * [-1, 1, 1, 1], "T_body_camera_handedness", "frame_convention"),
        ("T_body_camera", moved(0.02), "depth_to_events_centre", "lever_arm"),
    ],
)
def test_impossible_depth_cameras(path: Path, name: str, change: Change, rule: str | None, cause: str | None) -> None:
    """Whatever no camera has is named. (The transpose of this file's T is another rigid motion: only flow can tell.)"""
    change_matrix(path, "depth", name, change)
    found = rules(run_check(path, "metadata.cameras"))
    assert (rule in found) if rule else not found
    if cause:
        assert cause in {diagnosis.cause for diagnosis in diagnoses_of(path, "metadata.cameras")}


def test_focal_length_of_nothing(path: Path) -> None:
    """Intrinsics that cannot be inverted are no camera: they are malformed, and nothing is computed with them."""
    change_matrix(path, "depth", "K", entry(1, 1, 0.0))
    assert "intrinsics_focal" in {diagnosis.cause for diagnosis in diagnoses_of(path, "metadata.complete")}


def test_separation_is_measured(path: Path) -> None:
    """The distance between depth and event cameras is the fitted size of the lever arm."""
    change_matrix(path, "events", "T_body_camera", moved(0.05))
    (diagnosis,) = diagnoses_of(path, "metadata.cameras")
    assert (diagnosis.cause, diagnosis.stream) == ("lever_arm", "metadata")
    assert diagnosis.magnitude == pytest.approx(0.05)


def test_colour_camera_may_sit_elsewhere(path: Path) -> None:
    """The paper promises one centre for depth and events alone."""
    change_matrix(path, "rgb", "T_body_camera", moved(0.05))
    assert run_check(path, "metadata.cameras").outcome == "passed"


@pytest.mark.parametrize(("camera", "outcome"), [("rgb", "failed"), ("depth", "failed"), ("events", "passed")])
def test_size_of_the_images(path: Path, camera: str, outcome: str) -> None:
    """A camera must have the size of its images; events have none to compare with."""
    with h5py.File(path, "r+") as file:
        file[f"metadata/cameras/{camera}"].attrs["height"] = 28
    assert run_check(path, "metadata.cameras").outcome == outcome


def test_distortion_must_be_one_to_one_over_the_image(path: Path) -> None:
    """A barrel that folds over within the image leaves its corners without a ray; a weaker one does not."""
    outcomes = []
    for k1 in (-0.1, -3.0):
        with h5py.File(path, "r+") as file:
            attributes = file["metadata/cameras/depth"].attrs
            attributes["distortion_model"], attributes["distortion"] = "radtan", [k1, 0.0, 0.0, 0.0]
        outcomes.append(rules(run_check(path, "metadata.cameras")))
    assert outcomes == [[], ["lens_blind"]]


def unusual_centre(offset: float) -> Change:
    return lambda K: K + offset * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])


@pytest.mark.parametrize(
    ("name", "change", "rule"),
    [
        ("K", unusual_centre(0.5), "principal_point"),
        ("K", unusual_centre(1.0), "principal_point"),
        ("K", entry(0, 2, 36.0), "crop"),
        ("K", entry(1, 2, -0.6), "crop"),
        ("K", lambda K: K * [[1], [1.1], [1]], "aspect"),
        ("T_body_camera", moved(120.0), "far"),
        ("T_body_camera", lambda T: np.eye(4), "unrotated"),
    ],
)
def test_unusual_cameras_are_noted(path: Path, name: str, change: Change, rule: str) -> None:
    """Legal but unusual: warned, with the convention that was recognised."""
    change_matrix(path, "rgb", name, change)
    result = run_check(path, "metadata.cameras")
    assert (result.outcome, rules(result)) == ("warned", [rule])


def test_a_body_without_a_vertical_may_be_a_camera(path: Path, tmp_path: Path) -> None:
    """Where nothing says which axis points up, an unrotated camera is the frame that the poses are of."""
    change_matrix(path, "rgb", "T_body_camera", lambda T: np.eye(4))
    side = tmp_path / "side.toml"
    side.write_text('[metadata]\n"metadata/vertical" = "unknown"\n')
    options = CheckOptions(dialect=load_choice(None, str(side)), select=("metadata.cameras",), evidence=None)
    assert [result.outcome for result in check_file(path, options).record.results] == ["passed"]


def rectify_map(path: Path, lens: list[float], turn: Floats) -> Floats:
    """Give the events of the handmade file a lens and turn them; return OpenCV's map to the view of depth."""
    with h5py.File(path, "r+") as file:
        events, depth = (file[f"metadata/cameras/{name}"].attrs for name in ("events", "depth"))
        events.update({"distortion_model": "radtan", "distortion": np.array(lens)})
        T_body_events = events["T_body_camera"].copy()
        T_body_events[:3, :3] = depth["T_body_camera"][:3, :3] @ turn
        events["T_body_camera"] = T_body_events
        width, height = int(events["width"]), int(events["height"])
        pixels = np.dstack(np.meshgrid(np.arange(width), np.arange(height))).astype(np.float64)
        rectified = cv2.undistortPoints(pixels.reshape(-1, 1, 2), events["K"], np.array(lens), R=turn, P=depth["K"])
    return np.asarray(rectified.reshape(height, width, 2).astype(np.float32))


@pytest.mark.parametrize(
    ("change", "broken"),
    [
        (lambda px: px, []),
        (lambda px: px + np.float32(0.03), ["immaterial"]),
        (lambda px: px + np.float32(0.1), ["rectify_map"]),
        (lambda px: px[..., ::-1], ["rectify_map"]),
        (lambda px: px + np.float32(3) * (np.arange(16)[:, None] == 7), ["rectify_map"]),
        (lambda px: np.where(px < 0, np.float32(np.nan), px), ["rectify_map_defined"]),
    ],
    ids=["right", "immaterial", "moved", "y before x", "one column", "holes"],
)
def test_a_map_that_rectifies_is_held_to_lens_and_rotation(path: Path, change: Change, broken: list[str]) -> None:
    """What OpenCV computes of the calibration passes; a tenth of a pixel, wherever it lies, does not."""
    turn = Rotation.from_rotvec([0.02, -0.03, 0.1]).as_matrix()
    map_px = rectify_map(path, [-0.08, 0.02, 1e-3, -2e-3], turn)
    with h5py.File(path, "r+") as file:
        file["metadata/rectify_map"] = change(map_px)
    result = check_file(path, CheckOptions(select=("metadata.cameras",), profile="release", evidence=None)).record
    assert rules(result.results[0]) == broken


def sensor_columns_and_rows() -> Floats:
    return np.dstack(np.meshgrid(np.arange(16.0), np.arange(12.0)))


def undistorted(pixels: Floats, camera: Camera, turn: Floats, K: Floats) -> Floats:
    coefficients = np.zeros(4) if camera.lens is None else np.array(camera.lens.coefficients[:4])
    return np.asarray(
        cv2.undistortPoints(pixels.reshape(-1, 1, 2), camera.K, coefficients, R=turn, P=K).reshape(pixels.shape)
    )


def inverse_map(camera: Camera, turn: Floats, K: Floats) -> Floats:
    """OpenCV's maps for ``remap`` lead from the pixels of the rectified image to those of the camera."""
    assert camera.lens is not None
    coefficients = np.array(camera.lens.coefficients[:4])
    return np.dstack(cv2.initUndistortRectifyMap(camera.K, coefficients, turn, K, (16, 12), cv2.CV_32FC1))


@pytest.mark.parametrize(
    ("wrong", "cause", "text"),
    [
        (lambda px, camera, turn, K: px[..., ::-1], "axes_swapped", "y before x"),
        (lambda px, camera, turn, K: sensor_columns_and_rows(), "rectification_misdeclared", "pixels themselves"),
        (
            lambda px, camera, turn, K: undistorted(sensor_columns_and_rows(), replace(camera, lens=None), turn, K),
            *("rectification_misdeclared", "leaves the distortion"),
        ),
        (
            lambda px, camera, turn, K: undistorted(px.astype(np.float64), camera, turn, K),
            *("rectification_misdeclared", "applied twice"),
        ),
        (
            lambda px, camera, turn, K: inverse_map(camera, turn, K),
            *("rectification_misdeclared", "from the view to the event camera"),
        ),
        (
            lambda px, camera, turn, K: px + np.array([0.5, -0.25]),
            *("rectification_misdeclared", "a principal point +0.5, -0.25 px away"),
        ),
        (
            lambda px, camera, turn, K: undistorted(
                sensor_columns_and_rows(), camera, Rotation.from_rotvec([0, 0, 0.02]).as_matrix() @ turn, K
            ),
            *("rectification_misdeclared", "turned by 1.15 degrees"),
        ),
        (
            lambda px, camera, turn, K: px + 2 * np.sin(sensor_columns_and_rows()),
            *("rectification_misdeclared", "no common rule"),
        ),
    ],
    ids=["exchanged", "pixels", "without lens", "twice", "inverse", "moved", "turned", "nothing"],
)
def test_the_rule_of_a_wrong_map_is_named(
    path: Path, wrong: Callable[[Floats, Camera, Floats, Floats], Floats], cause: str, text: str
) -> None:
    """Maps that OpenCV computes with a common error are named by it."""
    turn = Rotation.from_rotvec([0.02, -0.03, 0.1]).as_matrix()
    map_px = rectify_map(path, [-0.08, 0.02, 1e-3, -2e-3], turn)
    with open_sequence(path) as sequence:
        events, depth = (sequence.declared.cameras[name] for name in ("events", "depth"))
    with h5py.File(path, "r+") as file:
        file["metadata/rectify_map"] = wrong(map_px, events, turn, depth.K).astype(np.float32)
    findings = run_check(path, "metadata.cameras").findings
    assert text in findings[-1].message
    assert {diagnosis.cause for diagnosis in diagnoses_of(path, "metadata.cameras")} == {cause}


def test_a_map_of_another_sensor_is_named(path: Path) -> None:
    """A map of another size says nothing about the pixels of this camera; one of exchanged axes is recognised."""
    for shape, is_asked in (((12, 20, 2), False), ((16, 12, 2), True)):
        with h5py.File(path, "r+") as file:
            file.pop("metadata/rectify_map", None)
            file["metadata/rectify_map"] = np.zeros(shape, np.float32)
        (finding,) = run_check(path, "metadata.complete").findings
        assert "16 x 12 pixels" in finding.message
        assert ("by x before y?" in finding.message) is is_asked


@given(
    focal=st.floats(1.0, 1e5),
    centre=st.tuples(st.floats(0, 1439), st.floats(0, 1079)),
    rotation=st.integers(0, 2**32 - 1).map(lambda seed: Rotation.random(rng=np.random.default_rng(seed)).as_matrix()),
    position_m=st.tuples(*[st.floats(-100, 100)] * 3),
)
def test_no_possible_camera_fails(
    focal: float, centre: tuple[float, float], rotation: Floats, position_m: tuple[float, float, float]
) -> None:
    """Any pinhole camera on any rigid mount is in order, also after a passage through float32."""
    K = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])
    T_body_camera = np.eye(4)
    T_body_camera[:3, :3], T_body_camera[:3, 3] = rotation, position_m
    for dtype in (np.float64, np.float32):
        camera = Camera(1440, 1080, K.astype(dtype).astype(float), T_body_camera.astype(dtype).astype(float))
        facts = Facts(
            layout=Layout("fedora", {}, frozenset(), {}),
            declared=Declared(cameras={"depth": camera, "events": camera}),
            streams=frozenset(),
            absent={},
            origin_us=0.0,
            clocks={},
            events=None,
            index_maps={},
        )
        observed = MetadataCameras().examine(facts)
        broken = [m.name for m in observed.measurements if exceeds_limit(m, tolerance_for(1, 1e-4))]
        assert not broken


def multiply(numbers: list[float], factor: float) -> list[float]:
    return [numbers[0] * factor, numbers[1] * factor, *numbers[2:]]


def longer_focal(document: Document) -> None:
    for camera in document["intrinsics"].values():
        camera["camera_matrix"] = multiply(camera["camera_matrix"], 1.3)


def rounded(places: int) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        view = document["intrinsics"]["camRect0"]
        view["camera_matrix"] = [round(number, places) for number in view["camera_matrix"]]

    return change


def beyond_rounding(document: Document) -> None:
    """A tenth of a pixel and a hundredth, where all numbers are written to a tenth."""
    rounded(1)(document)
    Q = document["disparity_to_depth"]["cams_03"]
    Q[2][3] = document["intrinsics"]["camRect0"]["camera_matrix"][0] + 0.11


def pair_apart(baseline_m: float) -> Callable[[Document], None]:
    """The second camera of the pair lies to the right, behind two others, and is turned."""

    def change(document: Document) -> None:
        for name, angle in (("T_21", 0.1), ("T_32", -0.2)):
            T = np.eye(4)
            T[:3, :3] = Rotation.from_euler("y", angle).as_matrix()
            document["extrinsics"][name] = T.tolist()
        T_10, T_21, T_32 = (np.array(document["extrinsics"][name]) for name in ("T_10", "T_21", "T_32"))
        arm = np.eye(4)
        arm[0, 3] = -baseline_m
        document["extrinsics"]["T_32"] = (T_32 @ arm @ np.linalg.inv(T_21 @ T_10) @ np.linalg.inv(T_21)).tolist()
        document["extrinsics"]["T_21"] = (T_21 @ T_21 @ T_10 @ np.linalg.inv(T_10)).tolist()

    return change


def scaled(document: Document) -> None:
    """Homogeneous coordinates of another factor, and the other direction of x, state the same pair."""
    Q = document["disparity_to_depth"]["cams_03"]
    document["disparity_to_depth"]["cams_03"] = (-2.0 * np.array(Q)).tolist()
    document["disparity_to_depth"]["cams_03"][3][2] *= -1.0


@pytest.mark.parametrize(
    ("change", "broken"),
    [
        (lambda document: None, []),
        (longer_focal, ["disparity_focal"]),
        (rounded(4), []),
        (rounded(1), []),
        (rounded(0), []),
        (beyond_rounding, ["disparity_focal"]),
        (scaled, []),
        (pair_apart(0.6), []),
        (pair_apart(0.601), ["disparity_baseline"]),
    ],
)
def test_disparity_is_of_the_declared_cameras(
    change: Callable[[Document], None], broken: list[str], path: Path, tmp_path: Path
) -> None:
    """Focal length and baseline of Q are those of the depth camera and of the pair, to the places that are stored."""
    folder = write_dsec_folder(path, tmp_path / "dsec")
    calibration = folder / "calibration/cam_to_cam.yaml"
    document = yaml.safe_load(calibration.read_text())
    change(document)
    calibration.write_text(yaml.safe_dump(document))
    named = [rule for rule in rules(run_check(folder, "metadata.cameras")) if rule.startswith("disparity")]
    assert named == broken


def test_a_focal_length_that_disparity_contradicts_is_named(path: Path, tmp_path: Path) -> None:
    """Its size is that by which the camera's is longer."""
    folder = write_dsec_folder(path, tmp_path / "dsec")
    calibration = folder / "calibration/cam_to_cam.yaml"
    document = yaml.safe_load(calibration.read_text())
    longer_focal(document)
    calibration.write_text(yaml.safe_dump(document))
    (first, *_) = diagnoses_of(folder, "metadata")
    assert (first.cause, first.magnitude) == ("intrinsics_focal", pytest.approx(30.0))


@pytest.mark.parametrize(
    ("numbers", "value", "expected"),
    [
        ([570.12], 0.0, 0.005),
        ([570.0, 0.0], 0.0, 0.5),
        ([570.0, 335.5], 0.0, 0.05),
        ([[1e-3, 2.0]], 2.0, 0.5e-3 + 2.0**-23),
        ([np.nan, 0.25], 0.0, 0.005),
    ],
)
def test_rounding_of_what_is_stored(numbers: list[float], value: float, expected: float) -> None:
    """Half a unit of the last decimal place of any number of a matrix, and that of float32 of the value."""
    assert rounding_of(numbers, value) == pytest.approx(expected)
