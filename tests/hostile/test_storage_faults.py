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
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
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
import json, os, signal, sys
from pathlib import Path
from fedora_qa.cli.main import run

folder, count, *options = sys.argv[1:]
replace = Path.replace

def checked(into):
    os.chdir(into)
    return run(["check", "clean.h5", *options])

def killed(at, how):
    writes = 0

    def watched(self, target):
        nonlocal writes
        writes += self.name.endswith(".part")
        if writes == at:
            os.kill(os.getpid(), getattr(signal, how))
        return replace(self, target)

    Path.replace = watched
    os.dup2(os.open("../stderr", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
    os.dup2(2, 1)
    return checked(".")

assert checked(f"{folder}/alone/in") == 0
codes = {}
for at in range(1, int(count) + 1):
    for how in ("SIGKILL", "SIGINT"):
        os.chdir(f"{folder}/{at}-{how}/in")
        child = os.fork()
        if child == 0:
            os._exit(killed(at, how))
        codes[f"{at}-{how}"] = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
Path(folder, "codes.json").write_text(json.dumps(codes))
"""
"""A command, imported and run once, that is then killed in forks: when its n-th output is written, and has not got its
name yet."""

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


WRITTEN: Final = ["r.json.arrays.npz", *WHOLE]
FORMATS: Final = {
    "--json": "r.json",
    "--markdown": "o.md",
    "--junit": "o.xml",
    "--sarif": "o.sarif",
    "--html": "o.html",
}
ARGUMENTS: Final = ["--select", "integrity", *(part for option in FORMATS.items() for part in option)]


@pytest.fixture(scope="module")
def killed(clean_bytes: bytes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``codes.json``, exit codes of all runs that were killed, and what each has left in ``.../in``."""
    folder = tmp_path_factory.mktemp("killed")
    for name in ("alone", *(f"{write}-{ended}" for write in range(1, 7) for ended in ("SIGKILL", "SIGINT"))):
        (folder / name / "in").mkdir(parents=True)
        (folder / name / "in" / "clean.h5").write_bytes(clean_bytes)
    command = [sys.executable, "-c", KILLED, str(folder), str(len(WRITTEN)), *ARGUMENTS]
    can_be_forked = {"NUMBA_NUM_THREADS": "1", IN_PROCESS_VARIABLE: "1"}
    environment = os.environ | can_be_forked
    subprocess.run(command, capture_output=True, timeout=300, check=True, env=environment)
    return folder


@pytest.mark.parametrize("ended", ["SIGKILL", "SIGINT"])
@pytest.mark.parametrize("write", range(1, 7))
def test_what_is_killed_as_it_writes_leaves_whole_files(
    write: int, ended: str, killed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Right: what has its name is whole, what was being written has none; and it can be written afterwards."""
    folder = killed / f"{write}-{ended}" / "in"
    code = json.loads((killed / "codes.json").read_text())[f"{write}-{ended}"]
    assert code == (-signal.SIGKILL if ended == "SIGKILL" else 130), (folder.parent / "stderr").read_text()
    there = {one.name for one in folder.iterdir() if not one.name.startswith(".")}
    assert there == {"clean.h5", *WRITTEN[: write - 1]}
    for name in WHOLE.keys() & there:
        WHOLE[name](folder / name)
    if ended == "SIGINT":
        assert not [one for one in folder.iterdir() if one.name.startswith(".")]
    if write == len(WRITTEN):
        monkeypatch.chdir(folder)
        assert run(["check", "clean.h5", *ARGUMENTS]) == 0
        for name, read in WHOLE.items():
            read(folder / name)


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

    monkeypatch.setattr("fedora_qa.cli.check.check_files", changing)
    code = run(["check", str(path), "--select", "clocks", "--json", str(tmp_path / "r.json")])
    said = "".join(capsys.readouterr())
    assert code == 3, said
    assert "Expected the file to stay as it is while it is checked" in " ".join(said.split())
    assert read_record(tmp_path / "r.json").files[0].verdict == "incomplete"
