"""What the documentation shows in Python runs as it stands."""

from pathlib import Path

import pytest

import fedora_qa
from fedora_qa.cli.parquet import write_parquet
from tests.support.documented import blocks
from tests.support.handmade import write_handmade


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the examples name, in which they run."""
    (tmp_path / "release").mkdir()
    for name in ("late.h5", "release/a.h5", "release/b.h5"):
        write_handmade(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_one_file(folder: Path) -> None:
    """The first example checks a file and saves a record."""
    exec(blocks("python.md", "python")[0], {})
    assert fedora_qa.read_record(folder / "late.json").files[0].path == "late.h5"


def test_many_files(folder: Path) -> None:
    """The second checks a folder and counts outcomes; here without processes of its own."""
    example = blocks("python.md", "python")[1].replace("jobs=4", "jobs=1, select=['clocks']")
    names = {"fedora_qa": fedora_qa, "__name__": "__main__"}
    exec(example, names)
    assert len(names["record"].files) == 2  # type: ignore[attr-defined]


def test_tables(folder: Path) -> None:
    """The example of the formats counts findings by their rule."""
    (folder / "tables").mkdir()
    write_parquet(folder / "tables", fedora_qa.check("late.h5", select=["clocks"], evidence=False))
    names: dict[str, object] = {}
    exec(blocks("formats.md", "python")[0], names)
    assert list(names["found"].columns)[:3] == ["file", "check", "id"]  # type: ignore[attr-defined]
