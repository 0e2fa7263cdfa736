"""The functions for commands other than ``check``: what they return, how a notebook shows it, and what they refuse."""

import inspect
import sys
from collections.abc import Callable
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

import h5py
import pytest

import fedora_qa
from fedora_qa.cli.main import run
from fedora_qa.comparison.types import COMPARISON
from fedora_qa.config import CheckConfig
from fedora_qa.errors import MisuseError
from fedora_qa.gating.certificate import read_certificate
from fedora_qa.record.json_io import read_record as read_plain
from tests.support.handmade import write_handmade

POLICY = 'ruleset_version = "2"\n[check]\nselect = ["clocks.order"]\n'


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    """A clean file, with markup in its name."""
    return write_handmade(tmp_path / "<b>a.h5")


@pytest.fixture
def unsorted(tmp_path: Path) -> Path:
    """A file in which two timestamps of the IMU are exchanged."""
    path = write_handmade(tmp_path / "b.h5")
    with h5py.File(path, "r+") as file:
        timestamps = file["path/imu/ts"]
        assert isinstance(timestamps, h5py.Dataset)
        timestamps[20:22] = timestamps[20:22][::-1]
    return path


def test_no_function_has_the_name_of_a_module() -> None:
    """A module of the same name would take the place of the function as soon as it is imported."""
    public = [name for name in fedora_qa.__all__ if name != "__version__"]
    assert len(public) > 8
    # A folder without modules, of bytecode that was left behind, has no origin.
    assert [name for name in public if (spec := find_spec(f"fedora_qa.{name}")) and spec.origin] == []


def test_check_takes_every_key_of_the_configuration() -> None:
    """Each key is a keyword of its own, None where it is not given; none is hidden in ``**options``."""
    parameters = inspect.signature(fedora_qa.check).parameters
    keys = {field.name for field in fields(CheckConfig)}
    assert parameters.keys() - keys == {"paths", "config", "evidence", "apart"}
    assert {parameters[key].default for key in keys} == {None}


@pytest.mark.parametrize("name", ["check", "compare", "explain", "gate", "open_sequence", "repair", "score", "stats"])
def test_keywords_are_spelt_out(name: str) -> None:
    """An unknown keyword is Python's own error, and every argument is described."""
    function = getattr(fedora_qa, name)
    kinds = {parameter.kind for parameter in inspect.signature(function).parameters.values()}
    assert inspect.Parameter.VAR_KEYWORD not in kinds
    with pytest.raises(TypeError, match="efort"):
        function(efort="quick")
    described = inspect.getdoc(function) or ""
    assert [argument for argument in inspect.signature(function).parameters if argument not in described] == []


def test_gate_is_the_command(unsorted: Path, sound: Path, tmp_path: Path) -> None:
    """Files and digest are those that ``gate --json`` writes; the baseline of that record accepts its findings."""
    policy, written, certificate = (tmp_path / name for name in ("policy.toml", "out.json", "certificate.json"))
    policy.write_text(POLICY)
    record = fedora_qa.gate(tmp_path, policy, evidence=False, certificate=certificate)
    assert run(["gate", str(tmp_path), "--policy", str(policy), "--json", str(written)]) == 1
    plain = read_plain(written)
    assert [(file.path, file.verdict) for file in record.files] == [(file.path, file.verdict) for file in plain.files]
    assert record.config_digest == plain.config_digest
    assert (record.verdict, certificate.exists()) == ("findings", False)
    accepted = fedora_qa.gate(tmp_path, policy, baseline=written, certificate=certificate, evidence=False)
    assert (accepted.verdict, len(read_certificate(certificate).files)) == ("clean", 2)


def test_compare_is_the_command(sound: Path, unsorted: Path, tmp_path: Path) -> None:
    """The document is the one that ``compare --json`` writes, and ``save`` writes it too."""
    comparison = fedora_qa.compare(sound, unsorted)
    assert run(["compare", str(sound), str(unsorted), "--json", str(tmp_path / "out.json")]) == 0
    comparison.save(tmp_path / "saved.json")
    assert (tmp_path / "saved.json").read_text("utf-8") == (tmp_path / "out.json").read_text("utf-8")
    assert COMPARISON.from_json((tmp_path / "saved.json").read_text("utf-8")).pairs == comparison.pairs
    assert comparison._repr_html_().startswith("<iframe srcdoc=")
    assert len(comparison.tables) > 2


