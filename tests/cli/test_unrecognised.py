"""Commands on files and folders that no dialect describes: what is missing, and how it is drafted."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.cli.conftest import Command

_FORMS = ("file", "folder")


@pytest.fixture(params=_FORMS)
def unknown(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A file, or a folder, of another layout."""
    if request.param == "folder":
        (tmp_path / "unknown").mkdir()
        (tmp_path / "unknown" / "notes.txt").write_text("sunny\n", "utf-8")
        return tmp_path / "unknown"
    with h5py.File(tmp_path / "unknown.h5", "w") as file:
        file["measurements"] = np.arange(5)
    return tmp_path / "unknown.h5"


@pytest.mark.parametrize(
    ("command", "unknown"),
    [
        *((command, form) for command in ("check", "stats", "compare", "score", "export") for form in _FORMS),
        ("repair", "file"),
    ],
    indirect=["unknown"],
)
def test_every_command_names_what_drafts_a_dialect(
    command: str, unknown: Path, sequence: Path, tmp_path: Path, fedora_qa: Command
) -> None:
    """One sentence, the exit code of an incomplete check, and no output."""
    output = tmp_path / "out"
    arguments = {
        "check": [unknown, "--jobs", "1"],
        "stats": [unknown],
        "compare": [sequence, unknown],
        "score": [sequence, unknown],
        "export": [unknown, "--to", "tum", output],
        "repair": [unknown, "-o", output],
    }
    done = fedora_qa(command, *arguments[command])
    assert done.code == 3
    said = " ".join((done.out + done.err).split())
    assert "layout not recognised: no dialect describes anything in the" in said
    assert f"fedora-qa layout {unknown} --draft-dialect mine.toml" in said
    assert not output.exists()


def test_stats_of_the_others_are_printed(unknown: Path, sequence: Path, fedora_qa: Command) -> None:
    """Of several sequences one that no dialect describes does not end the command."""
    done = fedora_qa("stats", unknown, sequence)
    assert done.code == 3
    assert sequence.name in done.out
    assert "layout not recognised" in done.out


@pytest.mark.parametrize("command", ["stats", "compare"])
def test_an_empty_folder_is_misuse(command: str, tmp_path: Path, sequence: Path, fedora_qa: Command) -> None:
    """There is nothing to draft a dialect from."""
    (tmp_path / "empty").mkdir()
    done = fedora_qa(command, tmp_path / "empty", *([sequence] if command == "compare" else []))
    assert done.code == 2
