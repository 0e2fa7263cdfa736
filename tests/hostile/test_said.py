"""What a hostile file says of itself, and what it is called, through every output: read, and never obeyed."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fedora_qa.cli.main import run
from tests.hostile import contents
from tests.hostile.conftest import Attacked

NAME = "\x1b[2J\u202e<script>alert(1)<|script>]]>\n::error::owned##[error]|`@=cmd.h5"
"""A name of a file that no file system refuses."""

COMMANDING = {"\x1b", "\x07", "\x9b", "\u202e", "\u2066", "\r"}
"""Characters that command terminals, turn text around, or hide."""


@pytest.fixture
def hostile(attacked: Attacked, tmp_path: Path) -> Path:
    """A file with hostile names, texts, links, and name."""
    path = attacked(contents.hostile_names).rename(tmp_path / NAME)
    (tmp_path / "out").mkdir()
    return path


def require_harmless(text: str) -> None:
    """Hold what a terminal or a build reads to no command of either."""
    assert COMMANDING.isdisjoint(text), sorted(COMMANDING & set(text))
    assert not [line for line in text.splitlines() if line.lstrip().startswith("::error::")]


def require_unobeyed(text: str) -> None:
    """Hold what a build may read in its log to no command of GitHub's runner, of the old kind or the new."""
    require_harmless(text)
    assert "::" not in text
    assert "##[" not in text


def require_harmless_file(path: Path) -> None:
    """Hold a file to the same, to no markup of the file's where there is markup, and to telling of it."""
    text = path.read_text()
    require_harmless(text)
    assert "owned" in text
    if path.suffix in {".html", ".md", ".xml"}:
        assert "<script>alert" not in text


def test_every_output_of_a_check(hostile: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Right: each parses as what it is, tells of the file, and holds nothing of it that commands anything."""
    out = hostile.parent / "out"
    options = {"--html": "o.html", "--markdown": "o.md", "--junit": "o.xml", "--sarif": "o.sarif", "--csv": "csv"}
    given = [part for option, name in options.items() for part in (option, str(out / name))]
    assert run(["check", str(hostile), "--select", "integrity", "--select", "metadata", "--github", *given]) == 1
    require_harmless("".join(capsys.readouterr()))
    for written in (path for path in out.rglob("*") if path.is_file()):
        require_harmless_file(written)
    ElementTree.parse(out / "o.xml")
    json.loads((out / "o.sarif").read_text())


@pytest.mark.parametrize(
    "command",
    [["stats", "--markdown", "o.md"], ["compare", "--markdown", "o.md", "--html", "o.html"], ["layout"]],
    ids=lambda command: command[0],
)
def test_every_output_of_other_commands(
    command: list[str], hostile: Path, clean_bytes: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    """Right: the same of what describes and compares files."""
    out, (name, *options) = hostile.parent / "out", command
    (out / "clean.h5").write_bytes(clean_bytes)
    files = [str(hostile), str(out / "clean.h5")][: 2 if name == "compare" else 1]
    assert run([name, *files, *(str(out / one) if one.startswith("o.") else one for one in options)]) == 0
    require_unobeyed("".join(capsys.readouterr()))
    for written in out.glob("o.*"):
        require_harmless_file(written)


def test_what_is_refused_is_said_harmlessly(hostile: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Right: an error that quotes a name or a finding is one printable line."""
    for arguments in (["extract", str(hostile), NAME, "-o", "o.h5"], ["check", str(hostile) + NAME], ["report", NAME],
                      ["verify", NAME, NAME], ["gate", NAME, "--policy", NAME]):  # fmt: skip
        assert run(arguments) == 2
        require_unobeyed("".join(capsys.readouterr()))
