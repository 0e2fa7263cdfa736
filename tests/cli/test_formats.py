"""The formats that ``check`` writes and ``report`` writes again."""

import json
import sys
from pathlib import Path

import h5py
import pytest
from junitparser import JUnitXml

from fedora_qa.cli.outputs import PARQUET_NAMES
from fedora_qa.record.json_io import record_from_json
from fedora_qa.record.tables import CSV_NAMES
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


def test_the_record_on_stdout_is_alone_there(fedora_qa: Command, unsorted: Path, tmp_path: Path) -> None:
    """``--json -`` prints the record, which refers to no arrays; the summary is on stderr, and the exit code stays."""
    done = fedora_qa("check", *TIMESTAMPS, unsorted, "--json", "-", "--html", tmp_path / "out.html")
    assert done.code == 1
    record = record_from_json(done.out)
    assert [(file.verdict, file.evidence) for file in record.files] == [("findings", {})]
    assert done.err.splitlines()[-1].split()[0] == "FINDINGS"
    quiet = fedora_qa("check", *TIMESTAMPS, unsorted, "--quiet", "--format", "json")
    assert record_from_json(quiet.out).files[0].results == record.files[0].results
    assert (quiet.code, quiet.err.count("\n")) == (1, 1)


def test_each_format_on_stdout_is_its_file(fedora_qa: Command, unsorted: Path, tmp_path: Path) -> None:
    """What ``--format`` prints is what the option of that name writes; annotations stand without a summary."""
    record = tmp_path / "out.json"
    fedora_qa("check", *TIMESTAMPS, unsorted, "--json", record)
    for name in ("markdown", "junit", "sarif"):
        target = tmp_path / name
        fedora_qa("report", record, f"--{name}", target)
        printed = fedora_qa("report", record, "--format", name)
        assert printed.out == target.read_text(encoding="utf-8")
        assert "FINDINGS" in printed.err
    printed, after = (fedora_qa("report", record, *github) for github in (("--format", "github"), ("--github",)))
    assert printed.out.startswith("::error ")
    assert after.out.endswith(f"::\n{printed.out}")
    assert printed.err == ""


def test_annotations_give_way_to_a_document(fedora_qa: Command, unsorted: Path) -> None:
    """With a document on stdout, summary and annotations are on stderr."""
    done = fedora_qa("check", *TIMESTAMPS, unsorted, "--format", "junit", "--github")
    assert JUnitXml.fromstring(done.out.encode()).failures == 1
    assert done.err.startswith("::stop-commands::")
    assert done.err.splitlines()[-1].startswith("::error file=")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--json", "-", "--format", "sarif"), "Expected one document on stdout, got json and sarif"),
        (("--json", "-", "--markdown", "-"), "Expected one document on stdout, got json and markdown"),
        (("--junit", "out.xml", "--format", "junit"), "Expected either --junit OUT or --format junit, got both"),
    ],
)
def test_stdout_takes_one_document(options: tuple[str, ...], message: str, fedora_qa: Command, sequence: Path) -> None:
    """Two documents on stdout are misuse before any work, as is a format that is requested twice."""
    done = fedora_qa("check", sequence, *options)
    assert (done.code, done.out) == (2, "")
    assert message in done.err
