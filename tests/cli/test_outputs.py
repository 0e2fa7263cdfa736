"""Reports with pictures: from a run and from its record, and what happens where something is missing."""

import sys
from pathlib import Path

import numpy as np
import pytest

from fedora_qa.causes import CAUSES
from fedora_qa.checks.explanation import published_explanations
from fedora_qa.cli.arrays import arrays_beside, read_arrays, write_arrays
from fedora_qa.cli.outputs import rule_helps
from fedora_qa.errors import MisuseError
from tests.cli.conftest import Command

TIMESTAMPS = ("--select", "clocks")


def test_report_is_drawn_again_from_the_record(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """``check --html`` and ``report --html`` draw the same document, with pictures inside it."""
    record, drawn, again = tmp_path / "out.json", tmp_path / "drawn.html", tmp_path / "again.html"
    assert fedora_qa("check", *TIMESTAMPS, sequence, "--json", record, "--html", drawn).code == 0
    assert fedora_qa("report", record, "--html", again).code == 0
    text = drawn.read_text(encoding="utf-8")
    assert text == again.read_text(encoding="utf-8")
    assert "data:image/" in text


def test_report_needs_no_record(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """Without ``--json`` the report has its pictures all the same, and nothing else is written."""
    fedora_qa("check", *TIMESTAMPS, sequence, "--html", tmp_path / "out.html")
    assert "data:image/" in (tmp_path / "out.html").read_text(encoding="utf-8")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.html", "seq.h5"]


@pytest.mark.parametrize("damage", ["missing", "cut", "text", "array"])
def test_lost_pictures_are_told(damage: str, fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """Where the arrays are missing or damaged, that is said, and the report is drawn without pictures."""
    record = tmp_path / "out.json"
    fedora_qa("check", *TIMESTAMPS, sequence, "--json", record)
    arrays = arrays_beside(record)
    if damage == "missing":
        arrays.unlink()
    elif damage == "cut":
        arrays.write_bytes(arrays.read_bytes()[: arrays.stat().st_size // 2])
    elif damage == "text":
        arrays.write_text("hello", encoding="utf-8")
    else:
        with arrays.open("wb") as file:
            np.save(file, np.arange(3))
    done = fedora_qa("report", record, "--html", tmp_path / "out.html")
    assert done.code == 0
    assert "the report is drawn without pictures" in done.err
    assert str(arrays) in done.err
    assert "<html" in (tmp_path / "out.html").read_text(encoding="utf-8")


def test_missing_extra_is_one_sentence(
    fedora_qa: Command, sequence: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where what draws reports is not installed, that is misuse, found before any work."""
    monkeypatch.setitem(sys.modules, "fedora_reports.html", None)
    monkeypatch.delattr("fedora_reports.html", raising=False)
    done = fedora_qa("check", *TIMESTAMPS, sequence, "--html", tmp_path / "out.html", "--json", tmp_path / "out.json")
    assert done.code == 2
    assert "pip install 'fedora-qa[reports]'" in done.err
    assert not done.out
    assert list(tmp_path.iterdir()) == [sequence]


def test_report_does_not_overwrite_what_it_reads(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """The record and its arrays are refused as outputs."""
    record = tmp_path / "out.json"
    fedora_qa("check", *TIMESTAMPS, sequence, "--json", record)
    for target in (record, arrays_beside(record)):
        before = target.read_bytes()
        assert fedora_qa("report", record, "--html", target).code == 2
        assert target.read_bytes() == before


def test_arrays_come_back_as_they_were(tmp_path: Path) -> None:
    """Names with slashes, every type, NaN and empty arrays survive; Python objects are refused."""
    arrays = {"a/b": np.array([np.nan, 1.0]), "0/file": np.empty((0, 3), np.uint8), "a/c": np.array(5, np.int64)}
    write_arrays(tmp_path / "x.npz", arrays)
    back = read_arrays(tmp_path / "x.npz")
    assert back.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(back[name], array)
        assert back[name].dtype == array.dtype
    with pytest.raises(TypeError, match="Python objects"):
        write_arrays(tmp_path / "y.npz", {"a": np.array([None])})
    with (tmp_path / "z.npz").open("wb") as file:
        np.savez(file, a=np.array([None], dtype=object))
    with pytest.raises(MisuseError, match="damaged"):
        read_arrays(tmp_path / "z.npz")


LONGEST_DESCRIPTION = 1024
"""Characters; code scanning accepts no longer ones (GitHub, "SARIF support for code scanning")."""


def test_every_check_has_a_help() -> None:
    """It says what is checked, why it matters and what to do, in both forms, without marks of reStructuredText."""
    helps = rule_helps()
    for explained in published_explanations():
        shown = helps[explained.check]
        assert 0 < len(shown.description) <= LONGEST_DESCRIPTION
        assert "``" not in shown.text + shown.markdown + shown.description
        for title in ("What is checked", "Why it matters", "What it cannot detect", "What to do"):
            assert f"\n{title}\n" in shown.text
            assert f"\n## {title}\n\n" in shown.markdown
    assert set(helps) == {explained.check for explained in published_explanations()}


def test_the_help_has_the_remedies_of_the_causes() -> None:
    """A check that measures causes directly states the remedy of each."""
    order = rule_helps()["clocks.order"]
    for cause in ("unsorted", "duplicated_samples"):
        assert CAUSES[cause].remedy in order.text
        assert CAUSES[cause].remedy in order.markdown
