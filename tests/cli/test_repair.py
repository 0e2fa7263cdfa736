"""``fedora-qa repair`` from end to end: what it refuses before any work, what it prints, and its exit codes."""

import json
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest

import fedora_qa as package
from fedora_qa.api import repair as api_repair
from fedora_qa.cli import repair as cli_repair
from fedora_qa.cli.repair import repair_lines
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.errors import MisuseError
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.images import TransferMisdeclared
from fedora_qa.faults.motion import GyroBias
from fedora_qa.repairs.repair import repair
from tests.cli.conftest import Command
from tests.support.repairs import given_check

LATE = ClockShift("imu", 2_000_000)


@pytest.fixture
def given(sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The check of the command finds the clock of the IMU late."""
    given = partial(repair, check=given_check(sequence, LATE))
    for module in (cli_repair, api_repair):
        monkeypatch.setattr(module, "repair_file", given)


def hard_link(file: Path, folder: Path) -> Path:
    """A second name of the file."""
    os.link(file, folder / "link.h5")
    return folder / "link.h5"


def soft_link(file: Path, folder: Path) -> Path:
    """A link to the file."""
    (folder / "link.h5").symlink_to(file)
    return folder / "link.h5"


@pytest.mark.parametrize("name", [lambda file, folder: file, hard_link, soft_link])
@pytest.mark.parametrize("force", [True, False])
def test_never_in_place(
    name: Callable[[Path, Path], Path], force: bool, sequence: Path, tmp_path: Path, fedora_qa: Command
) -> None:
    """Whatever the file is called, and whatever is forced."""
    before = sequence.read_bytes()
    done = fedora_qa("repair", sequence, "-o", name(sequence, tmp_path), *(["--force"] if force else []))
    assert (done.code, "Expected an output of its own" in done.err) == (2, True)
    assert sequence.read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "Expected -o OUT, the file to write, or --dry-run, got neither"),
        (("-o", "missing/out.h5"), "Expected the folder of"),
        (("-o", "out.h5", "--only", "D7"), "Expected a diagnosis that can be undone (none), got 'D7', no diagnosis"),
        (("-o", "out.h5", "--select", "clocks.nothing"), "Expected a subject or check"),
    ],
)
def test_misuse(
    arguments: tuple[str, ...], message: str, sequence: Path, fedora_qa: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One sentence, exit code 2, nothing written."""
    monkeypatch.chdir(sequence.parent)
    done = fedora_qa("repair", sequence, *arguments)
    assert done.code == 2
    assert message in done.err
    assert [path.name for path in sequence.parent.iterdir()] == [sequence.name]


def test_a_url_and_what_is_not_hdf5_are_refused(tmp_path: Path, fedora_qa: Command) -> None:
    """A file is copied byte by byte, from this machine."""
    done = fedora_qa("repair", "https://example.org/seq.h5", "-o", tmp_path / "out.h5")
    assert (done.code, "Expected a file on this machine" in done.err) == (2, True)
    (tmp_path / "text.h5").write_text("no HDF5")
    assert fedora_qa("repair", tmp_path / "text.h5", "-o", tmp_path / "out.h5").code == 2
    assert fedora_qa("repair", tmp_path / "missing.h5", "-o", tmp_path / "out.h5").code == 2


def test_an_output_that_exists_is_kept_unless_forced(given: None, sequence: Path, fedora_qa: Command) -> None:
    """As with ``extract``."""
    out = sequence.with_name("out.h5")
    out.write_text("mine")
    done = fedora_qa("repair", sequence, "-o", out)
    assert (done.code, "use --force to write over it" in done.err) == (2, True)
    assert out.read_text() == "mine"
    assert fedora_qa("repair", sequence, "-o", out, "--force").code == 0
    assert h5py.is_hdf5(out)


def test_nothing_to_repair_is_exit_code_1(sequence: Path, fedora_qa: Command) -> None:
    """The check of the engine, which confirms nothing of a correct file. The output that exists is kept."""
    out = sequence.with_name("out.h5")
    out.write_text("mine")
    done = fedora_qa("repair", sequence, "-o", out, "--force", "--select", "clocks")
    assert done.code == 1, done.err
    assert done.out.splitlines()[-1] == "Nothing is written: No check fails: the file has no finding to repair."
    assert out.read_text() == "mine"
    assert sorted(path.name for path in sequence.parent.iterdir()) == ["out.h5", sequence.name]


def test_what_is_done_is_printed(given: None, sequence: Path, fedora_qa: Command) -> None:
    """The cause with its size, how it is known, what undoing does, and how many rows of which dataset."""
    out = sequence.with_name("out.h5")
    done = fedora_qa("repair", sequence, "-o", out)
    assert done.code == 0
    lines = done.out.splitlines()
    assert lines[0] == "D1  imu: timestamps are late by a constant, 2 ms  (confirmed)"
    assert lines[1] == "    imu 2 ms earlier"
    assert lines[2].startswith("    path/imu/ts: ")
    assert lines[-1] == f"{out} is written, and was checked: what is repaired is gone, and nothing is new."


def test_a_dry_run_says_what_would_be_done(given: None, sequence: Path, fedora_qa: Command) -> None:
    """With or without an output, which is not written."""
    for arguments in ((), ("-o", sequence.with_name("out.h5"))):
        done = fedora_qa("repair", sequence, "--dry-run", *arguments)
        assert done.code == 0
        assert done.out.splitlines()[-1] == "Nothing is written: this is what would be done."
        assert [path.name for path in sequence.parent.iterdir()] == [sequence.name]


def test_what_is_left_alone_has_a_reason(sequence: Path) -> None:
    """And attributes are shown with their new value."""
    check = given_check(sequence, TransferMisdeclared("srgb", "linear"), GyroBias((0.1, 0.0, 0.0)))
    out = sequence.with_name("out.h5")
    lines = list(repair_lines(repair(sequence, out, CheckOptions(), quiet, check=check), out))
    assert "    path/rgb.transfer = srgb" in lines
    place = lines.index("D2  imu: the gyro has an undeclared bias, 0.1 rad/s  (confirmed): left as it is")
    assert lines[place + 1].startswith("    A bias is an estimate")


def test_from_python(given: None, sequence: Path) -> None:
    """The same, with what was done as data."""
    out = sequence.with_name("out.h5")
    planned = package.repair(sequence, dry_run=True)
    assert (planned.refusal, planned.output) == ("", None)
    assert "this is what would be done" in repr(planned)
    done = package.repair(sequence, out, only=["D1"], select=["clocks"])
    assert not done.refusal
    assert f"{out} is written" in done._repr_html_()
    assert [each.path for each in done.datasets] == ["path/imu/ts"]
    for arguments in ((sequence,), (sequence, sequence), (sequence, out)):
        with pytest.raises(MisuseError):
            package.repair(*arguments)


def test_a_fault_is_found_confirmed_and_repaired(tiny_park_day: Path, tmp_path: Path, fedora_qa: Command) -> None:
    """Flow that points backwards: the diagnosis undoes it, the repair writes the clean rows to the bit."""
    faulty, repaired = tmp_path / "backwards.h5", tmp_path / "repaired.h5"
    faulty.write_bytes(tiny_park_day.read_bytes())
    with h5py.File(faulty, "r+") as file:
        for rate in ("10hz", "25hz", "50hz"):
            file[f"path/flow/{rate}"][...] *= -1
    done = fedora_qa("repair", faulty, "-o", repaired)
    assert (done.code, "flow points backwards" in done.out) == (0, True), done.out + done.err
    with h5py.File(tiny_park_day) as clean, h5py.File(repaired) as file:
        for rate in ("10hz", "25hz", "50hz"):
            key = f"path/flow/{rate}"
            assert clean[key][()].tobytes() == file[key][()].tobytes()
        assert len(file["provenance/repairs"]) == 1


def test_metadata_that_the_file_lacks_are_supplied(tiny_park_day: Path, tmp_path: Path, fedora_qa: Command) -> None:
    """Flow is held against depth with the declared camera alone; what is supplied is named, and not written."""
    faulty, repaired, side = (tmp_path / name for name in ("backwards.h5", "repaired.h5", "side.toml"))
    faulty.write_bytes(tiny_park_day.read_bytes())
    with h5py.File(faulty, "r+") as file:
        for rate in ("10hz", "25hz", "50hz"):
            file[f"path/flow/{rate}"][...] *= -1
        declared = dict(file["metadata/cameras/depth"].attrs)
        del file["metadata/cameras/depth"]
    names = ("width", "height", "K", "T_body_camera")
    lines = [f'"metadata/cameras/depth/{name}" = {declared[name].tolist()}' for name in names]
    side.write_text("\n".join(["[metadata]", *lines]))
    command = ("repair", faulty, "-o", repaired, "--select", "flow_geometry")
    assert fedora_qa(*command).code == 1
    done = fedora_qa(*command, "--metadata", side)
    assert (done.code, "flow points backwards" in done.out) == (0, True), done.out + done.err
    with h5py.File(tiny_park_day) as clean, h5py.File(repaired) as file:
        assert clean["path/flow/25hz"][()].tobytes() == file["path/flow/25hz"][()].tobytes()
        assert json.loads(file["provenance/repairs/1"][()])["metadata"] == "side.toml"
        assert "depth" not in file["metadata/cameras"]
    assert fedora_qa("repair", faulty, "-o", side, "--force", "--metadata", side).code == 2
    assert side.read_text().startswith("[metadata]")


def test_index_maps_are_those_of_the_repaired_timestamps(
    small_park_day: Path, tmp_path: Path, fedora_qa: Command
) -> None:
    """A delay is fitted to a fraction of a microsecond, and timestamps are whole ones: the maps fit them."""
    faulty, repaired = tmp_path / "late.h5", tmp_path / "repaired.h5"
    faulty.write_bytes(small_park_day.read_bytes())
    with h5py.File(faulty, "r+") as file:
        events_us = file["path/events/t"][()] + 3000
        file["path/events/t"][...] = events_us
        for stream in ("rgb", "depth"):
            times_us = file[f"path/{stream}_ts"][()]
            file[f"metadata/{stream}_to_event"][...] = np.searchsorted(events_us, times_us, "left")
    done = fedora_qa("repair", faulty, "-o", repaired)
    assert done.code == 0, done.out + done.err
    with h5py.File(repaired) as file:
        events_us = file["path/events/t"][()]
        for stream in ("rgb", "depth"):
            entries = np.searchsorted(events_us, file[f"path/{stream}_ts"][()], "left")
            np.testing.assert_array_equal(file[f"metadata/{stream}_to_event"][()], entries)
