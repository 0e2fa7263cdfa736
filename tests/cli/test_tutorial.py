"""The tutorial's commands do what it shows."""

import re
import runpy
import shlex
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Command
from tests.support.documented import DOCS
from tests.support.sequences import make_sequence

BLOCK = re.compile(
    r"^```(?P<language>\w+)(?: title=\"(?P<title>[^\"]*)\")?\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
GENERATE = "fedora-generate sequence park-day -o park.h5 --duration 0.6 --size 270x200 --quality draft"


def without_numbers(line: str) -> str:
    """A line whose numbers are replaced and whose blanks are single, since numbers differ between machines."""
    return " ".join(re.sub(r"\d+(\.\d+)?", "#", line).split())


def missing_lines(shown: str, printed: str) -> list[str]:
    """The lines that a page shows and that were not printed, in this order; '...' stands for any lines."""
    lines = iter([without_numbers(line) for line in printed.splitlines()])
    wanted = [line for line in shown.splitlines() if line.strip() != "..."]
    return [line for line in wanted if without_numbers(line) not in lines]


def test_the_tutorial(fedora_qa: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each command prints the lines that the page shows, and files hold what it writes into them."""
    monkeypatch.chdir(tmp_path)
    make_sequence(tmp_path / "park.h5", "park-day", 0.6, 270, 200)
    (tmp_path / "docs").symlink_to(DOCS)
    commands = []
    for block in BLOCK.finditer((DOCS / "tutorial.md").read_text(encoding="utf-8")):
        match block["language"], block["title"]:
            case "toml", None:
                assert block["text"] in Path("mine.toml").read_text(encoding="utf-8")
            case "toml", name:
                Path(name).write_text(block["text"], encoding="utf-8")
            case "console", _:
                for part in block["text"].removeprefix("$ ").split("\n$ "):
                    command, _, shown = part.rstrip("\n").partition("\n")
                    commands.append(command)
                    program, *arguments = shlex.split(command)
                    if program == "python":
                        monkeypatch.setattr(sys, "argv", arguments)
                        runpy.run_path(arguments[0])
                    elif program == "fedora-qa":
                        assert not missing_lines(shown, fedora_qa(*arguments).out), command
    assert commands[0] == GENERATE, "the file is made as the page says"
    assert len(commands) == 10
    assert Path("report.html").stat().st_size > 0


def test_a_line_that_is_not_printed_is_noticed() -> None:
    """The test above can fail; numbers may differ, and the order counts."""
    assert not missing_lines("a 1.5 ms\n...\nc", "a 2 ms\nb\nc\n")
    assert missing_lines("c\na 1", "a 1\nc\n") == ["a 1"]
