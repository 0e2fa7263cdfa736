"""Folders of TUM-VIE and EDS: rows and cameras are those of the source, and faults in text are found."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.layout.dialect import load_choice
from fedora_qa.layout.folder import sequences_in
from fedora_qa.record.types import FileRecord
from fedora_qa.sequence.sequence import open_sequence
from tests.support.all_checks import CHECKS
from tests.support.checked import checks_that_read
from tests.support.eds_folder import EPOCH_US, write_eds_folder, write_eds_side
from tests.support.event_view import TwoViews, camera_poses, two_views
from tests.support.m3ed_folder import turned_axes
from tests.support.shared_files import SharedFiles
from tests.support.tum_vie_folder import (
    FIRST_US,
    marker_in_imu,
    named_pose,
    write_tum_vie_folder,
    write_tum_vie_side,
)

Rows = list[list[str]]


@pytest.fixture(scope="module")
def sources(shared_files: SharedFiles) -> dict[str, TwoViews]:
    return {
        "tum-vie": two_views(shared_files, lens="equidistant"),
        "eds": two_views(shared_files, lens="radtan"),
    }


@pytest.fixture(scope="module")
def root(sources: dict[str, TwoViews], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of each layout, and its side file."""
    root = tmp_path_factory.mktemp("motion-capture")
    write_tum_vie_folder(sources["tum-vie"], root / "tum-vie")
    write_tum_vie_side(root / "tum-vie.toml")
    write_eds_folder(sources["eds"], root / "eds")
    write_eds_side(sources["eds"], root / "eds.toml")
    return root


def check(folder: Path, side: Path, select: tuple[str, ...] = ()) -> FileRecord:
    choice = load_choice(None, str(side))
    return check_file(folder, CheckOptions(dialect=choice, profile="release", evidence=None, select=select)).record


def test_rows_of_tum_vie_are_those_of_the_source(sources: dict[str, TwoViews], root: Path) -> None:
    """The body is the markers, in which IMU and cameras have their place."""
    with open_sequence(root / "tum-vie") as sequence, h5py.File(sources["tum-vie"].sequence) as file:
        T_body_imu, T_imu_source = np.linalg.inv(marker_in_imu()), np.eye(4)
        T_imu_source[:3, :3] = turned_axes()
        T_body_source = T_body_imu @ T_imu_source
        for name in ("rgb", "events"):
            camera, expected = sequence.declared.cameras[name], file[f"metadata/cameras/{name}"].attrs
            np.testing.assert_allclose(camera.K, expected["K"], rtol=1e-12)
            np.testing.assert_allclose(camera.T_body_camera, T_body_source @ expected["T_body_camera"], atol=1e-12)
            assert camera.lens is not None
            assert (camera.lens.model, camera.width) == ("equidistant", expected["width"])
            np.testing.assert_allclose(camera.lens.coefficients, expected["distortion"], rtol=1e-12)
        rates = sequence.rows("path/imu/angular_velocity", 5, 9)
        np.testing.assert_allclose(rates, file["path/imu/angular_velocity"][5:9] @ T_body_source[:3, :3].T, atol=1e-11)
        np.testing.assert_allclose(sequence.declared.imu_lever_body_m, T_body_imu[:3, 3], atol=1e-12)
        # Between two poses the body moves as that of the source does.
        count = sequence.layout.bindings["path/pose/position"].rows
        moved = []
        for row in (0, count - 1):
            T = np.eye(4)
            T[:3, :3] = Rotation.from_quat(sequence.rows("path/pose/orientation", row, row + 1)[0]).as_matrix()
            T[:3, 3] = sequence.rows("path/pose/position", row, row + 1)[0]
            moved.append(T @ T_body_source)
        stamps = file["path/pose/ts"][:][[0, -1]]
        camera_T = file["metadata/cameras/depth"].attrs["T_body_camera"]
        source = camera_poses(file, stamps) @ np.linalg.inv(camera_T)
        np.testing.assert_allclose(np.linalg.inv(moved[0]) @ moved[1], np.linalg.inv(source[0]) @ source[1], atol=1e-11)
        stamp_ns = sequence.rows("path/rgb_ts", 3, 4)[0] + sequence.origin_ns
        assert stamp_ns == pytest.approx((file["path/rgb_ts"][3] + FIRST_US) * 1000, abs=1)
        grey = cv2.cvtColor(file["path/rgb"][3], cv2.COLOR_RGB2GRAY)
        read = sequence.rows("path/rgb", 3, 4)[0].astype(int)
        assert np.abs(read - grey.astype(int)[:, :, np.newaxis]).mean() < 2  # of JPEG


