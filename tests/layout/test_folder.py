"""Files of a folder are matched with roles, opened lazily, and none outside of it is read."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.errors import MisuseError, NotHdf5Error, UnreadableRowsError
from fedora_qa.layout.dialect import load_dialect
from fedora_qa.layout.folder import match_folder, matched_folder, recognise_folder, sequences_in
from fedora_qa.sequence.sequence import open_sequence
from fedora_qa.sources import images
from fedora_qa.sources.images import ImageForm, read_image
from fedora_qa.storage.digest import file_digest
from fedora_qa.storage.folder import divided_names, local_version, part_folders
from tests.sources.test_exr import write_exr
from tests.support.dsec_folder import write_dsec_folder, write_png
from tests.support.handmade import write_handmade

MINE = """
name = "mine"
[files]
data = ["*_data.h5", "data.h5"]
frames = "cam*/*.png"
depth = "depth/*.npy"
poses = "poses.npz"
[datasets]
"path/events/x" = { file = "data", path = "x" }
"path/events/y" = { file = "data", path = "y" }
"path/events/t" = { file = "data", path = "t" }
"path/events/p" = { file = "data", path = "p" }
"path/rgb" = { file = "frames" }
"path/rgb_ts" = { file = "frames", time_unit = "us" }
"path/depth" = { file = "depth", value_unit = "m", invalid = 0.0 }
"path/depth_ts" = { file = "data", path = "depth_ts" }
"path/pose/position" = { file = "poses", path = "T", convert = "matrix4" }
"path/pose/orientation" = { file = "poses", path = "T", convert = "matrix4" }
"path/pose/ts" = { file = "poses", path = "t", time_unit = "ms" }
"""


def write_events(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in (("x", [1, 2]), ("y", [3, 4]), ("t", [10, 20]), ("p", [1, 0])):
            file[name] = np.array(values)
        file["depth_ts"] = np.array([0, 40_000])
    return path


@pytest.fixture
def dialect(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(MINE)
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    root = tmp_path / "run"
    for name in ("cam0", "depth"):
        (root / name).mkdir(parents=True)
    write_events(root / "run7_data.h5")
    for number in range(2):
        write_png(root / f"cam0/{40_000 * number}.png", np.full((4, 5, 3), number, np.uint8))
        np.save(root / f"depth/{number}.npy", np.array([[0.0, 1.5 + number]], np.float32))
    np.savez(root / "poses.npz", T=np.tile(np.eye(4), (3, 1, 1)), t=np.array([0, 20, 40]))
    return root


def test_every_format_is_a_source(folder: Path, dialect: Path) -> None:
    """HDF5, images by their names, a NPY file a row and NPZ give rows in canonical units."""
    with open_sequence(folder, load_dialect(dialect)) as sequence:
        assert sequence.layout.streams == {"events", "rgb", "depth", "pose"}
        assert not sequence.layout.problems
        assert sequence.rows("path/rgb_ts", 0, 2).tolist() == [0, 40_000_000]
        assert sequence.rows("path/rgb", 1, 2).max() == 1
        np.testing.assert_array_equal(sequence.rows("path/depth", 0, 2), [[[np.nan, 1500]], [[np.nan, 2500]]])
        assert sequence.rows("path/pose/ts", 0, 3).tolist() == [0, 20_000_000, 40_000_000]
        np.testing.assert_array_equal(sequence.rows("path/pose/orientation", 0, 3), [[0, 0, 0, 1]] * 3)
        assert sequence.rows("path/events/t", 0, 2).tolist() == [10_000, 20_000]


def test_images_of_renderers_are_sources(folder: Path, tmp_path: Path) -> None:
    """Depth in m and two of four channels of motion, in OpenEXR: 1e10 m is the sky of Blender."""
    for name in ("depth_exr", "vectors"):
        (folder / name).mkdir()
    for number in range(2):
        write_exr(folder / f"depth_exr/{number:04}.exr", {"Z": np.array([[1e10, 1.5 + number]], np.float32)})
        channels = {axis: np.full((1, 2), value + number, np.float32) for value, axis in enumerate("XYZW")}
        write_exr(folder / f"vectors/{number:04}.exr", channels)
    text = MINE.replace('depth = "depth/*.npy"', 'depth = "depth_exr/*.exr"\nvectors = "vectors/*.exr"')
    text = text.replace("invalid = 0.0", "invalid = 1e10")
    text += """"path/flow/25hz" = { file = "vectors", columns = [1, 2] }
