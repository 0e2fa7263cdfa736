"""``fedora-qa power`` over a handful of files: tables, JSON and HTML, and exit codes."""

import json
import shutil
from pathlib import Path

import jsonschema
import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.power import study
from fedora_qa.power.detection_power import read_detection_power
from fedora_qa.record.power_study import POWER
from tests.cli.conftest import Command
from tests.support.handmade import write_handmade

TIMESTAMPS = ("--select", "clocks")


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    """Two clean files, and three copies of one of them whose IMU samples are out of order."""
    folder = tmp_path / "corpus"
    folder.mkdir()
    write_handmade(folder / "day.h5")
    shutil.copy(folder / "day.h5", folder / "again.h5")
    items: list[dict[str, object]] = [{"file": "day.h5"}, {"file": "again.h5"}]
    for count in (2, 4, 9):
        fault = {"cause": "unsorted", "stream": "imu", "magnitude": count, "unit": "samples"}
        plant_fault(folder / "day.h5", folder / f"{count}.h5", "unsorted", "imu", count, "samples")
        items.append({"file": f"{count}.h5", "base": "day.h5", **fault})
    (folder / "manifest.json").write_text(json.dumps({"corpus_version": 1, "items": items}))
    return folder


def test_measures_and_writes(fedora_qa: Command, corpus: Path, tmp_path: Path) -> None:
    """Tables, JSON, HTML and the table for the package agree; the corpus is left as it was."""
    before = sorted(corpus.iterdir())
    outputs = (
        "--format",
        "json",
        "--html",
        tmp_path / "p.html",
        "--publish",
        tmp_path / "w.json",
        "--markdown",
        tmp_path / "p.md",
        "--svg",
        tmp_path / "p.svg",
    )
    done = fedora_qa("power", corpus, *TIMESTAMPS, *outputs)
    assert done.code == 0
    assert "imu:unsorted" in done.err
    assert "3 of 3 (100.0%)" in done.err
    document = json.loads(done.out)
    jsonschema.validate(document, POWER.schema())
    assert (document["files"], document["clean"], document["false_alarms"]["files"]["count"]) == (5, 2, 0)
    assert [one["found"]["count"] for one in document["naming"]] == [3]
    assert "imu:unsorted" in (tmp_path / "p.html").read_text(encoding="utf-8").replace("<wbr>", "")
    page = (tmp_path / "p.md").read_text(encoding="utf-8")
    assert "| imu:unsorted | any check | 3 of 3 (100.0%) |" in page.replace("\\", "")
    assert "](p.svg)" in page
    assert (tmp_path / "p.svg").read_text(encoding="utf-8").startswith("<svg")
    detection_power = read_detection_power(tmp_path / "w.json")
    assert detection_power is not None
    assert not detection_power.is_stale()
    assert sorted(corpus.iterdir()) == before
    assert len(list((tmp_path / "corpus.power").iterdir())) == 5


def test_several_corpora_are_one_study(fedora_qa: Command, corpus: Path, tmp_path: Path) -> None:
    """Two corpora are counted together, each with its state beside it; a name that is in both is misuse."""
    other = tmp_path / "other"
    other.mkdir()
    shutil.copy(corpus / "day.h5", other / "night.h5")
    (other / "manifest.json").write_text('{"corpus_version": 1, "items": [{"file": "night.h5"}]}')
    done = fedora_qa("power", corpus, other, *TIMESTAMPS, "--json", tmp_path / "p.json")
    document = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))
    assert (done.code, document["files"], document["clean"], document["corpus"]) == (0, 6, 3, "corpus, other")
    assert (tmp_path / "other.power" / "night.h5.json").is_file()
    shutil.copytree(corpus, tmp_path / "same")
    refused = fedora_qa("power", corpus, tmp_path / "same", *TIMESTAMPS)
    assert refused.code == 2
    assert "Expected corpora whose files have different names, got day.h5 in both" in refused.err


def test_goes_on_where_it_was(
    fedora_qa: Command, corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interrupted with 130, it keeps what was found, and the next run checks only the rest."""
    checked = study.check_file
    seen: list[str] = []

    def check_two(path: Path, *arguments: object) -> object:
        if len(seen) == 2:
            raise KeyboardInterrupt
        seen.append(path.name)
        return checked(path, *arguments)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(study, "check_file", check_two)
        assert fedora_qa("power", corpus, *TIMESTAMPS, "--state", tmp_path / "kept").code == 130
    assert len(list((tmp_path / "kept" / "corpus.power").iterdir())) == 2
    monkeypatch.setattr(study, "check_file", lambda path, *more: (seen.append(path.name), checked(path, *more))[1])
    assert fedora_qa("power", corpus, *TIMESTAMPS, "--state", tmp_path / "kept").code == 0
    assert seen == ["day.h5", "again.h5", "2.h5", "4.h5", "9.h5"]


def test_several_processes_find_the_same(fedora_qa: Command, corpus: Path, tmp_path: Path) -> None:
    """Two processes give the tables that one gives."""
    one = fedora_qa("power", corpus, *TIMESTAMPS, "--state", tmp_path / "one")
    two = fedora_qa("power", corpus, *TIMESTAMPS, "--state", tmp_path / "two", "--jobs", "2")
    assert (one.out, one.code) == (two.out, two.code)


def test_misuse(fedora_qa: Command, corpus: Path, sequence: Path, tmp_path: Path) -> None:
    """No corpus, an unknown check, an output that is an input, a missing file: code 2, and nothing is written."""
    (corpus / "9.h5").unlink()
    for arguments, said in (
        ((tmp_path / "nowhere",), "manifest.json"),
        ((sequence,), "manifest.json"),
        ((corpus, "--select", "lateness"), "'lateness'"),
        ((corpus, "--json", corpus / "manifest.json"), "output of its own"),
        ((corpus,), "9.h5 missing"),
    ):
        done = fedora_qa("power", *arguments)
        assert (done.code, said in done.err) == (2, True), done.err
    assert not (tmp_path / "corpus.power").exists()


def test_a_crashed_check_is_told(fedora_qa: Command, corpus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a check itself failed, the study is incomplete: code 3, and the file is named."""

    def crash(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("fedora_qa.checks.clocks.order.ClocksOrder.examine", crash, raising=False)
    done = fedora_qa("power", corpus, "--select", "clocks.order")
    assert done.code == 3
    assert "A check crashed in 5 files" in done.out
