"""Dialects and side files declare what sequences do not, and the record says who declares what."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.errors import MisuseError
from fedora_qa.layout.dialect import DialectChoice, load_choice, load_dialect, load_side_metadata
from fedora_qa.sequence.sequence import open_sequence
from tests.support.foreign import write_m3ed
from tests.support.handmade import write_handmade

MINE = """
name = "mine"
[datasets]
"path/events/x" = { path = "prophesee/left/x" }
"path/events/y" = { path = "prophesee/left/y" }
"path/events/t" = { path = "prophesee/left/t" }
"path/events/p" = { path = "prophesee/left/p" }
[metadata]
kind = "recorded"
"metadata/events/model" = "log"
"metadata/events/threshold_on" = 0.2
"metadata/events/threshold_off" = { path = "thresholds", entry = 1 }
"metadata/cameras/events/K" = { path = "calib/intrinsics", convert = "fx_fy_cx_cy" }
"metadata/cameras/events/width" = { path = "calib/resolution", entry = 0 }
"metadata/cameras/events/height" = { path = "calib/resolution", entry = 1 }
"metadata/cameras/events/camera_model" = { path = "calib/model" }
"metadata/cameras/events/distortion_model" = "equidistant"
"metadata/cameras/events/distortion" = { path = "calib/distortion_coeffs" }
"metadata/cameras/events/exposure_us" = { path = "calib", attribute = "exposure" }
"metadata/cameras/events/T_body_camera" = [
  { value = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]] },
  { path = "calib/T", invert = true },
]
"metadata/depth_range" = [0.5, 20]
sequence = "street"
"""

T = np.array([[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, -2], [0, 0, 0, 1.0]])


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = write_m3ed(tmp_path / "m3ed.h5")
    with h5py.File(path, "a") as file:
        file["thresholds"] = [0.1, 0.3]
        file["calib/intrinsics"] = [100.0, 101.0, 5.5, 4.5]
        file["calib/resolution"] = [12, 10]
        file["calib/model"] = "pinhole"
        file["calib/distortion_coeffs"] = [0.1, -0.02, 0.003, 0.0]
        file["calib/T"] = T
        file["calib"].attrs["exposure"] = 250.0
    return path


def written(path: Path, text: str) -> Path:
    path.write_text(text, "utf-8")
    return path


def choice(tmp_path: Path, dialect: str, side: str = "") -> DialectChoice:
    named = str(written(tmp_path / "mine.toml", dialect))
    return load_choice(named, str(written(tmp_path / "side.toml", f"[metadata]\n{side}")) if side else None)


def test_constants_and_paths(recording: Path, tmp_path: Path) -> None:
    """Numbers, text, entries of lists, attributes, intrinsics and products of matrices are declarations."""
    with open_sequence(recording, choice(tmp_path, MINE)) as sequence:
        declared = sequence.declared
    camera, events = declared.cameras["events"], declared.events
    assert (camera.width, camera.height, camera.model, camera.exposure_us) == (12, 10, "pinhole", 250.0)
    np.testing.assert_array_equal(camera.K, [[100, 0, 5.5], [0, 101, 4.5], [0, 0, 1]])
    axes = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(camera.T_body_camera, axes @ np.linalg.inv(T), atol=1e-15)
    assert events is not None
    assert (events.model, events.threshold_on, events.threshold_off) == ("log", 0.2, 0.3)
    assert (declared.depth_range_m, declared.sequence, declared.kind) == ((0.5, 20.0), "street", "recorded")
    assert not [problem for problem in declared.problems if problem.name]


def test_the_record_says_who_declares(recording: Path, tmp_path: Path) -> None:
    """A side file takes precedence, and is named."""
    with open_sequence(recording, choice(tmp_path, MINE, '"metadata/events/threshold_on" = 0.25')) as sequence:
        assert sequence.declared.events is not None
        assert sequence.declared.events.threshold_on == 0.25
        inferred = sequence.layout.inferred
    assert inferred["declared.metadata/events/threshold_on"] == "side.toml"
    assert inferred["declared.metadata/events/model"] == "dialect mine"
    assert inferred["declared.metadata/cameras/events/K"] == "dialect mine: calib/intrinsics"
    assert inferred["kind"] == "recorded"


def test_side_metadata_need_no_dialect(tmp_path: Path) -> None:
    """Beside a canonical file, one declaration is replaced and all others stay."""
    path = write_handmade(tmp_path / "file.h5")
    side = str(written(tmp_path / "side.toml", '[metadata]\n"metadata/imu/gravity" = 9.8\n'))
    with open_sequence(path) as before, open_sequence(path, load_choice(None, side)) as after:
        assert before.declared.imu is not None
        assert after.declared.imu is not None
        assert (before.declared.imu.gravity, after.declared.imu.gravity) == (9.81, 9.8)
        assert after.declared.imu.gyro_noise_density == before.declared.imu.gyro_noise_density
        assert after.declared.problems == before.declared.problems


def test_an_unknown_response_is_no_declaration(recording: Path, tmp_path: Path) -> None:
    """No thresholds are asked for, and none are assumed."""
    text = MINE.replace('"log"', '"unknown"').replace('"metadata/events/threshold_on" = 0.2\n', "")
    with open_sequence(recording, choice(tmp_path, text)) as sequence:
        assert sequence.declared.events is None
        assert not [problem for problem in sequence.declared.problems if problem.name]


@pytest.mark.parametrize(
    ("old", "new", "name", "words"),
    [
        ("calib/intrinsics", "calib/nowhere", "K", "nothing at calib/nowhere"),
        ("calib/intrinsics", "calib/resolution", "K", "2 numbers where fx, fy, cx, cy"),
        ('path = "calib/resolution", entry = 1', 'path = "calib/resolution", entry = 2', "height", "2 entries"),
        ('attribute = "exposure"', 'attribute = "gain"', "exposure_us", "no attribute gain"),
        ('{ path = "calib/T", invert', '{ path = "thresholds", invert', "T_body_camera", "cannot be inverted"),
        ('path = "calib/model"', 'path = "prophesee/left/x"', "camera_model", "Expected text"),
    ],
)
def test_what_cannot_be_read_is_a_problem(
    old: str, new: str, name: str, words: str, recording: Path, tmp_path: Path
) -> None:
    """One sentence names the declaration; the rest is read."""
    assert old in MINE
    with open_sequence(recording, choice(tmp_path, MINE.replace(old, new))) as sequence:
        problems = {problem.name: problem.message for problem in sequence.declared.problems if problem.name}
    assert set(problems) == {name}
    assert words in problems[name]


def test_large_datasets_are_no_declarations(recording: Path, tmp_path: Path) -> None:
    """A path to a dataset of any size costs no memory."""
    with h5py.File(recording, "a") as file:
        file.create_dataset("large", (1 << 40,), np.uint8, chunks=(1 << 20,))
    text = MINE.replace('path = "calib/intrinsics"', 'path = "large"')
    with open_sequence(recording, choice(tmp_path, text)) as sequence:
        assert any("few numbers" in problem.message for problem in sequence.declared.problems)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[metadata]\n"metadata/cameras/events/F" = 1\n', "metadata.metadata/cameras/events/F"),
        ('[metadata]\nkind = "real"\n', "recorded or synthetic"),
        ('[metadata]\nsequence = { path = "a", unit = "m" }\n', "unit"),
        ("[datasets]\n", "datasets"),
        ("[metadata\n", "TOML"),
    ],
)
def test_side_files_are_read_strictly(text: str, words: str, tmp_path: Path) -> None:
    """A wrong key is one sentence."""
    with pytest.raises(MisuseError, match=words):
        load_side_metadata(written(tmp_path / "side.toml", text))
    with pytest.raises(MisuseError, match="missing"):
        load_side_metadata(tmp_path / "missing.toml")


BASALT = """
name = "basalt"
[files]
poses = "poses.txt"
calibration = "calibration.json"
[datasets]
"path/pose/ts" = { file = "poses", columns = [0], time_unit = "s" }
"path/pose/position" = { file = "poses", columns = [1, 2, 3, 4, 5, 6, 7], convert = "position_quaternion", quaternion = "wxyz" }
"path/pose/orientation" = { file = "poses", columns = [1, 2, 3, 4, 5, 6, 7], convert = "position_quaternion", quaternion = "wxyz" }
[metadata]
"metadata/T_posed_body" = { file = "calibration", path = "value0/T_imu_cam/1", convert = "position_quaternion", invert = true }
"metadata/cameras/events/width" = 12
"metadata/cameras/events/height" = 10
"metadata/cameras/events/K" = { file = "calibration", path = "value0/intrinsics/0/intrinsics", convert = "fx_fy_cx_cy" }
"metadata/cameras/events/distortion_model" = "equidistant"
"metadata/cameras/events/distortion" = { file = "calibration", path = "value0/intrinsics/0/intrinsics", convert = "k1_k2_k3_k4" }
"metadata/cameras/events/T_body_camera" = { file = "calibration", path = "value0/T_imu_cam/1", convert = "position_quaternion" }
"""  # noqa: E501 - tables of TOML end with their line


@pytest.fixture
def basalt(tmp_path: Path) -> Path:
    """Poses with the scalar first, and a calibration as Basalt writes it."""
    folder = tmp_path / "basalt"
    folder.mkdir()
    half = np.sqrt(0.5)
    written(folder / "poses.txt", f"0.0 1 2 3 {half} 0 0 {half}\n0.5 1 2 4 {half} 0 0 {half}\n")
    lens = {"fx": 9.0, "fy": 8.0, "cx": 5.5, "cy": 4.5, "k1": 0.1, "k2": -0.02, "k3": 0.003, "k4": -0.0004}
    turned = {"px": 0.5, "py": 0.0, "pz": -0.25, "qx": half, "qy": 0.0, "qz": 0.0, "qw": half}
    document = {"value0": {"T_imu_cam": [{}, turned], "intrinsics": [{"camera_type": "kb4", "intrinsics": lens}]}}
    written(folder / "calibration.json", json.dumps(document))
    return folder


def test_calibrations_of_basalt(basalt: Path, tmp_path: Path) -> None:
    """Tables that name their numbers are cameras, lenses and transformations, by which poses are those of the body."""
    with open_sequence(basalt, choice(tmp_path, BASALT)) as sequence:
        assert not sequence.layout.problems
        camera = sequence.declared.cameras["events"]
        np.testing.assert_array_equal(camera.K, [[9, 0, 5.5], [0, 8, 4.5], [0, 0, 1]])
        assert camera.lens is not None
        assert (camera.lens.model, camera.lens.coefficients) == ("equidistant", (0.1, -0.02, 0.003, -0.0004))
        # A quarter turn about X, and a quarter turn about Z of what is posed.
        T = np.array([[1, 0, 0, 0.5], [0, 0, -1, 0], [0, 1, 0, -0.25], [0, 0, 0, 1]])
        np.testing.assert_allclose(camera.T_body_camera, T, atol=1e-15)
        posed = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 4], [0, 0, 0, 1]])
        expected = posed @ np.linalg.inv(T)
        np.testing.assert_allclose(sequence.rows("path/pose/position", 1, 2)[0], expected[:3, 3], atol=1e-12)
        read = Rotation.from_quat(sequence.rows("path/pose/orientation", 1, 2)[0]).as_matrix()
        np.testing.assert_allclose(read, expected[:3, :3], atol=1e-12)


def test_poses_of_a_frame_that_nothing_places_are_left_out(basalt: Path, tmp_path: Path) -> None:
    """They would be taken for poses of the body; a side file may place the frame."""
    (basalt / "calibration.json").unlink()
    with open_sequence(basalt, choice(tmp_path, BASALT)) as sequence:
        assert sequence.layout.absent["pose"] == (
            "the file that declares metadata/T_posed_body, by which poses are those of the body, is missing"
        )
        assert not sequence.layout.problems
    side = '"metadata/T_posed_body" = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n'
    with open_sequence(basalt, choice(tmp_path, BASALT, side)) as sequence:
        np.testing.assert_allclose(sequence.rows("path/pose/position", 0, 1)[0], [1, 2, 3])


@pytest.mark.parametrize(
    ("instead", "words"),
    [({"k3": 0.003, "k4": 0.1}, "a table without k1, k2"), ({"qw": 0.9}, "a quaternion of length 1.14, not 1")],
)
def test_a_calibration_of_another_kind_is_named(
    basalt: Path, tmp_path: Path, instead: dict[str, float], words: str
) -> None:
    """A lens of another model has no k1, and a quaternion is of unit length."""
    path = basalt / "calibration.json"
    document = json.loads(path.read_text("utf-8"))
    if "qw" in instead:
        document["value0"]["T_imu_cam"][1] |= instead
    else:
        document["value0"]["intrinsics"][0]["intrinsics"] = instead
    written(path, json.dumps(document))
    with open_sequence(basalt, choice(tmp_path, BASALT)) as sequence:
        problems = [made.problem for made in sequence.layout.supplied.values() if made.problem]
    assert any(words in problem for problem in problems)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[files]\na = "../*.h5"\n', "files.a: Expected a pattern"),
        ('[files]\na = "/etc/*.txt"\n', "files.a: Expected a pattern"),
        ('[files]\na = "**/*.h5"\n', "files.a: Expected a pattern"),
        ('[files]\na = "*.bag"\n', "ends in one of"),
        ('[files]\na = ["*.h5", "*.png"]\n', "of one format"),
        ("[files]\na = []\n", "one or more patterns"),
        (
            '[files]\na = "a.h5"\n[datasets]\n"path/rgb" = { file = "b" }\n',
            "datasets.path/rgb: Expected file to be a role",
        ),
        ('[datasets]\n"path/rgb" = { file = "b" }\n', "as the dialect has no"),
        ('[metadata]\nsequence = { file = "b", path = "x" }\n', "metadata.sequence: Expected file"),
        ('[datasets]\n"path/rgb" = { convert = "magic" }\n', "convert"),
    ],
)
def test_dialects_of_folders_are_read_strictly(text: str, words: str, tmp_path: Path) -> None:
    """A role that no pattern has, and a pattern that leads out of the folder, are one sentence."""
    with pytest.raises(MisuseError, match=words):
        load_dialect(written(tmp_path / "mine.toml", f'name = "mine"\n{text}'))