def test_a_comparison_without_reports(sound: Path, unsorted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing draws reports, headline and tables are shown; the markup of a name stays text."""
    comparison = fedora_qa.compare(sound, unsorted)
    monkeypatch.setitem(sys.modules, "fedora_reports.comparison", None)
    page = comparison._repr_html_()
    assert "<caption>Distributions</caption>" in page
    assert "&lt;b&gt;a.h5" in page
    assert "<b>a.h5" not in page
    assert "distributions compared" in repr(comparison)


def test_statistics(sound: Path) -> None:
    """Tables in a notebook and as text; a data frame with a row for each number."""
    statistics = fedora_qa.stats(sound)
    assert "<caption>Sequences</caption>" in statistics._repr_html_()
    assert "<b>a.h5" not in statistics._repr_html_()
    assert repr(statistics).startswith("## Sequences")
    numbers = [value for values in statistics.by_file[str(sound)].values() for value in values]
    assert list(statistics.frame["name"]) == numbers


def test_explanations() -> None:
    """One check in full, with its sections; several by their questions."""
    explained = fedora_qa.explain("clocks.order")
    (only,) = explained
    assert only.question in repr(explained)
    assert "Cannot detect" in explained._repr_html_()
    assert len(fedora_qa.explain("clocks")) < len(fedora_qa.explain())
    assert fedora_qa.explain()._repr_html_().startswith("<table>")


def test_a_sequence_shows_its_datasets(sound: Path) -> None:
    """Each dataset with its shape; the markup of a name stays text."""
    with fedora_qa.open_sequence(sound) as sequence:
        page = sequence._repr_html_()
    assert "<td>path/imu/ts</td>" in page
    assert "&lt;b&gt;a.h5" in page
    assert "<b>a.h5" not in page
    assert "in the dialect fedora" in repr(sequence)


REFUSED: dict[str, tuple[Callable[[Path], object], str]] = {
    "one subject": (fedora_qa.compare, "two or more"),
    "a rate of 2": (lambda path: fedora_qa.compare(path, path, false_alarm_rate=2), "pass 0.01"),
    "nothing to measure": (lambda path: fedora_qa.stats(), "at least one file"),
    "no amount": (lambda path: fedora_qa.stats(path, memory="much"), "such as 1GB"),
    "no check": (lambda path: fedora_qa.explain("heroic"), r"fedora_qa.explain\(\)"),
    "a misspelt check to explain": (lambda path: fedora_qa.explain("clock.order"), r"did you mean 'clocks\.order'\?"),
    "a misspelt check": (lambda path: fedora_qa.check(path, select=["clock"]), r"did you mean 'clocks'\?"),
    "a misspelt coverage": (
        lambda path: fedora_qa.check(path, required_coverage={"imo": 1.0}),
        r"did you mean 'imu'\?",
    ),
    "a misspelt effort": (lambda path: fedora_qa.check(path, effort=cast("Any", "ful")), r"did you mean 'full'\?"),
    "a misspelt profile": (
        lambda path: fedora_qa.check(path, profile=cast("Any", "trainin")),
        r"did you mean 'training'\?",
    ),
    "a misspelt design": (
        lambda path: fedora_qa.compare(path, path, design=cast("Any", "version")),
        r"did you mean 'versions'\?",
    ),
    "a misspelt form": (
        lambda path: fedora_qa.score(path, path, form=cast("Any", "canonic")),
        r"did you mean 'canonical'\?",
    ),
    "a misspelt dialect": (
        lambda path: fedora_qa.open_sequence(path, dialect="fedra"),
        r"did you mean 'fedora'\?",
    ),
    "no policy": (lambda path: fedora_qa.gate(path.parent, "none.toml"), "none.toml"),
    "no jobs": (lambda path: fedora_qa.gate(path.parent, "none.toml", jobs=0), "pass jobs=1"),
    "no output": (fedora_qa.repair, "dry_run=True"),
    "a diagnosis and no list": (lambda path: fedora_qa.repair(path, dry_run=True, only="D1"), r"only=\['D1'\]"),
    "an output that exists": (lambda path: fedora_qa.repair(path, path.with_name("b.h5")), "force=True"),
    "a folder and no list": (lambda path: fedora_qa.check(path, allow_external="data"), r"pass \['data'\]"),
    "no sequence": (lambda path: fedora_qa.open_sequence(path.with_name("none.h5")), "none.h5"),
    "no dialect": (lambda path: fedora_qa.open_sequence(path, dialect="klingon"), "klingon"),
}


@pytest.mark.parametrize(("call", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_misuse(call: Callable[[Path], object], message: str, sound: Path, unsorted: Path) -> None:
    """What cannot be carried out is one error, which says what to pass."""
    with pytest.raises(MisuseError, match=message):
        call(sound)