def test_rows_of_eds_are_those_of_the_source(sources: dict[str, TwoViews], root: Path) -> None:
    """Poses are those of the event camera, which is the body, since 1970."""
    with open_sequence(root / "eds") as sequence, h5py.File(sources["eds"].sequence) as file:
        np.testing.assert_array_equal(sequence.declared.cameras["events"].T_body_camera, np.eye(4))
        stamps = file["path/pose/ts"][:][7:8]
        expected = camera_poses(file, stamps)[0]
        np.testing.assert_allclose(sequence.rows("path/pose/position", 7, 8)[0], expected[:3, 3], atol=1e-12)
        read = Rotation.from_quat(sequence.rows("path/pose/orientation", 7, 8)[0]).as_matrix()
        np.testing.assert_allclose(read, expected[:3, :3], atol=1e-12)
        # Seconds since 1970 as float64 have steps of 0.24 us.
        stamp_ns = sequence.rows("path/pose/ts", 7, 8)[0] + sequence.origin_ns
        assert abs(int(stamp_ns) - (int(stamps[0]) + EPOCH_US) * 1000) <= 250
        np.testing.assert_array_equal(sequence.rows("path/rgb", 2, 3), file["path/rgb"][2:3])
        assert sequence.layout.absent["imu"].startswith("nobody states metadata/T_body_imu")


def of_text(alter: Callable[[Rows], Rows]) -> Callable[[Path], None]:
    """Alter the rows of a text, whose head is left out."""

    def altered(path: Path) -> None:
        blank = "," if path.suffix == ".csv" else " "
        lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
        rows = alter([line.split(blank) for line in lines])
        path.write_text("\n".join([*map(blank.join, rows), ""]))

    return altered


def late_us(by: float) -> Callable[[Path], None]:
    return of_text(lambda rows: [[f"{float(row[0]) + by:.3f}", *row[1:]] for row in rows])


def with_inverted_markers(path: Path) -> None:
    document: dict[str, Any] = json.loads(path.read_text())
    document["value0"]["T_imu_marker"] = named_pose(np.linalg.inv(marker_in_imu()))
    path.write_text(json.dumps(document))


def mirrored(folder: Path) -> None:
    for path in folder.glob("*.png"):
        image = cv2.imread(str(path))
        assert image is not None
        assert cv2.imwrite(str(path), image[:, ::-1])


scalar_first = of_text(lambda rows: [[*row[:4], row[7], *row[4:7]] for row in rows])