"path/flow/25hz_ts" = { file = "data", path = "flow_ts" }
"""
    (tmp_path / "renderer.toml").write_text(text)
    with h5py.File(folder / "run7_data.h5", "a") as file:
        file["flow_ts"] = np.array([[0, 40_000], [40_000, 80_000]])
    with open_sequence(folder, load_dialect(tmp_path / "renderer.toml")) as sequence:
        np.testing.assert_array_equal(sequence.rows("path/depth", 0, 2)[:, 0], [[np.nan, 1500.0], [np.nan, 2500.0]])
        # By name: W, X, Y, Z.
        np.testing.assert_array_equal(sequence.rows("path/flow/25hz", 1, 2)[0, 0], [[1.0, 2.0], [1.0, 2.0]])


@pytest.mark.parametrize(
    ("columns", "order"), [("[1, 2, 3, 4]", "xyzw"), ("[4, 1, 2, 3]", "wxyz"), ("[2, 3, 4, 1]", "xyzw")]
)
def test_columns_of_a_quaternion_are_in_its_order(columns: str, order: str, tmp_path: Path) -> None:
    """Text with other columns beside the quaternion, whose order is stated (EuRoC stores w first)."""
    root = tmp_path / "run"
    root.mkdir()
    text = "0,0.1,0.2,0.3,0.9" if columns != "[2, 3, 4, 1]" else "0,0.9,0.1,0.2,0.3"
    (root / "poses.csv").write_text(f"#t,q\n{text}\n")
    dialect = tmp_path / "mine.toml"
    dialect.write_text(
        f'name = "mine"\n[files]\nposes = "poses.csv"\n[datasets]\n'
        f'"path/pose/orientation" = {{ file = "poses", columns = {columns}, quaternion = "{order}" }}\n'
        '"path/pose/ts" = { file = "poses", columns = [0] }\n'
        '"path/pose/position" = { file = "poses", columns = [1, 1, 1] }\n'
    )
    with open_sequence(root, load_dialect(dialect)) as sequence:
        np.testing.assert_array_equal(sequence.rows("path/pose/orientation", 0, 1), [[0.1, 0.2, 0.3, 0.9]])


def test_roles(folder: Path, dialect: Path) -> None:
    """A star stands for no slash; the first pattern that matches counts; what has no role is unused."""
    (folder / "data.h5").write_bytes(b"unused")
    (folder / "cam0/deeper").mkdir()
    (folder / "cam0/deeper/9.png").touch()
    matched = match_folder(folder, load_dialect(dialect))
    assert matched.place("data") == "run7_data.h5"
    assert matched.place("frames") == "cam*/*.png"
    assert matched.unused == ("cam0/deeper/9.png", "data.h5")
    assert matched.in_words()["frames"] == "cam*/*.png (2 files)"
    (folder / "run7_data.h5").unlink()
    with pytest.raises(NotHdf5Error):
        open_sequence(folder, load_dialect(dialect))
    (folder / "data.h5").unlink()
    with pytest.raises(MisuseError, match=r"Expected \*_data.h5 or data.h5 \(data of the dialect mine\)"):
        open_sequence(folder, load_dialect(dialect))


def test_images_of_two_folders(folder: Path, dialect: Path) -> None:
    """Rows must have one order."""
    (folder / "cam1").mkdir()
    (folder / "cam1/0.png").touch()
    with pytest.raises(MisuseError, match="Expected frames of the dialect mine in one folder, got cam0 and cam1"):
        match_folder(folder, load_dialect(dialect))


def test_a_file_by_itself_plays_the_first_role(tmp_path: Path, dialect: Path) -> None:
    """What lies in other files of the folder is absent, and no fault."""
    with open_sequence(write_events(tmp_path / "x.h5"), load_dialect(dialect)) as sequence:
        assert sequence.layout.streams == {"events"}
        assert not sequence.layout.problems
        assert "has no place for" in sequence.layout.absent["rgb"]


def test_recognition(tmp_path: Path, folder: Path) -> None:
    """Of a folder that fits none nothing is read; a dialect of single files fits no folder."""
    assert recognise_folder(folder) is None
    assert matched_folder(folder, load_dialect("purdue-lab")) is None
    with open_sequence(folder) as sequence:
        assert not sequence.layout.is_recognised
        assert not sequence.layout.streams
    write_handmade(tmp_path / "source.h5")
    matched = recognise_folder(write_dsec_folder(tmp_path / "source.h5", tmp_path / "dsec"))
    assert matched is not None
    assert matched.dialect.name == "dsec"


def test_links_out_of_the_folder_are_not_followed(folder: Path, tmp_path: Path, dialect: Path) -> None:
    """Neither links of the file system, nor those in HDF5, unless the user allows where they lead."""
    write_events(tmp_path / "secret.h5")
    inside = folder / "run7_data.h5"
    with h5py.File(inside, "a") as file:
        del file["x"]
        file["x"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "/x")
    with open_sequence(folder, load_dialect(dialect)) as sequence:
        assert "events" not in sequence.layout.streams
        assert any("outside_link" in problem.code for problem in sequence.layout.problems)
    with open_sequence(folder, load_dialect(dialect), allow_external=[tmp_path]) as sequence:
        assert sequence.rows("path/events/x", 0, 2).tolist() == [1, 2]
    inside.unlink()
    inside.symlink_to(tmp_path / "secret.h5")
    with pytest.raises(MisuseError, match="got no such file"):
        open_sequence(folder, load_dialect(dialect))


def test_a_row_reads_one_image(folder: Path, dialect: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Opening decodes nothing; a row decodes its own image."""
    decoded: list[str] = []

    def counting(path: Path, expected: ImageForm) -> np.ndarray:
        decoded.append(path.name)
        return read_image(path, expected)

    monkeypatch.setattr(images, "read_image", counting)
    with open_sequence(folder, load_dialect(dialect)) as sequence:
        assert decoded == []
        sequence.rows("path/rgb", 1, 2)
    assert decoded == ["40000.png"]


