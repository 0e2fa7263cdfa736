"""Folders as arguments: one sequence, many, or what is wrong, in one sentence and with the right exit code."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import read_record
from fedora_qa.storage.digest import file_digest
from tests.cli.conftest import Command
from tests.support.dsec_folder import T_OFFSET_US, write_dsec_folder, write_png
from tests.support.handmade import write_handmade
from tests.support.releases import write_checksums

LAYOUT = ("--select", "integrity")


@pytest.fixture
def dsec(tmp_path: Path) -> Path:
    write_handmade(tmp_path / "source.h5")
    folder = write_dsec_folder(tmp_path / "source.h5", tmp_path / "dsec")
    (tmp_path / "source.h5").unlink()
    return folder


def test_a_folder_is_one_sequence(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """The record has the folder's path, the sum of sizes, one digest and its files."""
    done = fedora_qa("check", *LAYOUT, dsec, "--json", tmp_path / "record.json")
    assert (done.code, done.err) == (0, "")
    (file,) = read_record(tmp_path / "record.json").files
    assert (file.path, file.dialect, file.verdict) == (str(dsec), "dsec", "clean")
    assert file.size == sum(path.stat().st_size for path in dsec.rglob("*") if path.is_file())
    assert file.inferred["files.events"] == "events/left/events.h5"
    assert file.inferred["declared.metadata/events/model"] == "dialect dsec"


