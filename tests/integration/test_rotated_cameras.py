"""Colour and event cameras at one place whose axes differ: compared as declared, and a wrong mounting is found."""

from pathlib import Path
from shutil import copy

import cv2
import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_generator.generate import Request, generate_sequence
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import Diagnosis, Result
from tests.support.checked import run_check
from tests.support.sequences import small_scene
from tests.support.shared_files import SharedFiles

ROTATION_DEG = (0.6, -0.8, 3.0)
QUARTER = Rotation.from_euler("z", 90, degrees=True)
AXES_OF_BODY = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]).inv()
"""An optical camera with these axes has those of the body: x ahead, y left, z up."""
POSITIONS = ("event_response.alignment", "alignment.events")


@pytest.fixture
def parallel(shared_files: SharedFiles) -> Path:
    """The park by day with parallel cameras. Tests must not write into it."""
    request = Request(duration_s=1.0, quality="draft")
    return shared_files.file(
        "park-rotated-cameras.h5", lambda path: generate_sequence(small_scene("park-day", 198, 147), path, request)
    )


@pytest.fixture
def rotated(parallel: Path, tmp_path: Path) -> Path:
    """A copy whose colour camera is rotated by ``ROTATION_DEG``, in its frames and in its declaration."""
    path = Path(copy(parallel, tmp_path / "rotated.h5"))
    R = Rotation.from_rotvec(ROTATION_DEG, degrees=True).as_matrix()
    with h5py.File(path, "r+") as file:
        camera = file["metadata/cameras/rgb"].attrs
        K, T_body_camera = np.array(camera["K"]), np.array(camera["T_body_camera"])
        # A pixel of the rotated camera lies at K R K^-1 u of the camera as it was: R' = R_body_camera R.
        homography, frames = K @ R @ np.linalg.inv(K), file["path/rgb"]
        size, flags = (frames.shape[2], frames.shape[1]), cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        for row in range(len(frames)):
            frames[row] = cv2.warpPerspective(frames[row], homography, size, flags=flags)
        T_body_camera[:3, :3] = T_body_camera[:3, :3] @ R
        camera["T_body_camera"] = T_body_camera
    return path


def first_diagnosis(path: Path) -> Diagnosis:
    """Return the first diagnosis from the checks that compare frames or depth with events."""
    options = CheckOptions(evidence=None, select=("event_response", "alignment"))
    return check_file(path, options).record.diagnoses[0]


def value_of(result: Result, name: str) -> float:
    return next(m.value for m in result.measurements if m.name == name and m.value is not None)


@pytest.mark.parametrize("check", POSITIONS)
def test_cameras_of_other_axes_are_compared_as_declared(rotated: Path, check: str) -> None:
    """Frames are interpolated in the axes of the event camera: no shift, no scale, no roll."""
    result = run_check(rotated, check)
    assert result.outcome == "passed"
    assert abs(value_of(result, "shift_right")) < 0.15
    assert abs(value_of(result, "shift_down")) < 0.15
    if check == "event_response.alignment":
        assert abs(value_of(result, "roll")) < 0.3
        assert abs(value_of(result, "scale")) < 0.5


def test_an_undeclared_rotation_is_measured(parallel: Path, rotated: Path) -> None:
    """The frames are rotated by 3 deg about the optical axis, and the events by as much the other way against them."""
    with h5py.File(parallel) as correct, h5py.File(rotated, "r+") as file:
        file["metadata/cameras/rgb"].attrs["T_body_camera"] = correct["metadata/cameras/rgb"].attrs["T_body_camera"]
    result = run_check(rotated, "event_response.alignment")
    assert result.outcome == "failed"
    assert value_of(result, "roll") == pytest.approx(ROTATION_DEG[2], abs=0.5)


def test_a_mounting_that_nobody_chose_is_named(parallel: Path, tmp_path: Path) -> None:
    """The event camera is declared to look elsewhere than the others: its mounting is confirmed by taking it back."""
    path = Path(copy(parallel, tmp_path / "tilted.h5"))
    with h5py.File(path, "r+") as file:
        camera = file["metadata/cameras/events"].attrs
        T_body_camera = np.array(camera["T_body_camera"])
        T_body_camera[:3, :3] = T_body_camera[:3, :3] @ Rotation.from_rotvec((0.9, -1.3, 0.7), degrees=True).as_matrix()
        camera["T_body_camera"] = T_body_camera
    first = first_diagnosis(path)
    assert (first.cause, first.stream) == ("extrinsic_rotation", "metadata")
    assert first.cleared