def test_a_row_that_is_gone(folder: Path, dialect: Path) -> None:
    """A file that cannot be read costs its row, which is named."""
    with open_sequence(folder, load_dialect(dialect)) as sequence:
        (folder / "cam0/40000.png").unlink()
        sequence.rows("path/rgb", 0, 1)
        with pytest.raises(UnreadableRowsError) as raised:
            sequence.rows("path/rgb", 0, 2)
    assert raised.value.chunks == (1,)


@pytest.mark.parametrize("name_of", [lambda n: f"{n:06d}.png", lambda n: f"{1_504_645_177_000_000 + 20_000 * n}.png"])
def test_twenty_thousand_images_open_in_two_seconds(name_of: Callable[[int], str], folder: Path, dialect: Path) -> None:
    """Names are listed; one header is read. Seconds of this process, as others use the machine as well."""
    for path in (folder / "cam0").iterdir():
        path.unlink()
    write_png(folder / "cam0" / name_of(0), np.zeros((4, 5, 3), np.uint8))
    for number in range(1, 20_000):
        os.link(folder / "cam0" / name_of(0), folder / "cam0" / name_of(number))
    began_s = time.process_time()
    with open_sequence(folder, load_dialect(dialect)) as sequence:
        spent_s = time.process_time() - began_s
        assert sequence.layout.bindings["path/rgb"].rows == 20_000
    assert spent_s < 2.0


MVSEC = ("a1_data.hdf5", "a1_gt.hdf5", "b2_data.hdf5", "b2_gt.hdf5")
M3ED = ("a_data.h5", "a_pose_gt.h5", "b_data.h5", "b_depth_gt.h5")


