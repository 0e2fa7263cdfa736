"""Files that read from others: refused unless a folder is named, and confined to it."""

import os
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.api.check import check
from fedora_qa.cli.main import run
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.files import check_files
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import FileRecord
from fedora_qa.sequence.sequence import open_sequence
from tests.support.handmade import write_handmade

KEY = "path/depth"
SHAPE = (6, 27, 36)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A file whose depth lies in another in ``inside``; a twin of that in ``outside``; nothing else."""
    for name in ("inside", "outside"):
        (tmp_path / name).mkdir()
        with h5py.File(write_handmade(tmp_path / "main.h5")) as file, h5py.File(tmp_path / name / "d.h5", "w") as other:
            file.copy(KEY, other, "depth")
    return tmp_path


def linked(folder: Path, filename: str, target: str = "/depth") -> Path:
    with h5py.File(folder / "main.h5", "r+") as file:
        del file[KEY]
        file[KEY] = h5py.ExternalLink(filename, target)
    return folder / "main.h5"


def virtual(folder: Path, filename: str, rows: int = 6) -> Path:
    layout = h5py.VirtualLayout(SHAPE, "f4")
    layout[:rows] = h5py.VirtualSource(filename, "depth", shape=SHAPE)[:rows]
    with h5py.File(folder / "main.h5", "r+") as file:
        del file[KEY]
        file.create_virtual_dataset(KEY, layout, fillvalue=0).attrs["units"] = "mm"
    return folder / "main.h5"


def stored_raw(folder: Path, filename: str, values: int = 6 * 27 * 36) -> Path:
    for name in ("inside", "outside"):
        np.full(values, 5000, "f4").tofile(folder / name / "depth.raw")
    with h5py.File(folder / "main.h5", "r+") as file:
        del file[KEY]
        file.create_dataset(KEY, SHAPE, "f4", external=[(filename, 0, h5py.h5f.UNLIMITED)]).attrs["units"] = "mm"
    return folder / "main.h5"


def checked(path: Path, *allowed: Path) -> FileRecord:
    return check_file(path, CheckOptions(select=("integrity",), evidence=None, allow_external=allowed)).record


def rules_of(record: FileRecord) -> set[str]:
    return {finding.code.rsplit(".", 1)[1] for result in record.results for finding in result.findings}


def read(path: Path, *allowed: Path) -> np.ndarray:
    with open_sequence(path, allow_external=allowed) as sequence:
        return np.asarray(sequence.rows(KEY, 0, 6))


WAYS = {
    "link": (linked, "inside/d.h5", "outside/d.h5"),
    "virtual": (virtual, "inside/d.h5", "outside/d.h5"),
    "raw": (stored_raw, "inside/depth.raw", "outside/depth.raw"),
}


@pytest.mark.parametrize("way", WAYS)
def test_nothing_is_read_unless_a_folder_is_named(folder: Path, way: str) -> None:
    """Right: ``outside_link``, as ever."""
    make, inside, _ = WAYS[way]
    assert rules_of(checked(make(folder, inside))) == {"outside_link"}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("absolute", [False, True])
def test_what_lies_in_a_named_folder_is_read(
    folder: Path, way: str, absolute: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Right: clean, with the values of the other file, wherever the program runs, and as often as it is opened."""
    make, inside, outside = WAYS[way]
    path = make(folder, str(folder / inside) if absolute else inside)
    (folder / outside).parent.joinpath("inside").mkdir()  # a decoy for whoever looks from the working folder
    (folder / outside).parent.joinpath(inside).write_bytes((folder / inside).read_bytes()[:8] + b"decoy")
    monkeypatch.chdir(folder / "outside")
    record = checked(path, folder / "inside")
    assert rules_of(record) == set()
    assert record.verdict == "clean"
    depth = read(path, folder / "inside")
    assert np.nanmin(depth) == np.nanmax(depth) == 5000


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("written", ["plain", "dots", "absolute", "symlink", "symlinked folder"])
def test_nothing_is_read_beyond_it(folder: Path, way: str, written: str) -> None:
    """Right: ``outside_link``, after all that the file system makes of a name."""
    make, inside, outside = WAYS[way]
    name = Path(outside).name
    if written == "symlink":
        make(folder, inside)  # makes what it links to
        write_handmade(folder / "main.h5")
        (folder / "inside" / "alias").symlink_to(folder / outside)
    if written == "symlinked folder":
        (folder / "inside" / "folder").symlink_to(folder / "outside")
    names = {
        "plain": outside,
        "dots": f"inside/../{outside}",
        "absolute": str(folder / outside),
        "symlink": "inside/alias",
        "symlinked folder": f"inside/folder/{name}",
    }
    assert rules_of(checked(make(folder, names[written]), folder / "inside")) == {"outside_link"}


