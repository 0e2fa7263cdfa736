"""Disks that fill up, processes that are killed, files that change meanwhile: said, and nothing half written."""

import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import pytest

from fedora_qa.cli.main import run
from fedora_qa.engine.files import check_files
from fedora_qa.record.json_io import read_record, write_record
from tests.support.records import failed, file_record, record

OUTPUTS: Final = {
    "--html": "o.html",
    "--markdown": "o.md",
    "--junit": "o.xml",
    "--sarif": "o.sarif",
    "--csv": "csv",
    "--parquet": "parquet",
}

KILLED: Final = """
import os, signal, sys
from pathlib import Path
from fedora_qa.cli.main import run

writes, killed_at, replace = 0, int(sys.argv[1]), Path.replace

def watched(self, target):
    global writes
    writes += self.name.endswith(".part")
    if writes == killed_at:
        os.kill(os.getpid(), getattr(signal, sys.argv[2]))
    return replace(self, target)

Path.replace = watched
sys.exit(run(sys.argv[3:]))
"""
"""A command that is killed when its n-th output is written, and has not got its name yet."""

WHOLE: Final[dict[str, Callable[[Path], object]]] = {
    "r.json": read_record,
    "o.md": Path.read_text,
    "o.xml": ElementTree.parse,
    "o.sarif": lambda path: json.loads(path.read_text()),
    "o.html": lambda path: path.read_text().index("</html>"),
}
"""What reads each output to its end, in the order in which they are written, less the arrays, which come first."""


@contextmanager
def full_disk(most_bytes: int) -> Iterator[None]:
    """Let no file become longer than that: the nearest to a full disk that needs no disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def shown(tmp_path: Path) -> Path:
    """A record with a finding, alone in a folder."""
    path = tmp_path / "record.json"
    write_record(record(file_record(failed())), path)
    return path


@pytest.mark.parametrize("option", OUTPUTS)
def test_a_full_disk_leaves_no_output(option: str, shown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Right: one sentence, exit code 2, and nothing under the name of the output; folders may be there, and empty."""
    if option == "--parquet":
        pytest.importorskip("pyarrow", reason="an extra")
    target = shown.with_name(OUTPUTS[option])
    with full_disk(100):
        code = run(["report", str(shown), option, str(target)])
    said = capsys.readouterr().err
    assert code == 2, said
    assert "Expected to be able to write" in said
    assert "internal error" not in said
    assert [path for path in shown.parent.rglob("*") if path.is_file()] == [shown]


def test_a_full_disk_leaves_no_record(clean_bytes: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Right: the same for the record of a check, of which neither record nor arrays are left."""
    path = tmp_path / "clean.h5"
    path.write_bytes(clean_bytes)
    with full_disk(1000):
        code = run(["check", str(path), "--select", "clocks", "--json", str(tmp_path / "r.json")])
    assert code == 2
    assert "Expected to be able to write" in capsys.readouterr().err
    assert [one.name for one in tmp_path.iterdir()] == ["clean.h5"]


@pytest.mark.parametrize("ended", ["SIGKILL", "SIGINT"])
@pytest.mark.parametrize("write", range(1, 7))
def test_what_is_killed_as_it_writes_leaves_whole_files(
    write: int, ended: str, clean_bytes: bytes, tmp_path: Path
) -> None:
    """Right: what has its name is whole, what was being written has none; and it can be written afterwards."""
    path = tmp_path / "clean.h5"
    path.write_bytes(clean_bytes)
    options = {"--json": "r.json", "--markdown": "o.md", "--junit": "o.xml", "--sarif": "o.sarif", "--html": "o.html"}
    given = [part for option, name in options.items() for part in (option, str(tmp_path / name))]
    arguments = ["check", str(path), "--select", "integrity", *given]
    command = [sys.executable, "-c", KILLED, str(write), ended, *arguments]
    done = subprocess.run(command, capture_output=True, timeout=300, check=False)
    assert done.returncode == (-signal.SIGKILL if ended == "SIGKILL" else 130), done.stderr
    names = ["r.json.arrays.npz", *WHOLE]
    there = {one.name for one in tmp_path.iterdir() if not one.name.startswith(".")}
    assert there == {"clean.h5", *names[: write - 1]}
    for name in WHOLE.keys() & there:
        WHOLE[name](tmp_path / name)
    if ended == "SIGINT":
        assert not [one for one in tmp_path.iterdir() if one.name.startswith(".")]
    if write == len(names):
        assert run(arguments) == 0
        for name, read in WHOLE.items():
            read(tmp_path / name)


def grown(path: Path) -> None:
    with path.open("ab") as file:
        file.write(b"more")


def overwritten(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 255
    path.write_bytes(content)
    os.utime(path, ns=(1, 1))  # as coarse as a clock of files may be


def exchanged(path: Path) -> None:
    other = path.with_name("other")
    other.write_bytes(path.read_bytes())
    other.replace(path)


@pytest.mark.parametrize("change", [grown, overwritten, exchanged], ids=lambda change: change.__name__)
def test_a_file_that_changes_while_it_is_checked_is_told(
    change: Callable[[Path], None],
    clean_bytes: bytes,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Right: no verdict of what was partly one file and partly another; it is said, and the exit code is not 0."""
    path = tmp_path / "clean.h5"
    path.write_bytes(clean_bytes)

    def changing(*given: Any) -> Iterator[Any]:
        for done in check_files(*given):
            change(path)  # at the very end, when the file is not opened any more
            yield done

    monkeypatch.setattr("fedora_qa.cli.check_all.check_files", changing)
    code = run(["check", str(path), "--select", "clocks", "--json", str(tmp_path / "r.json")])
    said = "".join(capsys.readouterr())
    assert code == 3, said
    assert "Expected the file to stay as it is while it is checked" in " ".join(said.split())
    assert read_record(tmp_path / "r.json").files[0].verdict == "incomplete"