FAULTS: dict[str, tuple[str, str, Callable[[Path], None], str, str]] = {
    "quaternions of TUM-VIE with w first": (
        "tum-vie", "mocap_data.txt", scalar_first, "imu.rotation", "quaternion_order",
    ),
    "an IMU of TUM-VIE that is late by 3.3 ms": (
        "tum-vie", "imu_data.txt", late_us(3300.0), "imu.timing", "time_offset",
    ),
    "poses of TUM-VIE that are late by 8 ms": (
        "tum-vie", "mocap_data.txt", late_us(8000.0), "imu.timing", "time_offset",
    ),
    "markers of TUM-VIE whose calibration is inverted": (
        "tum-vie", "mocap-imu-calibrationA.json", with_inverted_markers, "imu.rotation", "frame_convention",
    ),
    "quaternions of EDS with w first": (
        "eds", "stamped_groundtruth.txt", scalar_first, "imu.rotation", "quaternion_order",
    ),
    "quaternions of EDS that are inverted": (
        "eds", "stamped_groundtruth.txt",
        of_text(lambda rows: [[*row[:4], *(str(-float(number)) for number in row[4:7]), row[7]] for row in rows]),
        "imu.rotation", "quaternion_inverted",
    ),
    "an IMU of EDS that is late by 3.3 ms": (
        "eds", "imu.csv", of_text(lambda rows: [[str(int(row[0]) + 3_300_000), *row[1:]] for row in rows]),
        "imu.timing", "time_offset",
    ),
    "images of EDS that are mirrored": ("eds", "images", mirrored, "event_response.orientation", "mirrored"),
    "images of EDS that are stamped in milliseconds": (
        "eds", "images_timestamps.txt", of_text(lambda rows: [[str(int(row[0]) // 1000)] for row in rows]),
        "clocks.unit", "time_unit",
    ),
}  # fmt: skip
"""By what is wrong: the layout, the file in it, what is done to it, the check that fails, and the cause."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_text_or_calibration_is_found(fault: str, root: Path, tmp_path: Path) -> None:
    """The check that measures it fails, and the cause is named, of all checks that read a stream of that check."""
    name, place, alter, check_name, cause = FAULTS[fault]
    copy = Path(shutil.copytree(root / name, tmp_path / name))
    alter(copy / place)
    (needs,) = (each.needs for each in CHECKS if each.name == check_name)
    record = check(copy, root / f"{name}.toml", checks_that_read(*needs))
    assert record.dialect == name
    assert check_name in {result.check for result in record.results if result.outcome == "failed"}
    assert cause in {diagnosis.cause for diagnosis in record.diagnoses}


def test_markers_that_are_lost_are_lost_samples(root: Path, tmp_path: Path) -> None:
    """Where a sequence leaves the room of the motion capture, poses are missing, and it is said where."""
    copy = Path(shutil.copytree(root / "tum-vie", tmp_path / "tum-vie"))
    of_text(lambda rows: rows[:60] + rows[140:])(copy / "mocap_data.txt")
    record = check(copy, root / "tum-vie.toml", ("clocks", "imu"))
    assert {result.check for result in record.results if result.outcome == "failed"} == {"clocks.gaps"}
    assert [(diagnosis.cause, diagnosis.stream) for diagnosis in record.diagnoses] == [("dropped_samples", "pose")]


def test_steps_of_decimals_are_known(root: Path, tmp_path: Path) -> None:
    """Poses of four decimals are no quaternions of another length, whether or not the markers are the body."""
    copy = Path(shutil.copytree(root / "tum-vie", tmp_path / "tum-vie"))
    of_text(lambda rows: [[row[0], *(f"{float(number):.4f}" for number in row[1:])] for row in rows])(
        copy / "mocap_data.txt"
    )
    dialect = tmp_path / "mine.toml"
    pose = 'file = "mocap", columns = [1, 2, 3, 4, 5, 6, 7], convert = "position_quaternion"'
    dialect.write_text(
        'name = "mine"\n[files]\nmocap = "mocap_data.txt"\ncalibration = "mocap-imu-calibrationA.json"\n[datasets]\n'
        f'"path/pose/ts" = {{ file = "mocap", columns = [0] }}\n"path/pose/position" = {{ {pose} }}\n'
        f'"path/pose/orientation" = {{ {pose} }}\n[metadata]\n"metadata/T_posed_body" = {{ file = "calibration", '
        'path = "value0/T_imu_marker", convert = "position_quaternion", invert = true }\n'
    )
    for choice in (None, load_choice(str(dialect), None)):
        options = CheckOptions(dialect=choice, profile="release", evidence=None, select=("pose.orientation",))
        record = check_file(copy, options).record
        assert {result.outcome for result in record.results if result.check == "pose.orientation"} == {"passed"}
        assert record.inferred["storage.pose.orientation"] == "0.0001"


def test_both_are_recognised_beside_each_other_and_apart(root: Path, tmp_path: Path) -> None:
    """Sequences below a folder, one a folder, are read each in its own dialect; calibrations belong into the folder."""
    both = tmp_path / "both"
    for name in ("tum-vie", "eds"):
        shutil.copytree(root / name, both / name)
    assert [
        record.dialect
        for record in (check(both / name, root / f"{name}.toml", ("integrity",)) for name in ("eds", "tum-vie"))
    ] == ["eds", "tum-vie"]
    (both / "tum-vie/mocap-imu-calibrationA.json").rename(both / "mocap-imu-calibrationA.json")
    with open_sequence(both / "tum-vie") as sequence:
        assert sequence.layout.streams == {"rgb", "events", "pose"}
        assert sequence.layout.absent["imu"].startswith("nobody states metadata/T_body_imu")
        assert not sequence.declared.cameras
        assert not sequence.layout.problems


def test_events_of_several_sequences_side_by_side(root: Path, tmp_path: Path) -> None:
    """Files of events that were downloaded to one folder, with one calibration, are a sequence each."""
    flat = tmp_path / "flat"
    flat.mkdir()
    for name in ("mocap-desk", "mocap-6dof"):
        shutil.copy(root / "tum-vie/mocap-desk-events_left.h5", flat / f"{name}-events_left.h5")
    shutil.copy(root / "tum-vie/camera-calibrationA.json", flat)
    assert sequences_in(flat, None) == (flat / "mocap-6dof", flat / "mocap-desk")