def test_the_named_folder_may_be_a_link_itself(folder: Path) -> None:
    """Right: what counts is where it leads."""
    (folder / "alias").symlink_to(folder / "inside")
    assert rules_of(checked(linked(folder, "inside/d.h5"), folder / "alias")) == set()


def test_a_file_that_is_known_by_a_link_is_looked_from_where_it_lies(folder: Path, tmp_path: Path) -> None:
    """Right: names are looked up beside the file itself, not beside the link to it."""
    (tmp_path / "links").mkdir()
    (tmp_path / "links" / "alias.h5").symlink_to(virtual(folder, "inside/d.h5"))
    assert rules_of(checked(tmp_path / "links" / "alias.h5", folder / "inside")) == set()


def test_an_allowed_file_leads_to_no_forbidden_one(folder: Path) -> None:
    """Right: a link, a virtual dataset and external storage within an allowed file are held to the same."""
    inside = folder / "inside"
    np.full(6 * 27 * 36, 5000, "f4").tofile(folder / "outside" / "depth.raw")
    layout = h5py.VirtualLayout(SHAPE, "f4")
    layout[:] = h5py.VirtualSource("../outside/d.h5", "depth", shape=SHAPE)
    with h5py.File(inside / "on.h5", "w") as file:
        file["link"] = h5py.ExternalLink("../outside/d.h5", "/depth")
        file["back"] = h5py.ExternalLink("d.h5", "/depth")
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("raw", SHAPE, "f4", external=[("../outside/depth.raw", 0, h5py.h5f.UNLIMITED)])
        file["loop"] = h5py.ExternalLink("on.h5", "/loop")
    for target in ("link", "virtual", "raw"):
        assert rules_of(checked(linked(folder, "inside/on.h5", target), inside)) == {"outside_link"}, target
    assert rules_of(checked(linked(folder, "inside/on.h5", "loop"), inside)) == {"dangling_link"}
    assert rules_of(checked(linked(folder, "inside/on.h5", "back"), inside)) == set()
    assert rules_of(checked(linked(folder, "inside/on.h5", "link"), inside, folder / "outside")) == set()


def test_a_source_of_a_virtual_dataset_leads_nowhere_else(folder: Path) -> None:
    """Right: HDF5 follows a link, and reads another virtual dataset, by itself: refused whatever they lead to."""
    with h5py.File(folder / "inside" / "d.h5", "r+") as file:
        file.move("depth", "kept")
        file["depth"] = h5py.ExternalLink("../outside/d.h5", "/depth")
    assert rules_of(checked(virtual(folder, "inside/d.h5"), folder / "inside", folder / "outside")) == {"outside_link"}


@pytest.mark.parametrize("way", ["virtual", "raw"])
def test_values_without_a_source_are_missed(folder: Path, way: str) -> None:
    """Right: HDF5 fills what no file holds without a word; here it is ``unwritten``."""
    path = virtual(folder, "inside/d.h5", 5) if way == "virtual" else stored_raw(folder, "inside/depth.raw", 100)
    assert rules_of(checked(path, folder / "inside")) == {"unwritten"}


@pytest.mark.parametrize("way", WAYS)
def test_a_source_that_is_gone_is_missed(folder: Path, way: str) -> None:
    """Right: ``dangling_link``, also for what is no file, such as a pipe that nobody writes to."""
    make, inside, _ = WAYS[way]
    path = make(folder, inside)
    (folder / inside).unlink()
    assert rules_of(checked(path, folder / "inside")) == {"dangling_link"}
    os.mkfifo(folder / inside)
    assert rules_of(checked(path, folder / "inside")) == {"dangling_link"}


