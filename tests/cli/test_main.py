"""The frame of the command line: help, misuse, internal errors, closed pipes."""

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from fedora_qa.cli.main import COMMANDS
from fedora_qa.cli.main import fedora_qa as group
from tests.cli.conftest import Command


def test_help_names_every_command(fedora_qa: Command) -> None:
    """``--help`` lists each command with what it does."""
    shown = fedora_qa("--help")
    assert shown.code == 0
    for name, (_, meaning) in COMMANDS.items():
        assert f"{name} " in shown.out
        assert " ".join(meaning.split()[:4]) in " ".join(shown.out.split())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str, fedora_qa: Command) -> None:
    """The table of commands points at commands."""
    command = group.get_command(click.Context(group), name)
    assert command is not None
    assert command.name == name
    assert fedora_qa(name, "--help").code == 0


MISUSES = {
    "no command": (),
    "unknown command": ("chekc",),
    "unknown option": ("check", "--efort", "full", "x.h5"),
    "no file": ("check",),
    "no such file": ("check", "none.h5"),
    "no such file for stats": ("stats", "none.h5"),
    "no such file for layout": ("layout", "none.h5"),
    "no such record": ("report", "none.json"),
    "no such check": ("explain", "nonsense"),
    "features of later versions": ("check", "--html", "out.html", "x.h5"),
}


@pytest.mark.parametrize("arguments", MISUSES.values(), ids=MISUSES.keys())
def test_misuse(arguments: tuple[str, ...], fedora_qa: Command) -> None:
    """Misuse exits with 2 and says why on stderr, with nothing on stdout and no traceback."""
    done = fedora_qa(*arguments)
    assert done.code == 2
    assert done.err
    assert not done.out
    assert "Traceback" not in done.err


def explode(*_: object) -> None:
    """Fail as a defect would."""
    raise ZeroDivisionError("division by zero\nsecond line")


def test_internal_error(fedora_qa: Command, sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A defect exits with 3 and one sentence that says how to see the traceback."""
    monkeypatch.setattr("fedora_qa.cli.check.check_files", explode)
    done = fedora_qa("check", sequence)
    assert done.code == 3
    assert done.err.count("\n") == 1
    assert "ZeroDivisionError: division by zero (set FEDORA_QA_TRACEBACK=1" in done.err


def test_traceback_on_request(fedora_qa: Command, sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The variable that the sentence names shows the traceback."""
    monkeypatch.setattr("fedora_qa.cli.check.check_files", explode)
    monkeypatch.setenv("FEDORA_QA_TRACEBACK", "1")
    done = fedora_qa("check", sequence)
    assert done.code == 3
    assert "Traceback" in done.err


def test_a_command_of_the_generator_is_named(fedora_qa: Command) -> None:
    """People look for it here."""
    done = fedora_qa("fault", "seq.h5", "events:time_offset")
    assert done.code == 2
    assert "use `fedora-generate fault`" in done.err


def interrupt(*_: object) -> None:
    """End as ctrl-C does."""
    raise KeyboardInterrupt


def test_interrupt(fedora_qa: Command, sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C ends with one word and the code that shells know."""
    monkeypatch.setattr("fedora_qa.cli.check.check_files", interrupt)
    done = fedora_qa("check", sequence)
    assert done.code == 130
    assert "interrupted" in done.err
    assert "Traceback" not in done.err


def test_reader_goes_away() -> None:
    """``fedora-qa checks | head`` leaves no complaint, and its code is not one that means findings."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "fedora_qa.cli.main", "checks"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert done.returncode == 141
    assert done.stderr == ""
