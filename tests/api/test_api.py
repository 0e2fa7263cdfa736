"""The package as a library: what it returns is what the command writes, as frames and in a notebook."""

import subprocess
import sys
from pathlib import Path

import h5py
import pandas as pd
import pytest

import fedora_qa
from fedora_qa.api.check import CheckedRecord
from fedora_qa.cli.main import run
from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import read_record as read_plain
from fedora_qa.record.json_io import record_to_json
from tests.support.handmade import write_handmade

TIMESTAMPS = ["clocks.order", "index_maps"]


@pytest.fixture
def unsorted(tmp_path: Path) -> Path:
    """A small file in which two stamps of the IMU are exchanged."""
    path = write_handmade(tmp_path / "<b>bad.h5")
    with h5py.File(path, "r+") as file:
        timestamps = file["path/imu/ts"]
        assert isinstance(timestamps, h5py.Dataset)
        timestamps[20:22] = timestamps[20:22][::-1]
    return path


@pytest.fixture
def found(unsorted: Path) -> CheckedRecord:
    """What is found of it."""
    return fedora_qa.check(unsorted, select=TIMESTAMPS)


def test_the_same_as_the_command(found: CheckedRecord, unsorted: Path, tmp_path: Path) -> None:
    """Files, options and their digest are those that ``check --json`` writes."""
    options = [argument for name in TIMESTAMPS for argument in ("--select", name)]
    assert run(["check", str(unsorted), *options, "--json", str(tmp_path / "out.json")]) == 1
    written = read_plain(tmp_path / "out.json")
    assert found.files == written.files
    assert found.config_digest == written.config_digest
    assert found.verdict == "findings"


def test_saved_and_read_again(found: CheckedRecord, tmp_path: Path) -> None:
    """What is saved is a record like any other, and comes back equal, with its arrays."""
    found.save(tmp_path / "saved.json")
    again = fedora_qa.read_record(tmp_path / "saved.json")
    assert again == found
    assert again.arrays.keys() == found.arrays.keys() == found.files[0].evidence.keys()
    assert record_to_json(again) == record_to_json(read_plain(tmp_path / "saved.json"))


def test_frames(found: CheckedRecord) -> None:
    """Frames have a row for each result, finding and cause, and types that do not depend on what they hold."""
    assert list(found.results["check"]) == [
        "clocks.order", "index_maps.rgb", "index_maps.depth", "index_maps.milliseconds",
    ]  # fmt: skip
    (finding,) = found.findings.to_dict("records")
    assert (finding["code"], finding["stream"], finding["index_start"]) == ("clocks.order.backward_steps", "imu", 21)
    assert found.diagnoses.loc[0, "cause"] == "unsorted"
    assert found.measurements["value"].dtype == float
    assert not found.statistics.empty
    assert pd.api.types.is_integer_dtype(found.findings["index_start"])


def test_several_files_are_one_record(unsorted: Path, tmp_path: Path) -> None:
    """All files stand in one record, with a row each; the gravest verdict counts."""
    other = write_handmade(tmp_path / "other.h5")
    both = fedora_qa.check(unsorted, str(other), select=TIMESTAMPS, evidence=False)
    assert [file.verdict for file in both.files] == ["findings", "clean"]
    assert both.verdict == "findings"
    assert both.arrays == {}
    assert len(repr(both).splitlines()) == 2


def test_a_notebook_shows_the_report(found: CheckedRecord) -> None:
    """Where reports can be drawn, a frame holds one; the markup of a name stays text in it."""
    shown = found._repr_html_()
    assert shown.startswith("<iframe srcdoc=")
    assert "<b>bad" not in shown
    assert "allow-same-origin" not in shown


def test_without_reports_a_table(found: CheckedRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing draws reports, verdict, cause and finding are shown, and a hostile name as text."""
    monkeypatch.setitem(sys.modules, "fedora_reports.html", None)
    shown = found._repr_html_()
    assert "FINDINGS: 1 failed" in shown
    assert "clocks.order.backward_steps" in shown
    assert "&lt;b&gt;bad.h5" in shown
    assert "<b>bad" not in shown


def test_frames_are_an_extra(found: CheckedRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without pandas a frame is an error that names what to install; the record is there all the same."""
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MisuseError, match=r"fedora-qa\[notebook\]"):
        _ = found.results
    assert found.verdict == "findings"


REFUSED = {
    "no file": ({}, "none.h5", "does not exist"),
    "an illegal value": ({"effort": "heroic"}, None, "'effort'"),
    "an unknown check": ({"select": ["imo"]}, None, "'imo'"),
    "a check and no list": ({"select": "imu"}, None, "'select'"),
    "no amount": ({"memory": "much"}, None, "'much'"),
    "no configuration": ({"config": "none.toml"}, None, "none.toml"),
}


@pytest.mark.parametrize(("options", "path", "told"), REFUSED.values(), ids=REFUSED.keys())
def test_misuse(options: dict[str, object], path: str | None, told: str, unsorted: Path) -> None:
    """What cannot be carried out is one error that names it."""
    with pytest.raises(MisuseError) as refused:
        fedora_qa.check(path or unsorted, **options)  # type: ignore[arg-type]
    assert told in str(refused.value)


def test_no_files() -> None:
    """To check nothing is a mistake."""
    with pytest.raises(MisuseError, match="at least one file"):
        fedora_qa.check()


HEAVY = ("numpy", "numba", "h5py", "cv2", "scipy", "pydantic", "click", "rich", "pandas", "fedora_reports")


def in_a_process(code: str) -> str:
    """What a fresh Python prints."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_importing_costs_nothing() -> None:
    """The package imports no library until something of it is used; and then it does, so that the test can fail."""
    told = f"import sys, fedora_qa; {{}}; print([name for name in {HEAVY} if name in sys.modules])"
    assert in_a_process(told.format("dir(fedora_qa)")) == "[]\n"
    assert "numpy" in in_a_process(told.format("fedora_qa.check"))


def test_names_that_are_not_there() -> None:
    """A wrong name is the usual error, and the right ones are listed."""
    with pytest.raises(AttributeError, match="chek"):
        _ = fedora_qa.chek
    assert {"check", "read_record", "CheckedRecord", "__version__"} <= set(dir(fedora_qa))


def test_python_m() -> None:
    """``python -m fedora_qa`` is the command."""
    done = subprocess.run([sys.executable, "-m", "fedora_qa", "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split()[0]) == (0, "fedora-qa,")
