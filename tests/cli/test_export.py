"""``fedora-qa export`` from end to end: what it writes is clean, and nothing is left behind where it is refused."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.layout.dialect import load_choice
from fedora_qa.sequence.sequence import open_sequence
from tests.cli.conftest import Command
from tests.support.dsec_folder import write_dsec_folder, write_side_metadata
from tests.support.sequences import CleanSequence


@pytest.fixture
def source(clean_sequence: CleanSequence) -> Path:
    return clean_sequence("park-day")


def names(folder: Path) -> list[str]:
    """What lies in a folder, hidden files too."""
    return sorted(path.name for path in folder.iterdir())


def test_a_folder_of_dsec_is_clean(fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """What is written has the values of the source, and is checked without a finding."""
    out = tmp_path / "park"
    done = fedora_qa("export", source, out, "--to", "dsec")
    assert done.code == 0, done.err
    assert names(tmp_path) == ["park"]
    side = write_side_metadata(tmp_path / "side.toml")
    checked = fedora_qa("check", out, "--metadata", side)
    assert checked.code == 0, checked.out
    with open_sequence(source) as before, open_sequence(out, load_choice(None, str(side))) as after:
        count = before.layout.bindings["path/events/t"].rows
        assert f"events {count}, rgb " in done.out
        for key in ("path/events/x", "path/events/y", "path/events/t", "path/events/p"):
            np.testing.assert_array_equal(after.rows(key, 0, count), before.rows(key, 0, count))
        np.testing.assert_array_equal(after.rows("path/rgb", 2, 4), before.rows("path/rgb", 2, 4))
        flow_px = after.rows("path/flow/10hz", 1, 2)
        np.testing.assert_allclose(flow_px, before.rows("path/flow/10hz", 1, 2), atol=0.5 / 128 + 1e-6)
        own, other = (np.linalg.inv(each.declared.cameras["depth"].T_body_camera) for each in (before, after))
        for name in ("rgb", "events"):
            camera, expected = after.declared.cameras[name], before.declared.cameras[name]
            np.testing.assert_allclose(camera.K, expected.K)
            np.testing.assert_allclose(other @ camera.T_body_camera, own @ expected.T_body_camera, atol=1e-12)
    with h5py.File(out / "events/left/events.h5") as file:
        times = file["events/t"][:]
        milliseconds = np.arange(int(times[-1]) // 1000 + 1) * 1000
        np.testing.assert_array_equal(file["ms_to_idx"], np.searchsorted(times, milliseconds))


def test_a_trajectory_returns(fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """Poses read back from the text are those of the source."""
    out = tmp_path / "park.tum"
    done = fedora_qa("export", source, out, "--to", "tum")
    assert done.code == 0, done.err
    rows = np.loadtxt(out)
    with h5py.File(source) as file:
        np.testing.assert_allclose(rows[:, 0], file["path/pose/ts"][:] / 1e6, atol=1e-9)
        np.testing.assert_array_equal(rows[:, 1:4], file["path/pose/position"])
        np.testing.assert_array_equal(rows[:, 4:], file["path/pose/orientation"])


def test_a_folder_becomes_one_file(fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """It is read without a dialect, clean like the folder, and what has no place is named."""
    folder = write_dsec_folder(source, tmp_path / "dsec")
    side = write_side_metadata(tmp_path / "side.toml")
    done = fedora_qa("export", folder, tmp_path / "one.h5", "--to", "fedora", "--metadata", side)
    assert done.code == 0, done.err
    assert "metadata/ms_to_event is left out" in done.out
    checked = fedora_qa("check", tmp_path / "one.h5")
    assert checked.code == 0, checked.out
    assert names(tmp_path) == ["dsec", "one.h5", "side.toml"]


def without_poses(file: h5py.File) -> None:
    del file["path/pose"]


def with_far_events(file: h5py.File) -> None:
    file["path/events/t"][-1] += 2**32


def with_odd_polarity(file: h5py.File) -> None:
    file["path/events/p"][5] = 7


def with_another_centre(file: h5py.File) -> None:
    matrix = file["metadata/cameras/events"].attrs["T_body_camera"]
    matrix[0, 3] += 0.02
    file["metadata/cameras/events"].attrs["T_body_camera"] = matrix


@pytest.mark.parametrize(
    ("alter", "form", "part"),
    [
        (without_poses, "tum", "Expected poses"),
        (with_far_events, "dsec", "within 71 minutes"),
        (with_odd_polarity, "dsec", "Expected polarity 0 or 1"),
        (with_another_centre, "dsec", "share their centre"),
    ],
)
def test_what_does_not_fit_is_refused(  # type: ignore[no-untyped-def]
    alter, form: str, part: str, fedora_qa: Command, source: Path, tmp_path: Path
) -> None:
    """One sentence, and no part of an output."""
    copy = tmp_path / "copy.h5"
    copy.write_bytes(source.read_bytes())
    with h5py.File(copy, "a") as file:
        alter(file)
    done = fedora_qa("export", copy, tmp_path / "out", "--to", form)
    assert done.code == 2
    assert part in done.err
    assert names(tmp_path) == ["copy.h5"]


def test_outputs_are_protected(fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """An output that exists, or has no folder, is refused before any work."""
    (tmp_path / "mine").write_text("mine")
    for output in (tmp_path / "mine", tmp_path, tmp_path / "none/out", source):
        assert fedora_qa("export", source, output, "--to", "dsec").code == 2
    assert (tmp_path / "mine").read_text() == "mine"
    assert names(tmp_path) == ["mine"]


def test_a_folder_without_a_sequence_is_misuse(fedora_qa: Command, tmp_path: Path) -> None:
    """As in the other commands: nothing in it could be described by a dialect."""
    (empty := tmp_path / "empty").mkdir()
    done = fedora_qa("export", empty, tmp_path / "out", "--to", "tum")
    assert (done.code, names(tmp_path)) == (2, ["empty"])
    assert "got a folder without files" in done.err