def touch(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    return folder


@pytest.mark.parametrize("name", ["named", "recognised"])
@pytest.mark.parametrize(
    ("names", "dialect_name", "sequences"),
    [
        pytest.param((*MVSEC, "camchain-imucam-a.yaml"), "mvsec", {"a1": 3, "b2": 3}, id="one calibration"),
        pytest.param(
            (*MVSEC, "camchain-imucam-a.yaml", "camchain-imucam-b.yaml", "camchain-imucam-a1.yaml"),
            "mvsec",
            {"a1": 3, "b2": 3},
            id="a calibration a scene",
        ),
        pytest.param((*MVSEC, "c/camchain-imucam-a.yaml"), "mvsec", {"a1": 2, "b2": 2}, id="none"),
        pytest.param((*MVSEC[:3], "camchain-imucam-a.yaml"), "mvsec", {"a1": 3, "b2": 2}, id="one without truth"),
        pytest.param(M3ED, "m3ed", {"a": 2, "b": 2}, id="other roles"),
        pytest.param((*M3ED, "a_b_data.h5"), "m3ed", {"a": 2, "a_b": 1, "b": 2}, id="a longer name"),
    ],
)
def test_sequences_side_by_side(
    names: tuple[str, ...], dialect_name: str, sequences: dict[str, int], name: str, tmp_path: Path
) -> None:
    """A folder with files of several sequences is a sequence for each name; a document is shared by all."""
    folder = touch(tmp_path / "flat", *names)
    dialect = load_dialect(dialect_name) if name == "named" else None
    assert sequences_in(folder, dialect) == tuple(folder / each for each in sequences)
    for each, roles in sequences.items():
        matched = matched_folder(folder / each, dialect)
        assert matched is not None
        assert (matched.folder, matched.dialect.name, len(matched.files)) == (folder, dialect_name, roles)
        assert all(each in place or "camchain" in place for place in matched.in_words().values())
        assert not {place for place in matched.unused if place.startswith(tuple("ab"))} - {"a_b_data.h5"}
    for calibration in {"camchain-imucam-a1.yaml"} & set(names):
        matched = matched_folder(folder / "a1", dialect)
        assert matched is not None
        assert matched.place("calibration") == calibration


@pytest.mark.parametrize("name", ["named", "recognised"])
@pytest.mark.parametrize(
    ("names", "dialect_name", "files"),
    [
        (("a_data.h5", "a_pose_gt.h5", "old_pose_gt.h5"), "m3ed", "pose of .* got a_pose_gt.h5 and old_pose_gt.h5"),
        ((*M3ED, "c_pose_gt.h5"), "m3ed", "data of .* got a_data.h5 and b_data.h5"),
        (
            (*MVSEC, "camchain-imucam-a.yaml", "camchain-imucam-x.yaml"),
            "mvsec",
            "data of .*, got a1_data.hdf5 and b2_d",
        ),
    ],
)
def test_names_that_do_not_pair_up(
    names: tuple[str, ...], dialect_name: str, files: str, name: str, tmp_path: Path
) -> None:
    """Two files for one role are named, whether or not the dialect is."""
    folder = touch(tmp_path / "flat", *names)
    with pytest.raises(MisuseError, match=f"Expected one file for {files}.*; give all files of a sequence one name"):
        sequences_in(folder, load_dialect(dialect_name) if name == "named" else None)


def test_files_without_a_partner_are_no_sequences_of_several_files(tmp_path: Path) -> None:
    """Files that have the name of one role only are checked each by itself; a path without files is none."""
    folder = touch(tmp_path / "flat", "a_data.h5", "b_data.h5")
    assert sequences_in(folder, None) == ()
    with pytest.raises(MisuseError, match=r"a path that does not exist: .*/flat/a"):
        matched_folder(folder / "a", None)
    with pytest.raises(MisuseError, match=r"which does not exist; .*flat holds a and b"):
        match_folder(touch(folder, "a_pose_gt.h5") / "data", load_dialect("m3ed"))


def test_each_of_several_has_its_version_and_digest(tmp_path: Path) -> None:
    """A change of one leaves the others as they were; a calibration belongs to all."""
    folder = touch(tmp_path / "flat", *MVSEC, "camchain-imucam-a.yaml")
    before = {name: (local_version(folder / name), file_digest(folder / name).sha256) for name in ("a1", "b2")}
    (folder / "a1_gt.hdf5").write_bytes(b"1")
    after = {name: (local_version(folder / name), file_digest(folder / name).sha256) for name in ("a1", "b2")}
    assert after["b2"] == before["b2"]
    assert after["a1"][0] != before["a1"][0]
    assert after["a1"][1] != before["a1"][1]
    (folder / "camchain-imucam-a.yaml").write_bytes(b"1")
    assert file_digest(folder / "b2").sha256 != before["b2"][1]


def unpacked(sequence: str, frames: int) -> tuple[str, ...]:
    """Return the files of a sequence of DSEC whose archives became folders of their names."""
    pictures = (f"{sequence}_images_rectified_left/{number:06d}.png" for number in range(frames))
    return (f"{sequence}_events_left/events.h5", f"{sequence}_image_timestamps.txt", *pictures)


@pytest.mark.parametrize("name", ["named", "recognised"])
def test_archives_that_became_folders_of_their_names(name: str, tmp_path: Path) -> None:
    """Alone in a folder they are one sequence; those of several sequences are told apart by what precedes."""
    dialect = load_dialect("dsec") if name == "named" else None
    alone = touch(tmp_path / "thun_00_a", *unpacked("thun_00_a", 3))
    assert sequences_in(alone, dialect) == (alone,)
    several = touch(tmp_path / "all", *unpacked("thun_00_a", 3), *unpacked("thun_00_b", 2))
    assert sequences_in(several, dialect) == (several / "thun_00_a", several / "thun_00_b")
    for folder, frames in ((alone, 3), (several / "thun_00_a", 3), (several / "thun_00_b", 2)):
        matched = matched_folder(folder, dialect)
        assert matched is not None
        assert {role: len(files.names) for role, files in matched.files.items()} == {
            "events": 1,
            "images": frames,
            "image_times": 1,
        }
        assert all(folder.name in files.first.as_posix() for files in matched.files.values())


DSEC_PARTS = ("train_events/a/events/left/events.h5", "train_images/a/images/left/rectified/000000.png")


@pytest.mark.parametrize("name", ["named", "recognised"])
def test_a_sequence_divided_among_folders(name: str, tmp_path: Path) -> None:
    """Archives of events and of images, each unpacked into a folder of its own, are one sequence for each name."""
    folder = touch(tmp_path / "dsec", *DSEC_PARTS, "train_images/b/images/timestamps.txt", "train_lidar/a/lidar.bag")
    dialect = load_dialect("dsec") if name == "named" else None
    assert sequences_in(folder, dialect) == (folder / "a",)
    matched = matched_folder(folder / "a", dialect)
    assert matched is not None
    assert {role: files.first for role, files in matched.files.items()} == {
        "events": folder / DSEC_PARTS[0],
        "images": folder / DSEC_PARTS[1],
    }
    assert matched.place("events") == DSEC_PARTS[0]
    assert matched.unused == ("train_lidar/a/lidar.bag",)
    before = local_version(folder / "a"), file_digest(folder / "a").sha256
    (folder / DSEC_PARTS[1]).write_bytes(b"1")
    after = local_version(folder / "a"), file_digest(folder / "a").sha256
    assert before[0] != after[0]
    assert before[1] != after[1]


@pytest.mark.parametrize(
    "names",
    [
        pytest.param((*DSEC_PARTS, "old/a/events/left/events.h5"), id="a role twice"),
        pytest.param((DSEC_PARTS[0], "labels/a/tracks.npy"), id="no role in the other"),
        pytest.param((DSEC_PARTS[0], DSEC_PARTS[1].replace("/a/", "/b/")), id="other names"),
        pytest.param((DSEC_PARTS[0], DSEC_PARTS[1].replace("train", ".train")), id="hidden"),
    ],
)
def test_folders_of_one_name_that_are_no_sequence(names: tuple[str, ...], tmp_path: Path) -> None:
    """Where a role has files in two of them, or one alone has roles, they are read as they lie."""
    folder = touch(tmp_path / "dsec", *names)
    assert sequences_in(folder, load_dialect("dsec")) == ()


def test_links_are_no_parts(tmp_path: Path) -> None:
    """A link to a folder is not followed, as elsewhere."""
    folder = touch(tmp_path / "dsec", DSEC_PARTS[0])
    outside = touch(tmp_path / "other", DSEC_PARTS[1])
    (folder / "train_images").symlink_to(outside / "train_images")
    assert sequences_in(folder, None) == ()
    assert part_folders(folder / "a") == ()


def test_many_folders_of_one_name_are_those_of_as_many_sequences(tmp_path: Path) -> None:
    """``images`` in each of many folders is no sequence of that name, and is not searched."""
    folder = touch(tmp_path / "dsec", *(f"{number}/images/{number}.png" for number in range(20)))
    assert divided_names(folder) == ()
    assert divided_names(touch(tmp_path / "two", *DSEC_PARTS)) == ("a",)
