"""``fedora-qa compare`` over files, folders and records: what it says, what it writes, and exit codes."""

import json
import shutil
from pathlib import Path

import jsonschema
import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.comparison.types import COMPARISON
from tests.cli.conftest import Command
from tests.support.latex_reader import read_latex


def test_a_planted_fault_is_a_new_finding(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """Records of a file before and after a fault: the finding is new, in every output; the exit code is 0."""
    faulty = tmp_path / "new" / "seq.h5"
    faulty.parent.mkdir()
    plant_fault(sequence, faulty, "unsorted", "imu", 3, "samples")
    records = [tmp_path / "before.json", tmp_path / "after.json"]
    for path, record in zip((sequence, faulty), records, strict=True):
        fedora_qa("check", path, "--select", "clocks.order", "--json", record)
    outputs = {kind: tmp_path / f"out.{kind}" for kind in ("json", "html", "markdown", "latex")}
    done = fedora_qa("compare", *records, *(part for kind, path in outputs.items() for part in (f"--{kind}", path)))
    assert (done.code, done.err) == (0, "")
    assert "1 new, 0 gone" in done.out
    assert "clocks.order" in done.out
    document = json.loads(outputs["json"].read_text(encoding="utf-8"))
    jsonschema.validate(document, COMPARISON.schema())
    assert document["pairs"][0]["design"] == "versions"
    assert [one["change"] for one in document["pairs"][0]["versions"]["findings"]] == ["new"]
    assert any("Findings" in table.caption for table in read_latex(outputs["latex"].read_text(encoding="utf-8")))
    for kind in ("html", "markdown", "latex"):
        assert "new" in outputs[kind].read_text(encoding="utf-8")
    printed = fedora_qa("compare", *records, "--format", "json")
    assert (printed.out, printed.err) == (outputs["json"].read_text(encoding="utf-8"), done.out)


def test_files_and_folders_are_measured(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A file against itself in a folder: statistics and distributions are the same, and nothing differs."""
    folder = tmp_path / "again"
    folder.mkdir()
    shutil.copy(sequence, folder / sequence.name)
    done = fedora_qa("compare", sequence, folder)
    assert (done.code, done.err) == (0, "")
    assert "two versions of the same files" in done.out
    assert "Statistics that are not the same" not in done.out
    assert "7 distributions compared: 7 identical" in done.out
    assert done.out.startswith("again and ")


def test_misuse(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """One path, the same twice, nothing there, nothing in a folder, an output over an input: 2, before any work."""
    other = Path(shutil.copy(sequence, tmp_path / "other.h5"))
    (tmp_path / "empty").mkdir()
    for arguments, said in (
        ((sequence,), "two or more"),
        ((sequence, sequence), "once"),
        ((sequence, tmp_path / "nowhere.h5"), "nowhere.h5"),
        ((sequence, tmp_path / "nowhere.json"), "nowhere.json"),
        ((sequence, tmp_path / "empty"), "neither"),
        ((sequence, other, "--json", other), "output of its own"),
        ((sequence, other, "--false-alarm-rate", "2"), "false-alarm-rate"),
    ):
        done = fedora_qa("compare", *arguments)
        assert (done.code, said in done.err) == (2, True), done.err


@pytest.mark.parametrize("arrays", ["missing", "damaged"])
def test_records_without_their_arrays(fedora_qa: Command, sequence: Path, tmp_path: Path, arrays: str) -> None:
    """Missing, they are noted, and findings are compared all the same; damaged, they are misuse."""
    records = [tmp_path / "a.json", tmp_path / "b.json"]
    for record in records:
        fedora_qa("check", sequence, "--select", "clocks.order", "--json", record)
    beside = tmp_path / "b.json.arrays.npz"
    beside.unlink() if arrays == "missing" else beside.write_bytes(b"PK not an archive")
    done = fedora_qa("compare", *records)
    assert done.code == (0 if arrays == "missing" else 2)
    assert ("b.json: nothing is known" in done.out.replace("\n", " ")) == (arrays == "missing")


def test_the_page_shows_what_both_records_kept(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """Frames and paths come from the arrays beside the records; without those of one, the page says so."""
    records = [tmp_path / "before.json", tmp_path / "after.json"]
    for record in records:
        fedora_qa("check", sequence, "--select", "images", "--select", "pose", "--json", record)
    page = tmp_path / "out.html"
    assert fedora_qa("compare", *records, "--html", page).code == 0
    text = page.read_text(encoding="utf-8")
    assert text.count("<b>Colour frame</b>") > text.count('class="legend"')
    assert '<figure class="paths">' in text
    (tmp_path / "after.json.arrays.npz").unlink()
    assert fedora_qa("compare", *records, "--html", page).code == 0
    assert "No pictures and no path of this file were kept in after.json" in page.read_text(encoding="utf-8")