def test_prefixes_of_hdf5_are_not_followed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Right: a variable that makes HDF5 look elsewhere first is named, and nothing is read."""
    monkeypatch.setenv("HDF5_VDS_PREFIX", str(folder / "outside"))
    record = checked(virtual(folder, "inside/d.h5"), folder / "inside")
    assert rules_of(record) == {"outside_link"}


def test_metadata_are_read_from_there_too(folder: Path) -> None:
    """Right: a group of declarations in an allowed file is as good as in the file."""
    with h5py.File(folder / "main.h5", "r+") as file:
        with h5py.File(folder / "inside" / "meta.h5", "w") as other:
            file.copy("metadata/imu", other, "imu")
        del file["metadata/imu"]
        file["metadata/imu"] = h5py.ExternalLink("inside/meta.h5", "/imu")
    options = CheckOptions(select=("integrity.layout", "metadata.complete"), evidence=None)
    assert rules_of(check_file(folder / "main.h5", options).record) >= {"outside_link"}
    assert rules_of(checked(folder / "main.h5", folder / "inside")) == set()


def test_commands_and_python_take_the_folders(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Right: the same everywhere, and a folder that is none is misuse."""
    path = str(linked(folder, "inside/d.h5"))
    named = ["--allow-external", str(folder / "inside")]
    assert run(["check", path, "--select", "integrity"]) == 1
    assert run(["check", path, "--select", "integrity", *named]) == 0
    assert check(path, select=["integrity"], allow_external=[str(folder / "inside")]).files[0].verdict == "clean"
    for command in (["stats", path], ["layout", path], ["compare", path, str(write_handmade(folder / "other.h5"))]):
        capsys.readouterr()
        assert run(command) == 0
        without = capsys.readouterr().out
        assert run([*command, *named]) == 0
        assert capsys.readouterr().out != without, command
    assert run(["check", path, "--allow-external", str(folder / "nowhere")]) == 2
    policy = folder / "policy.toml"
    policy.write_text('ruleset_version = "2"\nfiles = ["main.h5"]\nrequired_streams = ["depth"]\n'
                      '[check]\nselect = ["integrity"]')  # fmt: skip
    capsys.readouterr()
    assert run(["gate", str(folder), "--policy", str(policy)]) == 1
    assert "Expected the stream depth, got none" in capsys.readouterr().out.replace("\n", " ")
    assert run(["gate", str(folder), "--policy", str(policy), *named]) == 0


def test_workers_take_the_folders(folder: Path) -> None:
    """Right: whoever opens the file, in whichever process, reads what is allowed and nothing else."""
    path = linked(folder, "inside/d.h5")
    for allowed, verdict in (((), "findings"), ((folder / "inside",), "clean")):
        options = CheckOptions(select=("integrity",), evidence=None, allow_external=allowed)
        with ProcessExecutor(2) as executor:
            ((_, found),) = check_files([path], options, executor, lambda tally: None)
        assert found.record.verdict == verdict


@pytest.mark.parametrize("way", [*WAYS, "group"])
def test_a_piece_holds_what_was_read_elsewhere(folder: Path, way: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Right: inside, the values lie in the piece, which shows the finding without any other file; outside, nothing."""
    if way == "group":
        with h5py.File(folder / "main.h5", "r+") as file:
            for name in ("inside", "outside"):
                with h5py.File(folder / name / "imu.h5", "w") as other:
                    file.copy("path/imu", other, "imu")
                    other["depth"] = h5py.SoftLink("/imu")  # of the other file: in the piece it would lead nowhere
            del file["path/imu"]
            file["path/imu"] = h5py.ExternalLink("inside/imu.h5", "/imu")
        path, key, there = folder / "main.h5", "path/imu/ts", "inside/imu.h5"
    else:
        make, there, _ = WAYS[way]
        path, key = make(folder, there), KEY
    with h5py.File(path, "r+") as file:
        timestamps = file["path/rgb_ts"][:]
        timestamps[3] = timestamps[1]
        file["path/rgb_ts"][:] = timestamps
    (folder / "away").mkdir()
    piece = folder / "away" / "piece.h5"
    with open_sequence(path, allow_external=[folder / "inside"]) as sequence:
        whole = np.asarray(sequence.rows(key, 0, 6))
    given = ["extract", str(path), "F1", "-o", str(piece), "--config", str(folder / "select.toml")]
    (folder / "select.toml").write_text('select = ["clocks.order"]')
    code = run([*given, "--allow-external", str(folder / "inside")])
    assert code == 0, "".join(capsys.readouterr())
    (folder / there).unlink()
    with open_sequence(piece) as sequence:
        assert np.array_equal(sequence.rows(key, 0, 6), whole, equal_nan=True)
    piece.unlink()
    assert run([*given, "--allow-external", str(folder / "outside")]) == 0
    with open_sequence(piece) as sequence:
        assert key not in sequence.layout.bindings
