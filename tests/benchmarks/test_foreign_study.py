"""The study of foreign correct files: a fast part of it, and whether it counts right."""

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from fedora_qa.record.types import FileRecord
from tests.benchmarks.foreign import checked, study
from tests.benchmarks.foreign.checked import Outcome, check_transformed
from tests.benchmarks.foreign.page import page
from tests.benchmarks.foreign.scenes import Size, Source
from tests.benchmarks.foreign.table import TRANSFORMATIONS, UNCHANGED
from tests.support.checked import without_trials
from tests.support.shared_files import SharedFiles

BY_NAME = {kind.name: kind for kind in TRANSFORMATIONS}
SMALL = Size(90, 68, 0.4)
DAY = Source("park-day", 0)

FAST = (
    "quaternions with random signs",
    "gzip",
    "events cropped",
    "colour at 25 Hz",
    "world turned and moved",
    "Unix time",
)
"""Looked at while the checks were built; one or two of a group."""


@pytest.fixture(scope="module")
def clean(shared_files: SharedFiles) -> Path:
    return shared_files.file("foreign-day.h5", lambda path: DAY.write(SMALL, path))


@pytest.mark.parametrize("name", FAST)
def test_a_correct_file_does_not_fail(name: str, clean: Path, tmp_path: Path) -> None:
    """No check fails or crashes."""
    assert not BY_NAME[name].held_out
    assert check_transformed(BY_NAME[name], DAY, tmp_path, clean).alarms == ()


def test_a_wrong_file_would_fail(clean: Path, tmp_path: Path) -> None:
    """The same file fails where its orientations are wrong, so that the test above can fail."""
    wrong = replace(
        BY_NAME["world turned and moved"], change=lambda file: file["path/pose/orientation"].__setitem__(5, 0.5)
    )
    with without_trials():
        outcome = check_transformed(wrong, DAY, tmp_path, clean)
    assert outcome.verdict == "findings"
    assert any("pose" in alarm for alarm in outcome.alarms)


def test_a_file_is_checked_once(clean: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The outcome is kept and read again, and the file is not."""
    outcome = check_transformed(UNCHANGED, DAY, tmp_path, clean)
    assert [path.suffix for path in tmp_path.iterdir()] == [".json"]

    def check_again(*_: object) -> FileRecord:
        raise AssertionError

    monkeypatch.setattr(checked, "check_file", check_again)
    assert check_transformed(UNCHANGED, DAY, tmp_path, clean) == outcome


def test_the_study_leaves_out_what_is_held_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs in processes, and neither checks nor names a held-out transformation; no page is written."""
    held_out = next(kind.name for kind in TRANSFORMATIONS if kind.held_out)
    monkeypatch.setattr(study, "KEPT", tmp_path / "kept")
    monkeypatch.setattr(study, "TARGET", tmp_path / "page.md")
    monkeypatch.setattr(study, "in_processes", lambda processes, work, items, report: [work(item) for item in items])
    arguments = [
        "--scene",
        "park-day",
        "--seeds",
        "1",
        "--size",
        "90",
        "68",
        "0.4",
        "--kind",
        "unchanged",
        "--kind",
        held_out,
    ]
    ended = CliRunner().invoke(study.main, arguments)
    assert ended.exit_code == 0, ended.output
    assert "| unchanged | The reference generator | 1 | 1 | 0 | 0 |" in ended.output
    assert held_out not in ended.output
    assert not (tmp_path / "page.md").exists()


def test_the_page_counts_failures_apart() -> None:
    """Those of held-out transformations beside the others, with the words of the first finding."""
    apart = next(kind for kind in TRANSFORMATIONS if kind.held_out)
    other = next(kind for kind in TRANSFORMATIONS if not kind.held_out)
    outcomes = [
        Outcome(other.name, "park-day", 0, "clean", (), ()),
        Outcome(other.name, "park-day", 1, "clean", (), ("a.b.rule",)),
        Outcome(apart.name, "park-day", 0, "findings", ("a.b.rule: it is\nso", "c.d.rule: so too"), ()),
        Outcome(apart.name, "park-day", 1, "findings", ("a.b.rule: it is so",), ()),
    ]
    text = "".join(page([other, apart], outcomes, Size()))
    assert "4 correct files of 2 kinds, over 1 scenes and 2 seeds" in " ".join(text.split())
    assert "| looked at while the checks were built | 1 | 2 | 0 | 0.00%" in text
    # Clopper and Pearson: both of two files, the lower bound solves p^2 = 0.005.
    assert "| held out | 1 | 2 | 2 | 100.00% | 7.07% to 100.00% | 1 |" in text
    assert f"| {other.name} | {other.maker} | 2 | 2 | 1 | 0 |" in text
    assert f"- {apart.name}, park-day, seed 0 (2): a.b.rule: it is so" in text
