"""Shells complete commands, options and names; bash does so with the script that the program prints."""

import os
import subprocess
import sys
from collections.abc import Callable

import pytest

from fedora_qa.cli.main import COMMANDS, COMPLETION_VARIABLE, main

PROGRAM = [sys.executable, "-m", "fedora_qa.cli.main"]

Asked = Callable[..., list[str]]


def question(words: str, instruction: str = "bash_complete") -> dict[str, str]:
    """How a shell asks what may follow these words, the last of them unfinished: by variables."""
    return {
        COMPLETION_VARIABLE: instruction,
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
    }


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Asked:
    """What the program answers a shell, in this process."""

    def answer(words: str, instruction: str = "bash_complete") -> list[str]:
        for name, value in question(words, instruction).items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr(sys, "argv", ["fedora-qa"])
        with pytest.raises(SystemExit) as ended:
            sys.exit(main())
        assert not ended.value.code
        return capsys.readouterr().out.splitlines()

    return answer


COMPLETED = {
    "commands": ("fedora-qa ", {f"plain,{name}" for name in COMMANDS}),
    "a command": ("fedora-qa ext", {"plain,extract"}),
    "options": ("fedora-qa verify --he", {"plain,--help"}),
    "choices": ("fedora-qa extract a.h5 F1 --effort st", {"plain,standard"}),
    "checks": ("fedora-qa explain imu.t", {"plain,imu.translation", "plain,imu.timing"}),
    "dialects, or a file": ("fedora-qa check a.h5 --dialect m", {"plain,m3ed", "plain,mvsec", "file,m"}),
    "causes": ("fedora-qa explain vign", {"plain,vignetting"}),
    "files": ("fedora-qa verify cert", {"file,cert"}),
    "schemas": ("fedora-qa schema p", {"plain,power", "plain,policy"}),
}


@pytest.mark.parametrize(("words", "answered"), COMPLETED.values(), ids=COMPLETED.keys())
def test_what_may_follow(words: str, answered: set[str], asked: Asked) -> None:
    """Whatever can stand at a place is offered there, and nothing else."""
    assert set(asked(words)) == answered


def test_the_program_answers() -> None:
    """As a process, as a shell asks it."""
    environment = os.environ | question("fedora-qa explain imu.t")
    done = subprocess.run(PROGRAM, env=environment, capture_output=True, text=True, check=True)
    assert set(done.stdout.splitlines()) == COMPLETED["checks"][1]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_each_shell(shell: str, asked: Asked) -> None:
    """Each shell gets the script that asks the program by its variable."""
    text = "\n".join(asked("", f"{shell}_source"))
    assert f"{COMPLETION_VARIABLE}={shell}_complete" in text


def test_completing_commands_loads_nothing() -> None:
    """The names of commands come without their libraries, so that the shell does not wait."""
    code = (
        "import sys; from fedora_qa.cli.main import fedora_qa; import click;"
        "context = click.Context(fedora_qa);"
        "print(len(fedora_qa.shell_complete(context, '')), 'numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(len(COMMANDS)), "False"]