def mounted(path: Path, rotation: Rotation, name: str = "events") -> None:
    """Declare another mounting of a camera."""
    with h5py.File(path, "r+") as file:
        camera = file[f"metadata/cameras/{name}"].attrs
        T_body_camera = np.array(camera["T_body_camera"])
        T_body_camera[:3, :3] = T_body_camera[:3, :3] @ rotation.as_matrix()
        camera["T_body_camera"] = T_body_camera


@pytest.fixture
def portrait(parallel: Path, tmp_path: Path) -> Path:
    """A copy whose event camera is mounted in portrait, in its events and in its declaration."""
    path = Path(copy(parallel, tmp_path / "portrait.h5"))
    with h5py.File(path, "r+") as file:
        camera, events = file["metadata/cameras/events"].attrs, file["path/events"]
        K, width, height = np.array(camera["K"]), camera["width"], camera["height"]
        # Turned by a quarter from x to y, a pixel that lay at (u, v) lies at (v, W - 1 - u).
        x, y = events["x"][()], events["y"][()]
        events["x"][...], events["y"][...] = y, width - 1 - x
        camera["K"] = [[K[1, 1], 0, K[1, 2]], [0, K[0, 0], width - 1 - K[0, 2]], [0, 0, 1]]
        camera["width"], camera["height"] = height, width
    mounted(path, QUARTER)
    return path


def test_a_camera_in_portrait_is_compared_as_one_in_landscape(parallel: Path, portrait: Path) -> None:
    """Quarter turns move values and change none: every check of events and frames gives the same."""
    for check in ("event_response.orientation", "event_response.threshold", "event_response.conservation"):
        upright, turned = run_check(parallel, check), run_check(portrait, check)
        assert upright.outcome == turned.outcome == "passed"
        assert turned.measurements[0].value == pytest.approx(upright.measurements[0].value, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize(
    "rotation",
    [
        QUARTER,
        Rotation.from_euler("z", 180, degrees=True),
        Rotation.from_euler("xy", (35, -20), degrees=True),
        AXES_OF_BODY,
    ],
    ids=["quarter", "half", "far", "axes of the body"],
)
def test_a_mounting_that_looks_elsewhere_is_named(parallel: Path, tmp_path: Path, rotation: Rotation) -> None:
    """Events follow the frames as if both cameras looked one way, whatever mounting is declared."""
    path = Path(copy(parallel, tmp_path / "elsewhere.h5"))
    mounted(path, rotation)
    first = first_diagnosis(path)
    assert (first.cause, first.stream) == ("extrinsic_rotation", "metadata")
    # Frames, or events, that are turned by half about the middle of the image have the same effect.
    is_half = np.isclose(rotation.magnitude(), np.pi)
    assert first.status == ("supported" if is_half else "confirmed")
    assert abs(first.magnitude or 0.0) == pytest.approx(np.rad2deg(rotation.magnitude()), abs=1e-3)


def test_cameras_that_look_apart_show_different_things(parallel: Path, tmp_path: Path) -> None:
    """Events of what another camera sees agree with the frames under no orientation."""
    path = Path(copy(parallel, tmp_path / "apart.h5"))
    mounted(path, Rotation.from_euler("y", 70, degrees=True))
    with h5py.File(path, "r+") as file:
        camera, columns = file["metadata/cameras/events"].attrs, file["path/events/x"]
        # Half of the image beside each other stands for a view of other things.
        columns[...] = (columns[()] + camera["width"] // 2) % camera["width"]
    # A second of so small an image need not decide it.
    assert run_check(path, "event_response.orientation").outcome in {"passed", "not_observable"}


def test_a_focal_length_is_named_with_its_size(parallel: Path, tmp_path: Path) -> None:
    """The focal length of the event camera is declared 5% too long."""
    path = Path(copy(parallel, tmp_path / "longer.h5"))
    with h5py.File(path, "r+") as file:
        camera = file["metadata/cameras/events"].attrs
        camera["K"] = np.array(camera["K"]) * [[1.05, 1, 1], [1, 1.05, 1], [1, 1, 1]]
    first = first_diagnosis(path)
    assert (first.cause, first.stream) == ("intrinsics_focal", "metadata")
    assert first.magnitude == pytest.approx(5.0, abs=1.0)
