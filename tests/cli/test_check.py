"""``fedora-qa check`` from end to end: outputs, exit codes, selection, configuration."""

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.checks.protocol import Check, Notice, Observation
from fedora_qa.record.json_io import read_record
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from tests.cli.conftest import Command
from tests.support.all_checks import CHECKS
from tests.support.replaced_checks import replace_checks

TIMESTAMPS = ("--select", "clocks", "--select", "index_maps")


class Answers(Check[None]):
    """Does it answer?"""

    name = "test.answers"

    def start(self, facts: Facts) -> None:
        """Keep nothing."""

    def update(self, state: None, window: Window) -> None:
        """Look at nothing."""

    def merge(self, state: None, later: None) -> None:
        """Keep nothing."""

    def conclude(self, state: None, facts: Facts) -> Observation:
        """Show an array."""
        return Observation(
            coverage=Coverage(1, 2, "frames"),
            evidence={"residual_px": np.arange(3.0)},
            titles={"residual_px": "Residual by frame, px"},
        )


class Warns(Answers):
    """Is anything unusual?"""

    name = "test.warns"

    def conclude(self, state: None, facts: Facts) -> Observation:
        """Find something unusual."""
        notices = (Notice("test.warns.square", "The frames are unusually square."),)
        return Observation(coverage=Coverage(1, 1, "frames"), notices=notices)


class Crashes(Answers):
    """Does it crash?"""

    name = "test.crashes"

    def update(self, state: None, window: Window) -> None:
        """Fail as a defect would."""
        raise ZeroDivisionError("division by zero")


class CannotSay(Answers):
    """Can it be asked?"""

    name = "test.cannot_say"

    def not_applicable(self, facts: Facts) -> str:
        """Fail over odd declarations."""
        raise ZeroDivisionError("focal length of zero")


@pytest.fixture
def test_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run these checks in place of the real ones."""
    replace_checks(monkeypatch, Answers(), Crashes())


def damage_clock(path: Path) -> None:
    """Exchange two stamps of the IMU."""
    with h5py.File(path, "r+") as file:
        timestamps: Any = file["path/imu/ts"]
        timestamps[20:22] = timestamps[20:22][::-1]


def test_clean_file(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A clean file exits with 0; the summary goes to stdout, nothing to stderr, and the input is not touched."""
    before = sequence.read_bytes()
    done = fedora_qa("check", *TIMESTAMPS, sequence)
    assert done.code == 0
    assert done.out.splitlines()[-1].startswith(" CLEAN ")
    assert done.err == ""
    assert sequence.read_bytes() == before
    assert list(tmp_path.iterdir()) == [sequence]


