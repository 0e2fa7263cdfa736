"""Datasets as their makers lay them out are clean where they are correct, and their faults are found and named."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.layout.dialect import load_choice
from fedora_qa.record.types import FileRecord
from fedora_qa.sequence.sequence import open_sequence
from tests.support.all_checks import CHECKS
from tests.support.checked import checks_that_read
from tests.support.eds_folder import write_eds_folder, write_eds_side
from tests.support.event_view import TwoViews, camera_poses, two_views
from tests.support.m3ed_folder import write_m3ed_folder, write_m3ed_side
from tests.support.mvsec_folder import write_mvsec_folder, write_mvsec_side
from tests.support.shared_files import SharedFiles
from tests.support.simulator_layouts import (
    write_purdue_lab_file,
    write_shared_camera,
    write_v2e_file,
    write_vid2e_folder,
)
from tests.support.tum_vie_folder import write_tum_vie_folder, write_tum_vie_side

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Layout:
    """A layout of the package.

    Attributes
    ----------
    name
        Of the stand-in.
    source
        Through which cameras its content is taken.
    write
        Writes it.
    side
        Writes what its makers do not declare and what is true of it; None: nothing.
    streams
        Which are read without the side file.
    checked
        Checks that apply with the side file and could not without it, or that matter most.
    """

    name: str
    source: Literal["pinhole", "radtan", "equidistant"]
    write: Callable[[TwoViews, Path], Path]
    side: Callable[[TwoViews, Path], Path] | None
    streams: frozenset[str]
    checked: frozenset[str]


OF_IMU = ("imu.rotation", "imu.translation", "imu.timing")
ALIGNED = ("alignment.events", "event_response.orientation")

LAYOUTS = {
    "m3ed": Layout(
        "falcon",
        "radtan",
        write_m3ed_folder,
        lambda _, path: write_m3ed_side(path),
        frozenset({"rgb", "depth", "events", "imu", "pose", "rgb_to_event", "depth_to_event"}),
        frozenset(
            {
                "index_maps.rgb",
                "index_maps.depth",
                "index_maps.milliseconds",
                "depth.consistency",
                "depth.scale",
                "alignment.events",
                "imu.rotation",
                "imu.translation",
                "imu.timing",
            }
        ),
    ),
    "mvsec": Layout(
        "flying",
        "pinhole",
        write_mvsec_folder,
        lambda _, path: write_mvsec_side(path),
        frozenset({"rgb", "depth", "events", "imu", "pose", "flow/20hz", "rgb_to_event"}),
        frozenset(
            {
                "index_maps.rgb",
                "flow_geometry.endpoint",
                "depth.scale",
                "alignment.events",
                "imu.rotation",
                "imu.translation",
                "imu.timing",
            }
        ),
    ),
    "v2e": Layout(
        "video.h5",
        "pinhole",
        write_v2e_file,
        write_shared_camera,
        frozenset({"rgb", "events", "rgb_to_event"}),
        frozenset({"index_maps.rgb", "event_response.threshold", "alignment.events"}),
    ),
    "vid2e": Layout(
        "video",
        "pinhole",
        write_vid2e_folder,
        write_shared_camera,
        frozenset({"rgb", "events"}),
        frozenset({"index_maps.milliseconds", "event_response.threshold", "alignment.events"}),
    ),
    "tum-vie": Layout(
        "mocap-desk",
        "equidistant",
        write_tum_vie_folder,
        lambda _, path: write_tum_vie_side(path),
        frozenset({"rgb", "events", "imu", "pose"}),
        frozenset({"index_maps.milliseconds", *ALIGNED, *OF_IMU}),
    ),
    "eds": Layout(
        "11_all_characters",
        "radtan",
        write_eds_folder,
        write_eds_side,
        frozenset({"rgb", "events", "pose"}),
        frozenset({*ALIGNED, *OF_IMU}),
    ),
    "purdue-lab": Layout(
        "log.hdf5",
        "pinhole",
        write_purdue_lab_file,
        None,
        frozenset({"rgb", "depth", "events"}),
        frozenset({"clocks.rate", "event_stream.gaps", "images.exposure"}),
    ),
}


@pytest.fixture(scope="module")
def sources(shared_files: SharedFiles) -> dict[str, TwoViews]:
    return {
        "pinhole": two_views(shared_files),
        "radtan": two_views(shared_files, lens="radtan"),
        "equidistant": two_views(shared_files, lens="equidistant"),
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("datasets")


@pytest.fixture(scope="module")
def sides(sources: dict[str, TwoViews], folder: Path) -> dict[str, Path]:
    """The side file of each layout that has one."""
    return {
        name: layout.side(sources[layout.source], folder / f"{name}.toml")
        for name, layout in LAYOUTS.items()
        if layout.side is not None
    }


@pytest.fixture(scope="module")
def stand_ins(sources: dict[str, TwoViews], folder: Path) -> dict[str, Path]:
    """The correct stand-in of each layout."""
    for name in LAYOUTS:
        (folder / name).mkdir()
    return {name: layout.write(sources[layout.source], folder / name / layout.name) for name, layout in LAYOUTS.items()}


def check(place: Path, side: Path | None, select: tuple[str, ...] = ()) -> FileRecord:
    choice = load_choice(None, str(side) if side else None)
    return check_file(place, CheckOptions(dialect=choice, profile="release", evidence=None, select=select)).record


def outcomes(record: FileRecord, *wanted: str) -> set[str]:
    return {result.check for result in record.results if result.outcome in wanted}


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_correct_sequence_has_no_finding(name: str, stand_ins: dict[str, Path], sides: dict[str, Path]) -> None:
    """It is recognised, every stream is read, and what a side file declares lets more be checked."""
    layout, side = LAYOUTS[name], sides.get(name)
    record = check(stand_ins[name], side)
    assert record.dialect == name
    assert outcomes(record, "failed") == set()
    assert record.verdict == ("clean" if side else "incomplete")  # without cameras little can be told
    assert layout.checked <= outcomes(record, "passed")
    with open_sequence(stand_ins[name]) as sequence:
        assert sequence.layout.streams == layout.streams
        assert not sequence.layout.problems
    if side:
        alone = check(stand_ins[name], None)
        assert outcomes(alone, "failed") == set()
        assert outcomes(alone, "passed") < outcomes(record, "passed")


@pytest.mark.parametrize("name", ["mvsec", "eds"])
def test_thresholds_that_nobody_declares_are_measured(name: str, stand_ins: dict[str, Path]) -> None:
    """Where frames and events share a camera, they are those of the source, and not judged."""
    record = check(stand_ins[name], None, ("event_response.threshold",))
    assert outcomes(record, "not_observable") == {"event_response.threshold"}
    for polarity in ("on", "off"):
        assert record.inferred[f"events.threshold_{polarity}_nat"] == pytest.approx(0.2, rel=0.05)


def test_poses_and_depth_of_m3ed_are_those_of_the_source(
    sources: dict[str, TwoViews], stand_ins: dict[str, Path]
) -> None:
    """Poses count from the first one of the camera; the body is that camera with X forward."""
    with open_sequence(stand_ins["m3ed"]) as sequence, h5py.File(sources["radtan"].event_sized) as file:
        T_world_camera = camera_poses(file, file["path/depth_ts"][:])
        T_body_camera = sequence.declared.cameras["depth"].T_body_camera
        expected = T_body_camera[:3, :3].T  # the first pose of the body, seen by its camera
        first = Rotation.from_quat(sequence.rows("path/pose/orientation", 0, 1)[0]).as_matrix()
        np.testing.assert_allclose(first, expected, atol=1e-9)
        moved = np.linalg.inv(T_world_camera[0]) @ T_world_camera[-1]
        rows = sequence.layout.bindings["path/pose/position"].rows
        np.testing.assert_allclose(sequence.rows("path/pose/position", rows - 1, rows)[0], moved[:3, 3], atol=1e-9)
        np.testing.assert_allclose(sequence.rows("path/depth", 3, 4), file["path/depth"][3:4], rtol=1e-6)


def test_flow_of_mvsec_is_that_of_the_source(sources: dict[str, TwoViews], stand_ins: dict[str, Path]) -> None:
    """Channels come last, intervals reach to the next frame, and the last frame begins none."""
    with open_sequence(stand_ins["mvsec"]) as sequence, h5py.File(sources["pinhole"].event_sized) as file:
        rows = sequence.layout.bindings["path/flow/20hz"].rows
        assert rows == len(file["path/flow/20hz"])
        read = sequence.rows("path/flow/20hz", 2, rows)
        np.testing.assert_allclose(read, file["path/flow/20hz"][2:], atol=1e-6)
        intervals = sequence.rows("path/flow/20hz_ts", 2, rows) - sequence.rows("path/depth_ts", 0, 1)
        np.testing.assert_allclose(intervals, file["path/flow/20hz_ts"][2:] * 1000, atol=500)


def altered(path: Path, dataset: str, alter: Callable[[Array], Array]) -> None:
    with h5py.File(path, "a") as file:
        file[dataset][...] = alter(file[dataset][:])


def late(column: int, by: float) -> Callable[[Array], Array]:
    """Delay the events of a table."""
    return lambda rows: rows + by * (np.arange(rows.shape[1]) == column).astype(rows.dtype)


FAULTS: dict[str, tuple[str, str, Callable[[Array], Array], str, str]] = {
    "events of M3ED late by 3 ms": (
        "m3ed", "falcon_data.h5:prophesee/left/t", lambda t: t + 3000, "index_maps.rgb", "time_offset",
    ),
    "a map of M3ED that is off by one": (
        "m3ed", "falcon_data.h5:ovc/ts_map_prophesee_left_t", lambda k: k + 1, "index_maps.rgb", "index_off_by_one",
    ),
    "a map of M3ED from milliseconds that is off by one": (
        "m3ed", "falcon_data.h5:prophesee/left/ms_map_idx", lambda k: k + 1, "index_maps.milliseconds",
        "index_off_by_one",
    ),
    "depth of M3ED that is 2% too large": (
        "m3ed", "falcon_depth_gt.h5:depth/prophesee/left", lambda z: 1.02 * z, "depth.scale", "unknown",
    ),
    "an IMU of M3ED that is late by 3.3 ms": (
        "m3ed", "falcon_data.h5:ovc/imu/ts", lambda t: t + 3300, "imu.timing", "time_offset",
    ),
    "an IMU of M3ED whose calibration is inverted": (
        "m3ed", "falcon_data.h5:ovc/imu/calib/T_to_prophesee_left", np.linalg.inv, "imu.rotation", "frame_convention",
    ),
    # A stream of the accelerometer that has no weight is of no flight: no cause of the list describes it.
    "an IMU of MVSEC with angular velocity first": (
        "mvsec", "flying1_data.hdf5:davis/left/imu", lambda rows: rows[:, [3, 4, 5, 0, 1, 2]], "imu.rotation",
        "unknown",
    ),
    # Truly quaternion_inverted, but undoing the quaternions alone leaves a third of the deviation.
    "poses of M3ED that are inverted": (
        "m3ed", "falcon_pose_gt.h5:Cn_T_C0", np.linalg.inv, "depth.consistency", "frame_convention",
    ),
    "a map of MVSEC by another definition": (
        "mvsec", "flying1_data.hdf5:davis/left/image_raw_event_inds", lambda k: k + 1, "index_maps.rgb",
        "index_off_by_one",
    ),
    "flow of MVSEC with v before u": (
        "mvsec", "flying1_gt.hdf5:davis/left/flow_dist", lambda flow: flow[:, ::-1], "flow_geometry.endpoint",
        "axes_swapped",
    ),
    "events of v2e with y before x": (
        "v2e", ":events", lambda rows: rows[:, [0, 2, 1, 3]], "event_stream.bounds", "axes_swapped",
    ),
    "events of v2e late by 3 ms": ("v2e", ":events", late(0, 3000), "event_response.timing", "time_offset"),
    "events of vid2e late by 5 ms": ("vid2e", "events.h5:events/t", lambda t: t + 5000, "event_response.timing",
                                     "time_offset"),
    "events of vid2e inverted": (
        "vid2e", "events.h5:events/p", lambda p: 1 - p, "event_response.orientation", "polarity_inverted",
    ),
    "events of TUM-VIE late by 3 ms": (
        "tum-vie", "mocap-desk-events_left.h5:events/t", lambda t: t + 3000, "index_maps.milliseconds", "time_offset",
    ),
    "events of TUM-VIE inverted": (
        "tum-vie", "mocap-desk-events_left.h5:events/p", lambda p: 1 - p, "event_response.orientation",
        "polarity_inverted",
    ),
    "events of EDS inverted": (
        "eds", "events.h5:p", lambda p: 1 - p, "event_response.orientation", "polarity_inverted",
    ),
    "colour of the lab stamped in milliseconds": (
        "purdue-lab", ":path/imgts", lambda t: t / 1000, "clocks.unit", "time_unit",
    ),
    "events of the lab out of order": (
        "purdue-lab", ":path/events", lambda rows: np.concatenate([rows[:1000], rows[1000:3000][::-1], rows[3000:]]),
        "clocks.order", "unsorted",
    ),
}  # fmt: skip
"""By what is wrong: the layout, the file in it and its dataset, what is done to it, the check that fails, the cause."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_found(
    fault: str, stand_ins: dict[str, Path], sides: dict[str, Path], tmp_path: Path
) -> None:
    """The check that measures it fails; its cause is named where the sequence tells it from others.

    All checks are asked that read a stream of that check.
    """
    name, place, alter, check_name, cause = FAULTS[fault]
    copy = tmp_path / stand_ins[name].name
    (shutil.copytree if stand_ins[name].is_dir() else shutil.copy)(stand_ins[name], copy)
    file, _, dataset = place.partition(":")
    altered(copy / file if file else copy, dataset, alter)
    (needs,) = (each.needs for each in CHECKS if each.name == check_name)
    record = check(copy, sides.get(name), checks_that_read(*needs))
    assert record.verdict == "findings"
    assert check_name in outcomes(record, "failed")
    assert cause in {diagnosis.cause for diagnosis in record.diagnoses}