def test_two_jobs_give_the_same_record(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """Folders open in other processes, and nothing depends on which."""
    for jobs in (1, 2):
        done = fedora_qa("check", dsec, "--jobs", str(jobs), "--memory", "2GB", "--json", tmp_path / f"{jobs}.json")
        assert done.code == 0, done.err
    documents = [json.loads((tmp_path / f"{jobs}.json").read_text())["files"] for jobs in (1, 2)]
    assert documents[0] == documents[1]


def test_layout_stats_and_compare(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """Each takes the folder; ``layout`` says what no role has."""
    shown = fedora_qa("layout", dsec)
    assert shown.code == 0
    for words in ("images/left/rectified/*.png", "disparity of 16 bits to depth", "events/left/rectify_map.h5"):
        assert words in shown.out
    assert fedora_qa("stats", dsec, "--json", tmp_path / "stats.json").code == 0
    assert json.loads((tmp_path / "stats.json").read_text())["files"][0]["path"] == str(dsec)
    shutil.copytree(dsec, tmp_path / "other")
    compared = fedora_qa("compare", dsec, tmp_path / "other")
    assert compared.code == 0, compared.err


def test_a_folder_of_sequences(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """Files and folders below it are all checked; parts of a sequence are no sequences."""
    release = tmp_path / "release"
    (release / "train").mkdir(parents=True)
    dsec.rename(release / "train/a")
    write_handmade(release / "train/b.h5")
    (release / ".hidden.h5").write_bytes(b"no HDF5")
    done = fedora_qa("check", *LAYOUT, release, "--json", tmp_path / "record.json")
    assert done.code == 0, done.err
    paths = [Path(file.path) for file in read_record(tmp_path / "record.json").files]
    assert paths == [release / "train/a", release / "train/b.h5"]
    only = fedora_qa("check", *LAYOUT, release, "--dialect", "dsec", "--json", tmp_path / "record.json")
    assert only.code == 0, only.err
    assert len(read_record(tmp_path / "record.json").files) == 1


def test_gate_takes_folders(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """A pattern of the policy that matches folders names sequences; their parts are none. A certificate names them."""
    release = tmp_path / "release"
    (release / "train").mkdir(parents=True)
    dsec.rename(release / "train/a")
    policy = tmp_path / "policy.toml"
    policy.write_text(
        'ruleset_version = "2"\nfiles = ["train/*", "**/*.h5"]\nrequired_streams = ["rgb", "events"]\n'
        '[check]\nselect = ["integrity"]\n'
    )
    done = fedora_qa(
        "gate", release, "--policy", policy, "--json", tmp_path / "r.json", "--certificate", tmp_path / "c.json"
    )
    assert done.code == 0, done.out + done.err
    assert [Path(file.path).name for file in read_record(tmp_path / "r.json").files][:-1] == ["a"]
    verified = fedora_qa("verify", tmp_path / "c.json", release)
    assert verified.code == 0, verified.out
    write_png(next((release / "train/a/images/left/rectified").iterdir()), np.zeros((27, 36, 3), np.uint8))
    assert fedora_qa("verify", tmp_path / "c.json", release).code != 0


def test_checksums_of_a_folder_are_those_of_its_files(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """`sha256sum` lists files: every one of them must be listed, and listed rightly."""
    release = tmp_path / "release"
    release.mkdir()
    dsec.rename(release / "a")
    names = sorted(path.relative_to(release).as_posix() for path in release.rglob("*") if path.is_file())
    policy = tmp_path / "policy.toml"
    policy.write_text(
        'ruleset_version = "2"\nfiles = ["a"]\n[check]\nselect = ["integrity"]\n[documents]\nchecksums = "SHA256SUMS"\n'
    )
    for listed, code in ((names, 0), (names[1:], 1)):
        write_checksums(release, *listed)
        done = fedora_qa("gate", release, "--policy", policy)
        assert done.code == code, done.out + done.err
    assert f"got no line for {names[0]}" in " ".join(done.out.split())


def test_resume_knows_folders(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """A stored result is used again for the same content, and only for that."""
    stored = tmp_path / "stored"
    first = fedora_qa("check", *LAYOUT, dsec, "--resume", stored)
    (result,) = stored.glob("*.json")
    changed = result.stat().st_mtime_ns
    again = fedora_qa("check", *LAYOUT, dsec, "--resume", stored)
    assert (first.code, again.code) == (0, 0)
    assert result.stat().st_mtime_ns == changed
    (dsec / "note.txt").write_text("changed")
    assert fedora_qa("check", *LAYOUT, dsec, "--resume", stored).code == 0
    assert result.stat().st_mtime_ns != changed


def remove_events(folder: Path) -> None:
    (folder / "events/left/events.h5").unlink()


def zip_events(folder: Path) -> None:
    events = folder / "events/left/events.h5"
    shutil.make_archive(str(folder.parent / "packed"), "zip", events.parent)
    shutil.copy(folder.parent / "packed.zip", events)


def cut_events(folder: Path) -> None:
    events = folder / "events/left/events.h5"
    events.write_bytes(events.read_bytes()[:-100])


def drop_a_timestamp(folder: Path) -> None:
    path = folder / "images/timestamps.txt"
    path.write_text("".join(f"{line}\n" for line in path.read_text().splitlines()[:-1]))


def drop_an_image(folder: Path) -> None:
    (folder / "images/left/rectified/000002.png").unlink()


def drop_an_image_and_its_timestamp(folder: Path) -> None:
    drop_an_image(folder)
    path = folder / "images/timestamps.txt"
    lines = path.read_text().splitlines()
    path.write_text("".join(f"{line}\n" for line in (*lines[:2], *lines[3:])))


def remove_timestamps(folder: Path) -> None:
    (folder / "images/timestamps.txt").unlink()


def write_another_size(folder: Path) -> None:
    write_png(folder / "images/left/rectified/000003.png", np.zeros((27, 35, 3), np.uint8))


def write_another_depth(folder: Path) -> None:
    write_png(folder / "images/left/rectified/000003.png", np.zeros((27, 36, 3), np.uint16))


def write_flow_of_8_bits(folder: Path) -> None:
    for path in (folder / "optical_flow/forward").iterdir():
        write_png(path, np.zeros((27, 36), np.uint8))


def write_all_flow_of_8_bits(folder: Path) -> None:
    for path in (folder / "optical_flow/forward").iterdir():
        write_png(path, np.full((27, 36, 3), 128, np.uint8))


def write_all_disparity_of_8_bits(folder: Path) -> None:
    for path in (folder / "disparity/event").iterdir():
        write_png(path, np.full((27, 36), 20, np.uint8))


def write_letters(folder: Path) -> None:
    (folder / "images/timestamps.txt").write_text("12\ntwelve\n")


def remove_calibration(folder: Path) -> None:
    shutil.rmtree(folder / "calibration")


def remove_disparity_matrix(folder: Path) -> None:
    path = folder / "calibration/cam_to_cam.yaml"
    path.write_text(path.read_text().replace("cams_03", "cams_12"))


@pytest.mark.parametrize(
    ("damage", "code", "words"),
    [
        (
            remove_events,
            2,
            "Expected events/left/events.h5 or events_left/events.h5 or *_events_left/events.h5 (events of",
        ),
        (zip_events, 2, "Expected an HDF5 file, got a ZIP archive (no HDF5 signature)"),
        (cut_events, 1, "Expected a complete HDF5 file, got events.h5"),
        (drop_a_timestamp, 1, "Expected images/timestamps.txt with N = 6 as images/left/rectified/*.png, got 5"),
        (drop_an_image, 1, "with N = 5 as images/left/rectified/*.png, got 6; the numbers in the names of"),
        (drop_an_image, 1, "leave out 2"),
        (drop_an_image_and_its_timestamp, 0, "leave out 2; every image has a timestamp"),
        (remove_timestamps, 1, "beside images/left/rectified/*.png, got nothing there"),
        (write_another_size, 1, "Expected 000003.png of 36 x 27 pixels, 8-bit colour, got 35 x 27 pixels"),
        (write_another_depth, 1, "8-bit colour, got 36 x 27 pixels, 16-bit colour"),
        (write_flow_of_8_bits, 1, "of 16 bits, which flow16 needs, got 8 bits; write them anew"),
        (write_all_flow_of_8_bits, 1, "of 16 bits, which flow16 needs, got 8 bits; write them anew"),
        (write_all_disparity_of_8_bits, 1, "of 16 bits, which disparity16 needs, got 8 bits; write them anew"),
        (write_letters, 1, "Expected numbers in every row of timestamps.txt, got other text"),
        (remove_calibration, 1, "got none, because there is no calibration/cam_to_cam.yaml in the folder; supply it"),
        (
            remove_disparity_matrix,
            1,
            "nothing at disparity_to_depth/cams_03 of cam_to_cam.yaml; supply it (--metadata)",
        ),
    ],
)
def test_what_is_wrong_is_one_sentence(
    damage: Callable[[Path], None], code: int, words: str, fedora_qa: Command, dsec: Path, tmp_path: Path
) -> None:
    """Misuse writes nothing and exits with 2; a defect of the data is a finding. Nobody reads a traceback."""
    damage(dsec)
    record = tmp_path / "record.json"
    done = fedora_qa("check", *LAYOUT, dsec, "--dialect", "dsec", "--json", record)
    assert done.code == code, done.out + done.err
    said = done.err if code == 2 else record.read_text()
    assert words in said
    assert "Traceback" not in said
    assert record.exists() is (code != 2)
    if code == 2:
        assert len(done.err.strip().splitlines()) == 1


def test_cameras_without_a_calibration_name_its_file(fedora_qa: Command, dsec: Path) -> None:
    """Whoever unpacked the calibration elsewhere reads which file the folder lacks."""
    remove_calibration(dsec)
    done = fedora_qa("check", "--select", "metadata", dsec)
    words = " ".join(done.out.split())
    for camera in ("rgb", "events"):
        expected = f"Expected the group /metadata/cameras/{camera}, got nothing there, because there is no"
        assert f"{expected} calibration/cam_to_cam.yaml in the folder; supply it" in words


def test_the_file_without_which_no_folder_fits(fedora_qa: Command, dsec: Path) -> None:
    """Of a folder that has the other roles it is named; the map beside it is not taken for a sequence."""
    (dsec / "events/left/events.h5").unlink()
    done = fedora_qa("check", dsec)
    assert done.code == 2
    assert "Expected events/left/events.h5 or events_left/events.h5 or *_events_left/events.h5 (events of" in done.err
    assert "complete the folder" in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert fedora_qa("layout", dsec).code == 0


def test_two_files_for_one_role(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """The sentence names the role and both files."""
    dialect = tmp_path / "mine.toml"
    dialect.write_text(
        'name = "mine"\n[files]\ndata = "events/left/*.h5"\n[datasets]\n'
        '"path/events/x" = { file = "data", path = "events/x" }\n'
    )
    done = fedora_qa("check", dsec, "--dialect", dialect)
    assert done.code == 2
    assert "Expected one file for data of the dialect mine in" in done.err
    assert "got events/left/events.h5 and events/left/rectify_map.h5" in done.err


def test_a_folder_that_fits_no_dialect(fedora_qa: Command, tmp_path: Path) -> None:
    """Incomplete, with the command that drafts a dialect; what needs rows refuses it."""
    folder = tmp_path / "unknown"
    folder.mkdir()
    (folder / "notes.txt").write_text("1 2\n")
    done = fedora_qa("check", folder)
    assert done.code == 3
    assert "no dialect describes anything" in done.out.replace("\n", " ")
    assert f"fedora-qa layout {folder} --draft-dialect" in " ".join(done.out.split())
    refused = fedora_qa("stats", folder)
    assert refused.code == 3
    assert "no dialect describes anything in the folder" in refused.err
    shown = fedora_qa("layout", folder)
    assert shown.code == 0
    assert "notes.txt" in shown.out


def test_a_folder_that_can_be_read_in_two_ways(fedora_qa: Command, dsec: Path) -> None:
    """Both readings are named."""
    shutil.copytree(dsec, dsec / "again")
    done = fedora_qa("check", dsec)
    assert done.code == 2
    assert "which is one in the dialect dsec and holds another" in done.err
    assert str(dsec / "again") in done.err


def test_outputs_do_not_change_what_is_read(fedora_qa: Command, dsec: Path) -> None:
    """A record in the folder would change its digest."""
    done = fedora_qa("check", dsec, "--json", dsec / "record.json")
    assert done.code == 2
    assert "Expected an output outside of" in done.err
    assert not (dsec / "record.json").exists()


def test_metadata_on_the_command_line(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """What is supplied is named in the record, and a wrong key is misuse."""
    side = tmp_path / "side.toml"
    side.write_text('[metadata]\n"metadata/cameras/events/camera_model" = "pinhole"\n')
    record = tmp_path / "record.json"
    assert fedora_qa("check", *LAYOUT, dsec, "--metadata", side, "--json", record).code == 0
    (file,) = read_record(record).files
    assert file.inferred["declared.metadata/cameras/events/camera_model"] == "side.toml"
    side.write_text("[metadata]\nthreshold = 1\n")
    done = fedora_qa("check", dsec, "--metadata", side)
    assert done.code == 2
    assert "metadata.threshold" in done.err


def late_folder(source: Path, folder: Path) -> tuple[Path, Path]:
    """A folder whose events are 8 ms late, and what has to be declared beside it."""
    dsec = write_dsec_folder(source, folder / "dsec")
    with h5py.File(dsec / "events/left/events.h5", "a") as file:
        file["t_offset"][...] = file["t_offset"][()] + 8000
    with h5py.File(source) as file:
        events = file["metadata/events"].attrs
        thresholds = {name: float(events[name]) for name in ("threshold_on", "threshold_off", "log_eps_dn")}
    lines = [f'"metadata/events/{name}" = {value!r}' for name, value in thresholds.items()]
    side = folder / "side.toml"
    side.write_text("\n".join(["[metadata]", '"metadata/events/model" = "log"', *lines]))
    return dsec, side


def test_a_folder_is_repaired_and_cut(fedora_qa: Command, small_park_day: Path, tmp_path: Path) -> None:
    """Both write one canonical file: without the fault, and a piece that shows it."""
    dsec, side = late_folder(small_park_day, tmp_path)
    before = {path: path.read_bytes() for path in dsec.rglob("*") if path.is_file()}
    options = ("--metadata", side)
    repaired = fedora_qa(
        "repair", dsec, "-o", tmp_path / "out.h5", *options, "--select", "event_response", "--select", "clocks"
    )
    assert repaired.code == 0, repaired.out
    with h5py.File(tmp_path / "out.h5") as out, h5py.File(small_park_day) as clean:
        late_us = out["path/events/t"][...] - (clean["path/events/t"][...] + T_OFFSET_US)
        assert np.all(late_us == late_us[0])
        assert abs(late_us[0]) < 500
    assert fedora_qa("check", tmp_path / "out.h5").code == 0
    fedora_qa("check", dsec, *options, "--json", tmp_path / "record.json")
    done = fedora_qa("extract", dsec, "F1", *options, "--record", tmp_path / "record.json", "-o", tmp_path / "piece.h5")
    assert (done.code, "is found in it" in done.out) == (0, True), done.err
    assert before == {path: path.read_bytes() for path in dsec.rglob("*") if path.is_file()}
    assert not list(tmp_path.glob(".fedora-qa-*"))


def write_m3ed(folder: Path, name: str) -> None:
    """Write the events and the poses of a sequence under its name."""
    folder.mkdir(exist_ok=True)
    with h5py.File(folder / f"{name}_data.h5", "w") as data:
        for key, values in (("x", [1, 2]), ("y", [3, 4]), ("t", [10, 20]), ("p", [1, 0])):
            data[f"prophesee/left/{key}"] = np.array(values)
        data["ovc/ts"] = np.array([0])
    with h5py.File(folder / f"{name}_pose_gt.h5", "w") as pose:
        pose["Cn_T_C0"] = np.tile(np.eye(4), (2, 1, 1))
        pose["ts"] = np.array([0, 20])


@pytest.fixture
def flat(tmp_path: Path) -> Path:
    folder = tmp_path / "release/flat"
    folder.parent.mkdir()
    for name in ("car_1", "car_2"):
        write_m3ed(folder, name)
    return folder


@pytest.mark.parametrize(("dialect", "jobs"), [((), "2"), (("--dialect", "m3ed"), "1")], ids=["recognised", "named"])
def test_sequences_side_by_side(
    fedora_qa: Command, flat: Path, dialect: tuple[str, ...], jobs: str, tmp_path: Path
) -> None:
    """Of a folder with files of several sequences each name is one, from above, in it, and by its own name."""
    wanted = ("--select", "integrity.readable", *dialect, "--jobs", jobs, "--json", tmp_path / "record.json")
    for arguments in ((flat.parent,), (flat,), (flat / "car_1", flat / "car_2")):
        done = fedora_qa("check", *arguments, *wanted)
        assert done.code == 0, done.out + done.err
        files = read_record(tmp_path / "record.json").files
        assert [Path(file.path) for file in files] == [flat / "car_1", flat / "car_2"]
        assert {file.dialect for file in files} == {"m3ed"}
        assert files[0].inferred["files.pose"] == "car_1_pose_gt.h5"
        assert "layout.unused" not in files[0].inferred
        assert files[0].size == sum(path.stat().st_size for path in flat.glob("car_1*"))
    missing = fedora_qa("check", flat / "car", *wanted)
    assert missing.code == 2
    assert "does not exist" in missing.err


def test_commands_take_a_sequence_beside_others(fedora_qa: Command, flat: Path, tmp_path: Path) -> None:
    """``layout`` names the sequences; ``stats``, ``compare`` and ``export`` read one; no output may lie beside them."""
    shown = fedora_qa("layout", flat)
    assert shown.code == 2
    assert f"name one of {flat / 'car_1'}, {flat / 'car_2'}" in shown.err
    assert "Cn_T_C0" in fedora_qa("layout", flat / "car_1").out
    assert fedora_qa("check", flat / "car_1", "--json", flat / "out.json").code == 2
    assert fedora_qa("stats", flat / "car_1").code == 0
    compared = fedora_qa("compare", flat / "car_1", flat / "car_2")
    assert compared.code in {0, 1}, compared.err
    exported = fedora_qa("export", flat / "car_1", "--to", "tum", tmp_path / "out.txt")
    assert exported.code == 0, exported.err


@pytest.fixture
def divided(dsec: Path, tmp_path: Path) -> Path:
    """Return a folder with the events of a sequence in one folder and each other stream of it in another."""
    folder = tmp_path / "release/train"
    for part in sorted(dsec.iterdir()):
        (folder / f"train_{part.name}").mkdir(parents=True)
        shutil.copytree(part, folder / f"train_{part.name}/thun_00_a/{part.name}")
    return folder


def test_a_divided_sequence_is_read_whole(fedora_qa: Command, dsec: Path, divided: Path, tmp_path: Path) -> None:
    """From above, in it, and by its name: all measurements are those of the folder in one piece."""
    records = []
    shutil.copytree(divided / "train_events/thun_00_a", divided / "train_events/thun_01_a")
    for number, arguments in enumerate(((dsec,), (divided.parent,), (divided,), (divided / "thun_00_a",))):
        path = tmp_path / f"{number}.json"
        done = fedora_qa("check", *arguments, *LAYOUT, "--select", "clocks", "--select", "index_maps", "--json", path)
        assert done.code in {0, 3}, done.out + done.err
        records.append(read_record(path).files)
    whole, *others = records
    for files in others:
        assert files[0].path == str(divided / "thun_00_a")
        assert files[0].results == whole[0].results
        assert files[0].size == whole[0].size
    assert [[Path(file.path).name for file in files] for files in others] == [
        ["thun_00_a", "thun_01_a"],
        ["thun_00_a", "thun_01_a"],
        ["thun_00_a"],
    ]
    assert others[0][0].inferred["files.events"] == "train_events/thun_00_a/events/left/events.h5"


def test_commands_take_a_divided_sequence(fedora_qa: Command, divided: Path, tmp_path: Path) -> None:
    """``layout`` describes it, also from above, and drafts a dialect that reads it; outputs may not lie beside it."""
    for path in (divided, divided / "thun_00_a"):
        assert "disparity of 16 bits to depth" in fedora_qa("layout", path).out
    assert fedora_qa("stats", divided / "thun_00_a").code == 0
    draft = tmp_path / "mine.toml"
    assert fedora_qa("layout", divided / "thun_00_a", "--draft-dialect", draft).code == 0
    assert 'images_left_rectified = "images/left/rectified/*.png"' in draft.read_text()
    done = fedora_qa("check", divided, "--select", "clocks", "--dialect", draft)
    assert done.code == 0, done.out + done.err
    inside = fedora_qa("check", divided / "thun_00_a", "--json", divided / "out.json")
    assert (inside.code, "Expected an output outside of" in inside.err) == (2, True)


def test_two_files_for_one_role_without_a_dialect(fedora_qa: Command, flat: Path) -> None:
    """The sentence names the role and both files, also where the folder lies in another."""
    shutil.copy(flat / "car_1_pose_gt.h5", flat / "old_pose_gt.h5")
    for path in (flat, flat.parent):
        done = fedora_qa("check", path)
        assert done.code == 2
        assert "Expected one file for data of the dialect m3ed" in done.err
        assert "give all files of a sequence one name, or move other files out" in done.err
    (flat / "car_2_data.h5").unlink()
    (flat / "car_2_pose_gt.h5").unlink()
    assert "pose of the dialect m3ed" in fedora_qa("check", flat).err


def test_gate_takes_sequences_side_by_side(fedora_qa: Command, flat: Path, tmp_path: Path) -> None:
    """Each is one of the release; the certificate names it, and a change of its files breaks it."""
    policy = tmp_path / "policy.toml"
    policy.write_text(
        'ruleset_version = "2"\nfiles = ["*", "**/*.h5"]\nrequired_streams = ["pose", "events"]\n'
        '[check]\nselect = ["integrity.readable"]\n'
    )
    written = ("--json", tmp_path / "r.json", "--certificate", tmp_path / "c.json")
    done = fedora_qa("gate", flat.parent, "--policy", policy, *written)
    assert done.code == 0, done.out + done.err
    names = [Path(file.path).name for file in read_record(tmp_path / "r.json").files]
    assert names[:2] == ["car_1", "car_2"]
    verified = fedora_qa("verify", tmp_path / "c.json", flat.parent)
    assert verified.code == 0, verified.out
    with h5py.File(flat / "car_1_pose_gt.h5", "a") as pose:
        pose["ts"][1] = 21
    assert fedora_qa("verify", tmp_path / "c.json", flat.parent).code != 0


@pytest.mark.parametrize(
    "name", ["images/left/rectified/*", "images/timestamps.txt", "calibration/*", "events/left/e*"]
)
def test_a_file_that_may_not_be_read(
    name: str, fedora_qa: Command, dsec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One sentence names it, before any work; whoever may read all files is stopped where the digest reads it."""
    file = sorted(dsec.glob(name))[0]
    may_access = os.access
    monkeypatch.setattr("os.access", lambda path, mode: Path(path) != file and may_access(path, mode))
    for command in (
        ("check", *LAYOUT, dsec),
        ("stats", dsec),
        ("compare", dsec, shutil.copytree(dsec, tmp_path / "b")),
    ):
        refused = fedora_qa(*command)
        assert refused.code == 2
        assert refused.err.strip() == f"fedora-qa: Expected a readable file, got Permission denied: {file}"


def test_a_digest_of_what_cannot_be_read(dsec: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that fails while it is read, as on a damaged disk, is named."""

    def fail(path: Path, mode: str) -> None:
        raise OSError(5, "Input/output error", str(path))

    monkeypatch.setattr(Path, "open", fail)
    with pytest.raises(MisuseError, match=r"^Expected a readable file, got Input/output error: .*yaml$"):
        file_digest(dsec)


def test_names_with_blanks_are_quoted(fedora_qa: Command, tmp_path: Path) -> None:
    """The drafting command can be copied; an empty folder is refused, and no draft of it is written."""
    folder = tmp_path / "my run"
    folder.mkdir()
    draft = tmp_path / "draft.toml"
    refused = fedora_qa("layout", folder, "--draft-dialect", draft)
    assert refused.code == 2
    assert refused.err.strip() == f"fedora-qa: Expected a sequence, got a folder without files: {folder}"
    assert not draft.exists()
    (folder / "notes.txt").write_text("1 2\n")
    command = f"fedora-qa layout '{folder}' --draft-dialect"
    for name in ("check", "layout"):
        assert command in " ".join(fedora_qa(name, folder).out.split())


def test_images_whose_names_have_no_times(fedora_qa: Command, dsec: Path, tmp_path: Path) -> None:
    """The sentence names the image, and what its name lacks."""
    images = dsec / "images/left/rectified"
    for path in images.iterdir():
        path.rename(images / f"{path.stem}_left.png")
    dialect = tmp_path / "mine.toml"
    dialect.write_text(
        'name = "mine"\n[files]\nimages = "images/left/rectified/*.png"\n[datasets]\n"path/rgb" = { file = "images" }\n'
        '"path/rgb_ts" = { file = "images", time_unit = "us" }\n'
    )
    done = fedora_qa("layout", dsec, "--dialect", dialect)
    said = " ".join(done.out.split())
    assert "Expected a number of its own at the end of each name of images/left/rectified/*.png" in said
    assert "got 000000_left.png; rename the images, or take path/rgb_ts from a file" in said


@pytest.mark.parametrize("command", [("repair", "-o"), ("extract", "F1", "-o")])
def test_one_of_several_is_named(command: tuple[str, ...], fedora_qa: Command, tmp_path: Path) -> None:
    """A folder of several sequences is refused with their names, and nothing is written."""
    for name in ("flight1", "flight2"):
        write_m3ed(tmp_path / "m3ed", name)
    done = fedora_qa(command[0], tmp_path / "m3ed", *command[1:], tmp_path / "out.h5")
    assert (done.code, "name one of" in done.err, "flight2" in done.err) == (2, True, True), done.err
    assert not (tmp_path / "out.h5").exists()