def test_findings(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A fault exits with 1, and record, markdown and terminal name the check, the stream and the cause."""
    damage_clock(sequence)
    json_path, markdown_path = tmp_path / "out.json", tmp_path / "out.md"
    done = fedora_qa("check", *TIMESTAMPS, sequence, "--json", json_path, "--markdown", markdown_path)
    assert done.code == 1
    file = read_record(json_path).files[0]
    assert file.verdict == "findings"
    assert (file.diagnoses[0].cause, file.diagnoses[0].stream) == ("unsorted", "imu")
    for shown in (done.out, markdown_path.read_text(encoding="utf-8")):
        assert "clocks.order" in shown
        assert "imu: samples are not in the order of time" in shown
        assert "Sort by time before writing." in shown


def test_no_colour_when_piped(fedora_qa: Command, sequence: Path) -> None:
    """What is piped holds no escape sequence."""
    assert "\x1b" not in fedora_qa("check", *TIMESTAMPS, sequence).out


def test_warnings_count_when_asked(fedora_qa: Command, sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """``--fail-on warned`` turns what is unusual into exit code 1; without it the file is clean."""
    replace_checks(monkeypatch, Warns())
    lenient, strict = fedora_qa("check", sequence), fedora_qa("check", sequence, "--fail-on", "warned")
    assert "1 warned" in lenient.out
    assert "The frames are unusually square." in " ".join(lenient.out.split())
    assert (lenient.code, strict.code) == (0, 1)


@pytest.mark.usefixtures("test_checks")
def test_crash_is_an_outcome(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A check that crashes exits with 3; the record holds the traceback, the terminal only its last line."""
    done = fedora_qa("check", sequence, "--json", tmp_path / "out.json")
    assert done.code == 3
    assert "incomplete: crashed: test.crashes" in done.out
    assert "ZeroDivisionError: division by zero" in " ".join(done.out.split())
    assert "Traceback" not in done.out + done.err
    crashed = read_record(tmp_path / "out.json").files[0].results[-1]
    assert (crashed.check, crashed.outcome) == ("test.crashes", "crashed")
    assert "Traceback" in crashed.traceback


def test_a_check_that_cannot_say_whether_it_applies_crashes_alone(
    fedora_qa: Command, sequence: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    replace_checks(monkeypatch, CannotSay(), Answers())
    assert fedora_qa("check", sequence, "--json", tmp_path / "out.json").code == 3
    crashed, answered = read_record(tmp_path / "out.json").files[0].results
    assert (crashed.outcome, answered.outcome) == ("crashed", "passed")
    assert "focal length of zero" in crashed.traceback


@pytest.mark.usefixtures("test_checks")
def test_evidence_lies_beside_the_record(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """Arrays are found under the names that the record gives, without unpickling, for one file and for several."""
    other = Path(shutil.copy(sequence, tmp_path / "other.h5"))
    for files, prefixes in (((sequence,), [""]), ((sequence, other), ["0/", "1/"])):
        fedora_qa("check", "--ignore", "test.crashes", *files, "--json", tmp_path / "out.json")
        record = read_record(tmp_path / "out.json")
        with np.load(tmp_path / "out.json.arrays.npz", allow_pickle=False) as arrays:
            assert arrays.files == [name for file in record.files for name in file.evidence]
            for prefix, file in zip(prefixes, record.files, strict=True):
                assert file.evidence[f"{prefix}test.answers/residual_px"] == "Residual by frame, px"
                np.testing.assert_array_equal(arrays[f"{prefix}test.answers/residual_px"], np.arange(3.0))
                assert arrays[f"{prefix}moments/rgb"].dtype == np.uint8


@pytest.mark.usefixtures("test_checks")
@pytest.mark.parametrize(("required", "code"), [(0.5, 0), (0.6, 3)])
def test_required_coverage(required: float, code: int, fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A check that saw half of its stream suffices for half, and is incomplete where more is required."""
    config = tmp_path / "fedora-qa.toml"
    config.write_text(f'ignore = ["test.crashes"]\n[required_coverage]\n"test.answers" = {required}\n')
    done = fedora_qa("check", sequence, "--config", config)
    assert done.code == code
    assert ("less was seen than required: test.answers" in done.out) == (code == 3)


def test_incomplete_comes_before_findings(fedora_qa: Command, sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a finding and a crash the exit code is 3."""
    replace_checks(monkeypatch, *CHECKS, Crashes())
    damage_clock(sequence)
    assert fedora_qa("check", *TIMESTAMPS, "--select", "test", sequence).code == 3


def test_truncated_file(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A file that begins like HDF5 and cannot be opened is a failed integrity with a record."""
    sequence.write_bytes(sequence.read_bytes()[:5000])
    done = fedora_qa("check", sequence, "--json", tmp_path / "out.json")
    assert done.code == 1
    failed = [one.check for one in read_record(tmp_path / "out.json").files[0].results if one.outcome == "failed"]
    assert failed == ["integrity.readable"]


NOT_HDF5 = {"text": b"hello\n", "nothing": b""}


@pytest.mark.parametrize("content", NOT_HDF5.values(), ids=NOT_HDF5.keys())
def test_no_hdf5_at_all(content: bytes, fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """One file that is no HDF5 among good ones is misuse, found before any work: nothing is written."""
    text = tmp_path / "notes.txt"
    text.write_bytes(content)
    done = fedora_qa("check", sequence, text, "--json", tmp_path / "out.json")
    assert done.code == 2
    assert "notes.txt" in done.err
    assert not done.out
    assert not (tmp_path / "out.json").exists()


REFUSED_OUTPUTS = {
    "the input": ("seq.h5", "an input"),
    "a folder": (".", "a folder"),
    "in no folder": ("none/out.json", "to exist"),
}


@pytest.mark.parametrize(("output", "named"), REFUSED_OUTPUTS.values(), ids=REFUSED_OUTPUTS.keys())
def test_refused_outputs(output: str, named: str, fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """An output that cannot be written, or would overwrite the data, is refused before any work."""
    before = sequence.read_bytes()
    done = fedora_qa("check", sequence, "--json", tmp_path / output)
    assert done.code == 2
    assert named in done.err
    assert sequence.read_bytes() == before


BAD_OPTIONS = {
    "unknown check": ("--select", "nonsense"),
    "nothing left": ("--select", "clocks", "--ignore", "clocks"),
    "memory without unit": ("--memory", "1000"),
    "unknown dialect": ("--dialect", "klingon"),
    "no config": ("--config", "none.toml"),
    "effort": ("--effort", "heroic"),
}


@pytest.mark.parametrize("options", BAD_OPTIONS.values(), ids=BAD_OPTIONS.keys())
def test_bad_options(options: tuple[str, ...], fedora_qa: Command, sequence: Path) -> None:
    """Options that cannot be carried out are misuse, and the message repeats what was given."""
    done = fedora_qa("check", *options, sequence)
    assert done.code == 2
    assert options[-1] in done.err or "leaves none" in done.err


def test_record_tells_the_run(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """The record says which tool, which options, which machine, how long; equal options have one digest."""
    digests = []
    for effort in ("full", "full", "quick"):
        fedora_qa("check", *TIMESTAMPS, sequence, "--effort", effort, "--json", tmp_path / "out.json")
        record = read_record(tmp_path / "out.json")
        digests.append(record.config_digest)
    assert digests[0] == digests[1] != digests[2]
    assert record.effort == "quick"
    assert record.tool.name == "fedora-qa"
    assert record.run.host["peak_memory_mib"]
    assert record.run.seconds["measuring"] >= 0
    document = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert list(document) == [
        "record_version", "ruleset_version", "tool", "config_digest", "run", "files", "effort", "profile",
    ]  # fmt: skip


def test_same_file_same_record(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """Two runs on one file give the same results, statistics and diagnoses."""
    damage_clock(sequence)
    files = []
    for _ in range(2):
        fedora_qa("check", *TIMESTAMPS, sequence, "--json", tmp_path / "out.json")
        files.append(read_record(tmp_path / "out.json").files)
    assert files[0] == files[1]


def test_each_file_once(fedora_qa: Command, sequence: Path) -> None:
    """A file given twice is a slip, not two files."""
    assert fedora_qa("check", sequence, sequence).code == 2