def test_what_a_real_sensor_has_is_stated_and_not_judged(stand_ins: dict[str, Path], tmp_path: Path) -> None:
    """Biases of a recorded IMU that nobody declared are properties; of a synthetic one they are faults."""
    copy = Path(shutil.copytree(stand_ins["m3ed"], tmp_path / "falcon"))
    altered(copy / "falcon_data.h5", "ovc/imu/omega", lambda rows: rows + np.array([0.01, 0.0, 0.0]))
    select = ("imu.rotation",)
    record = check_file(copy, CheckOptions(select=select, profile="release", evidence=None)).record
    assert outcomes(record, "passed") == {"imu.rotation"}
    biases = [record.inferred[f"imu.gyro_bias_{axis}_rad_s"] for axis in "xyz"]
    assert np.linalg.norm(np.array(biases, np.float64)) == pytest.approx(0.01, rel=0.01)
    side = tmp_path / "side.toml"
    side.write_text('[metadata]\nkind = "synthetic"\n')
    options = CheckOptions(select=select, dialect=load_choice(None, str(side)), profile="release", evidence=None)
    assert outcomes(check_file(copy, options).record, "failed") == {"imu.rotation"}


def test_an_imu_in_unknown_axes_is_left_out(stand_ins: dict[str, Path], tmp_path: Path) -> None:
    """Without the calibration nothing can be said of the IMU, and nothing is."""
    copy = Path(shutil.copytree(stand_ins["mvsec"], tmp_path / "flying"))
    next(copy.glob("camchain-*")).unlink()
    with open_sequence(copy) as sequence:
        assert "imu" not in sequence.layout.streams
        assert "metadata/T_body_imu" in sequence.layout.absent["imu"]
        assert not sequence.layout.problems
