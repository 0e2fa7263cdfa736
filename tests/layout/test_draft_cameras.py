"""A draft offers the cameras of documents and text, and the lines that a person fills in, so that they are read."""

import json
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.layout.dialect import load_dialect
from fedora_qa.layout.draft_folder import draft_folder
from fedora_qa.layout.folder import OpenFolder, match_folder
from fedora_qa.layout.resolve import resolve
from fedora_qa.sequence.sequence import open_sequence
from tests.support.dsec_folder import write_png

QUARTER = np.sqrt(0.5)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Colour images with times, and events in columns."""
    folder = tmp_path / "flight"
    (folder / "images").mkdir(parents=True)
    for number in range(6):
        write_png(folder / f"images/{number}.png", np.zeros((8, 10, 3), np.uint8))
    (folder / "times.txt").write_text("".join(f"{50_000 * n}\n" for n in range(6)))
    events = [[n * 0.5, n % 10, n % 8, n % 2] for n in range(400)]
    np.save(folder / "events.npy", np.array(events))
    return folder


def uncommented(text: str, *beginnings: str) -> str:
    """Return the draft with the remarks that begin so as lines of its own."""
    lines = text.splitlines()
    return "\n".join(
        line[2:] if any(line.startswith(f"# {beginning}") for beginning in beginnings) else line for line in lines
    )


@pytest.mark.parametrize(
    "names", [("fx", "fy", "cx", "cy"), ("fx", "fy", "ppx", "ppy"), ("focalX", "focalY", "centerX", "centerY")]
)
def test_a_document_named_by_its_camera(names: tuple[str, ...], folder: Path, tmp_path: Path) -> None:
    """Intrinsics and size are read from it, by each of the names in use."""
    document = dict(zip(names, (9.0, 8.0, 4.5, 3.5), strict=True)) | {"width": 10, "height": 8}
    (folder / "dvs.json").write_text(json.dumps(document))
    (folder / "other.json").write_text(json.dumps(document))
    text = draft_folder(folder, "drafted")
    assert 'but of which? "metadata/cameras/.../K" = { file = "other", convert = "fx_fy_cx_cy" }' in text
    path = tmp_path / "mine.toml"
    path.write_text(uncommented(text, '"metadata/cameras/events/T_body_camera"'), "utf-8")
    with open_sequence(folder, load_dialect(path)) as sequence:
        camera = sequence.declared.cameras["events"]
    np.testing.assert_array_equal(camera.K, [[9, 0, 4.5], [0, 8, 3.5], [0, 0, 1]])
    assert (camera.width, camera.height) == (10, 8)


def test_a_second_matrix_of_a_camera_is_a_remark(folder: Path, tmp_path: Path) -> None:
    """TOML has each key once, so that the draft is read."""
    intrinsics = {"fx": 9.0, "fy": 8.0, "cx": 4.5, "cy": 3.5}
    (folder / "calibration.json").write_text(json.dumps({"event": {"left": intrinsics, "right": intrinsics}}))
    text = draft_folder(folder, "drafted")
    assert '\n# "metadata/cameras/events/K" = { file = "calibration", path = "event/right"' in text
    path = tmp_path / "mine.toml"
    path.write_text(text, "utf-8")
    assert load_dialect(path).name == "drafted"


@pytest.mark.parametrize(
    ("name", "content", "remark"),
    [
        ("calib.txt", "9 8 4.5 3.5 -0.1 0.2 0 0\n", '"metadata/cameras/.../distortion" = [-0.1, 0.2, 0.0, 0.0]'),
        (
            "calib.txt",
            "9 8 4.5 3.5 0 0 0 0 0\n",
            '"metadata/cameras/.../K" = [[9.0, 0, 4.5], [0, 8.0, 3.5], [0, 0, 1]]',
        ),
        ("K.txt", "9 0 4.5\n0 8 3.5\n0 0 1\n", '"metadata/cameras/.../K" = [[9.0, 0.0, 4.5], [0.0, 8.0, 3.5]'),
    ],
)
def test_the_numbers_of_a_calibration_in_text(name: str, content: str, remark: str, folder: Path) -> None:
    """No declaration reads text, so that the draft states the numbers."""
    (folder / name).write_text(content)
    text = draft_folder(folder, "drafted")
    assert f"# {name} may be a camera" in text
    assert remark in text


def test_the_response_of_the_event_sensor(folder: Path, tmp_path: Path) -> None:
    """Without it delays are not judged, so that the draft has its lines, which are read once they are filled in."""
    text = draft_folder(folder, "drafted")
    assert "delays of less than a few frames and lost events are not detected" in text
    path = tmp_path / "mine.toml"
    filled = uncommented(text, '"metadata/events/').replace("= ON", "= 0.2").replace("= OFF", "= 0.3")
    path.write_text(filled, "utf-8")
    with open_sequence(folder, load_dialect(path)) as sequence:
        sensor = sequence.declared.events
    assert sensor is not None
    assert (sensor.threshold_on, sensor.threshold_off) == (0.2, 0.3)
    assert "position_sigma" not in text


@pytest.mark.parametrize("form", ["quaternions", "matrices"])
def test_poses_of_a_camera(form: str, folder: Path, tmp_path: Path) -> None:
    """The lines of the draft make them those of the body, whose X is the camera's Z and whose Z is up."""
    # The camera looks along Y of the world: its X is the world's X, its Y down.
    camera = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    if form == "quaternions":
        quaternion = camera.as_quat().tolist()
        rows = [[0.05 * n, n, 2, 3, *quaternion] for n in range(6)]
    else:
        matrix = np.eye(4)
        matrix[:3, :3] = camera.as_matrix()
        rows = [np.where(np.arange(16) == 3, n, matrix.reshape(-1)).tolist() for n in range(6)]
    (folder / "poses.txt").write_text("".join(" ".join(map(str, row)) + "\n" for row in rows))
    text = draft_folder(folder, "drafted")
    lines = uncommented(text, '"metadata/T_posed_body"', '"path/pose/').splitlines()
    # "in place of those above"
    replaced = [line.partition(" = ")[0] for line in lines if "position_quaternion" in line]
    moved = [line for line in lines if "position_quaternion" in line]
    kept = [line for line in lines if line not in moved and line.partition(" = ")[0] not in replaced]
    at = kept.index("[datasets]") + 1
    path = tmp_path / "mine.toml"
    path.write_text("\n".join([*kept[:at], *moved, *kept[at:]]), "utf-8")
    with closing(OpenFolder(match_folder(folder, load_dialect(path)))) as opened:
        assert "pose" in resolve(opened).streams
    with open_sequence(folder, load_dialect(path)) as sequence:
        body = Rotation.from_quat(sequence.rows("path/pose/orientation", 0, 6))
        positions = sequence.rows("path/pose/position", 0, 6)
    np.testing.assert_allclose(body.apply([1, 0, 0]), [[0, 1, 0]] * 6, atol=1e-12)
    np.testing.assert_allclose(body.apply([0, 0, 1]), [[0, 0, 1]] * 6, atol=1e-12)
    np.testing.assert_allclose(positions[:, 0], np.arange(6), atol=1e-12)
