"""What windows have shown is read back only where it is not at hand."""

import pickle
from pathlib import Path
from typing import Any

import pytest

from fedora_qa.engine.file_task import FileTask, Sealed, Surveyed
from fedora_qa.engine.open_file import OpenFile
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from tests.support.handmade import write_handmade
from tests.support.killers import Counts


@pytest.fixture
def surveyed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Surveyed:
    """A file whose windows, of 60 ms, are counted."""
    monkeypatch.setattr("fedora_qa.engine.windows.WINDOW_NS", 60_000_000)
    asked = ((Counts(),), CheckOptions(evidence=None))
    found = FileTask("survey_file", write_handmade(tmp_path / "seq.h5"), asked)(quiet)
    assert isinstance(found, Surveyed)
    assert found.windows == 2
    return found


def measured(surveyed: Surveyed, windows: list[int], before: Any, folder: Path, open_file: OpenFile) -> Sealed[Any]:
    sealed: Sealed[Any] = FileTask("measure_windows", surveyed, (before,), windows, folder)(quiet, open_file)
    return sealed


def spoil(sealed: Sealed[Any]) -> None:
    assert sealed.path
    sealed.path.write_bytes(b"")


def test_what_was_put_away_last_is_not_read_back(surveyed: Surveyed, tmp_path: Path) -> None:
    """A worker goes on with what it has; what it leaves in a file is what both stretches have shown."""
    open_file = OpenFile(keeps=True)
    first = measured(surveyed, [0], None, tmp_path, open_file)
    spoil(first)
    both = measured(surveyed, [1], first, tmp_path, open_file)
    assert both.open().states.states["test.counts"] == [0, 1]


def test_it_is_handed_out_once(surveyed: Surveyed, tmp_path: Path) -> None:
    """It is added to: a task that is done again finds what it began with, in the file."""
    open_file = OpenFile(keeps=True)
    first = measured(surveyed, [0], None, tmp_path, open_file)
    for _ in range(2):
        again = measured(surveyed, [1], first, tmp_path, open_file)
        assert again.open().states.states["test.counts"] == [0, 1]
    spoil(first)
    with pytest.raises(EOFError):
        measured(surveyed, [1], first, tmp_path, open_file)


def test_nothing_is_kept_of_another_stretch(surveyed: Surveyed, tmp_path: Path) -> None:
    """A worker that begins elsewhere, or has no work, lets go of it."""
    for let_go in (lambda open_file: measured(surveyed, [1], None, tmp_path, open_file), OpenFile.clear):
        open_file = OpenFile(keeps=True)
        first = measured(surveyed, [0], None, tmp_path, open_file)
        let_go(open_file)
        spoil(first)
        with pytest.raises(EOFError):
            measured(surveyed, [1], first, tmp_path, open_file)


def test_an_open_file_that_keeps_nothing_reads_it(surveyed: Surveyed, tmp_path: Path) -> None:
    """In a process that is no worker, and where what was shown travels by itself."""
    first = measured(surveyed, [0], None, tmp_path, OpenFile(keeps=False))
    assert measured(surveyed, [1], first, tmp_path, OpenFile(keeps=True)).open().states.states["test.counts"] == [0, 1]
    travels = FileTask("measure_windows", surveyed, (None,), [0])(quiet, OpenFile(keeps=True))
    assert pickle.loads(travels.pickled).states.states["test.counts"] == [0]
