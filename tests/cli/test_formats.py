"""The formats that ``check`` writes and ``report`` writes again."""

import json
import sys
from pathlib import Path

import h5py
import pytest
from junitparser import JUnitXml

from fedora_qa.cli.parquet import PARQUET_NAMES
from fedora_qa.record.csv_tables import CSV_NAMES
from tests.cli.conftest import Command

TIMESTAMPS = ("--select", "clocks.order", "--select", "index_maps")


@pytest.fixture
def unsorted(sequence: Path) -> Path:
    """A file in which two stamps of the IMU are exchanged."""
    with h5py.File(sequence, "r+") as file:
        timestamps = file["path/imu/ts"]
        assert isinstance(timestamps, h5py.Dataset)
        timestamps[20:22] = timestamps[20:22][::-1]
    return sequence


def formats(folder: Path) -> tuple[str | Path, ...]:
    """Options that write every format into a folder."""
    folder.mkdir()
    return (
        "--junit", folder / "out.xml", "--sarif", folder / "out.sarif", "--csv", folder / "tables",
        "--badge", folder / "badge.json",
        "--markdown", folder / "out.md", "--github", "--parquet", folder / "tables",
    )  # fmt: skip


def test_report_writes_what_check_wrote(fedora_qa: Command, unsorted: Path, tmp_path: Path) -> None:
    """Every format from the record is, to the letter, the one from the check."""
    checked = fedora_qa("check", *TIMESTAMPS, unsorted, "--json", tmp_path / "out.json", *formats(tmp_path / "one"))
    reported = fedora_qa("report", tmp_path / "out.json", *formats(tmp_path / "two"))
    assert (checked.code, reported.code) == (1, 0)
    one, two = (
        {p.relative_to(f): p.read_bytes() for p in f.rglob("*.*")} for f in (tmp_path / "one", tmp_path / "two")
    )
    assert one == two
    assert len(one) == 4 + len(CSV_NAMES) + len(PARQUET_NAMES)
    assert checked.out.splitlines()[1:-4] == reported.out.splitlines()[1:-4]


def test_formats_tell_the_finding(fedora_qa: Command, unsorted: Path, tmp_path: Path) -> None:
    """JUnit has a failure, SARIF an error, GitHub an annotation after the summary."""
    done = fedora_qa("check", *TIMESTAMPS, unsorted, *formats(tmp_path / "out"))
    assert done.code == 1
    assert JUnitXml.fromfile(str(tmp_path / "out" / "out.xml")).failures == 1
    (run,) = json.loads((tmp_path / "out" / "out.sarif").read_text(encoding="utf-8"))["runs"]
    assert [result["level"] for result in run["results"]] == ["error"]
    assert done.out.splitlines()[-1].startswith(f"::error file={unsorted},title=clocks.order")


def test_the_summary_commands_nothing(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """With annotations asked for, a file called like a command is shown between stop and token, and taken apart."""
    hostile = sequence.rename(tmp_path / "::error::x.h5")
    lines = fedora_qa("check", *TIMESTAMPS, hostile, "--github").out.splitlines()
    token = lines[0].removeprefix("::stop-commands::")
    assert lines[-1] == f"::{token}::"
    assert any("error" in line and "x.h5" in line for line in lines[1:-1])
    assert not any("::error::" in line for line in lines)


@pytest.mark.parametrize("option", ["--csv", "--parquet"])
def test_tables_need_a_folder(option: str, fedora_qa: Command, sequence: Path) -> None:
    """A file given as the folder of the tables is misuse, found before any work."""
    done = fedora_qa("check", *TIMESTAMPS, sequence, option, sequence)
    assert done.code == 2
    assert "Expected a folder" in done.err


def test_parquet_is_an_extra(fedora_qa: Command, sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without pyarrow the option is misuse that names what to install, before any work."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    done = fedora_qa("check", *TIMESTAMPS, sequence, "--parquet", sequence.with_name("tables"))
    assert done.code == 2
    assert "pip install 'fedora-qa[parquet]'" in done.err
