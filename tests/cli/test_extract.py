"""``fedora-qa extract`` from end to end: from a record or anew, what it says, and what it refuses."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

from fedora_generator.faults import plant_fault
from tests.cli.conftest import Command

ORDER = "clocks.order"


@pytest.fixture
def unsorted(park_day: Path, tmp_path: Path) -> Path:
    """A second in which one stamp of the pose is out of order."""
    plant_fault(park_day, tmp_path / "bad.h5", "unsorted", "pose", 1.0, start_s=0.5)
    return tmp_path / "bad.h5"


@pytest.fixture
def record(unsorted: Path, fedora_qa: Command) -> Path:
    """Its record, of the one check."""
    assert fedora_qa("check", unsorted, "--select", ORDER, "--json", unsorted.with_name("bad.json")).code == 1
    return unsorted.with_name("bad.json")


def test_from_a_record(unsorted: Path, record: Path, fedora_qa: Command) -> None:
    """It says what it kept and that the finding is still found; the small file has it, and the source is as it was."""
    before, small = unsorted.read_bytes(), unsorted.with_name("small.h5")
    done = fedora_qa("extract", unsorted, "F1", "--record", record, "-o", small)
    assert done.code == 0, done.err
    lines = done.out.splitlines()
    assert lines[0].startswith(f"{small}: ")
    assert any(line.split()[0] == "rgb" and line.endswith("of 51") for line in lines)
    assert lines[-1].startswith("F1 (clocks.order.backward_steps) is found in it: ")
    assert fedora_qa("check", small, "--select", ORDER).code == 1
    assert unsorted.read_bytes() == before


def test_without_a_record_the_file_is_checked(unsorted: Path, fedora_qa: Command) -> None:
    """The finding is that of a check with the same configuration."""
    config = unsorted.with_name("fedora-qa.toml")
    config.write_text(f'select = ["{ORDER}"]')
    done = fedora_qa("extract", unsorted, "F1", "--config", config, "-o", unsorted.with_name("small.h5"))
    assert done.code == 0
    assert "is found in it" in done.out


def test_not_found_is_incomplete(unsorted: Path, record: Path, fedora_qa: Command) -> None:
    """A piece that does not show the finding is written, said to be none, and the exit code tells."""
    document = json.loads(record.read_text(encoding="utf-8"))
    document["files"][0]["results"][0]["findings"][0]["where"] = {"stream": "pose", "start_us": 0.0}
    record.write_text(json.dumps(document), encoding="utf-8")
    small = unsorted.with_name("small.h5")
    done = fedora_qa("extract", unsorted, "F1", "--record", record, "-o", small, "--longest", "0.4")
    assert done.code == 3, done.out
    assert "is not found in it" in done.out
    assert small.is_file()


def another_content(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file.attrs["sequence"] = "another"


REFUSED: dict[str, tuple[tuple[str, ...], Callable[[Path], object], str]] = {
    "no such finding": (("bad.h5", "F9"), lambda _: None, "(F1), got 'F9'"),
    "another file's record": (("bad.h5", "F1"), lambda folder: another_content(folder / "bad.h5"), "of other content"),
    "no record": (("bad.h5", "F1"), lambda folder: (folder / "bad.json").write_text("{"), "Expected a record as JSON"),
    "no file": (("none.h5", "F1"), lambda _: None, "does not exist"),
    "a folder": ((".", "F1"), lambda _: None, "folder"),
    "no HDF5": (("bad.json", "F1"), lambda _: None, "no HDF5 signature"),
    "output is there": (("bad.h5", "F1"), lambda folder: (folder / "small.h5").write_text("mine"), "--force"),
    "output is a folder": (("bad.h5", "F1"), lambda folder: (folder / "small.h5").mkdir(), "got a folder"),
    "output is the file": (
        ("bad.h5", "F1"),
        lambda folder: (folder / "small.h5").symlink_to(folder / "bad.h5"),
        "an input or another output",
    ),
    "a file cut short": (
        ("bad.h5", "F1"),
        lambda folder: os.truncate(folder / "bad.h5", (folder / "bad.h5").stat().st_size // 2),
        "of other content",
    ),
}


@pytest.mark.parametrize(("arguments", "spoil", "told"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_refused(
    arguments: tuple[str, ...],
    spoil: Callable[[Path], object],
    told: str,
    record: Path,
    fedora_qa: Command,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whatever cannot be done is one line and exit code 2, and nothing is written."""
    folder = record.parent
    monkeypatch.chdir(folder)
    spoil(folder)
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    done = fedora_qa("extract", *arguments, "--record", record.name, "-o", "small.h5")
    assert done.code == 2, done.out
    assert told in done.err
    assert len(done.err.splitlines()) == 1
    assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


FULL = """
import resource, signal, sys
from fedora_qa.cli.main import run
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, 1 << 20))
sys.exit(run(sys.argv[1:]))
"""


def test_a_full_disk_leaves_nothing(unsorted: Path, record: Path) -> None:
    """Where the file cannot grow, that is said, and no piece of a piece is left."""
    arguments = ["extract", str(unsorted), "F1", "--record", str(record), "-o", str(unsorted.with_name("small.h5"))]
    before = sorted(unsorted.parent.iterdir())
    done = subprocess.run([sys.executable, "-c", FULL, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "fedora-qa: Expected to be able to write the piece, got: File too large; nothing is written\n"
    )
    assert sorted(unsorted.parent.iterdir()) == before


def test_force_writes_over(unsorted: Path, record: Path, fedora_qa: Command) -> None:
    """With --force a file that is there is replaced; but never the source."""
    small = unsorted.with_name("small.h5")
    small.write_text("old")
    assert fedora_qa("extract", unsorted, "F1", "--record", record, "-o", small, "--force").code == 0
    assert fedora_qa("extract", unsorted, "F1", "--record", record, "-o", unsorted, "--force").code == 2


def test_a_file_that_does_not_open_is_sent_as_it_is(unsorted: Path, fedora_qa: Command) -> None:
    """Nothing can be cut out of a file that HDF5 refuses to open, which is said."""
    os.truncate(unsorted, unsorted.stat().st_size // 2)
    done = fedora_qa("extract", unsorted, "F1", "-o", unsorted.with_name("small.h5"))
    assert done.code == 2
    assert "send the file as it is" in done.err


def test_findings_about_a_release_are_not_in_the_file(unsorted: Path, record: Path, fedora_qa: Command) -> None:
    """A rule about the release cannot be shown by a piece of a sequence."""
    record.write_text(record.read_text(encoding="utf-8").replace(f'"check": "{ORDER}"', '"check": "release.naming"'))
    done = fedora_qa("extract", unsorted, "F1", "--record", record, "-o", unsorted.with_name("small.h5"))
    assert done.code == 2
    assert "about the release" in done.err
