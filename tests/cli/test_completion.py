"""Shells complete commands, options and names; bash does so with the script that the program prints."""

import os
import subprocess
import sys

import pytest

from fedora_qa.cli.main import COMMANDS, COMPLETION_VARIABLE

PROGRAM = [sys.executable, "-m", "fedora_qa.cli.main"]


def asked(words: str, instruction: str = "bash_complete") -> list[str]:
    """What the program answers a shell that has read these words, the last of them unfinished."""
    environment = os.environ | {
        COMPLETION_VARIABLE: instruction,
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
    }
    return subprocess.run(PROGRAM, env=environment, capture_output=True, text=True, check=True).stdout.splitlines()


COMPLETED = {
    "commands": ("fedora-qa ", {f"plain,{name}" for name in COMMANDS}),
    "a command": ("fedora-qa ext", {"plain,extract"}),
    "options": ("fedora-qa verify --he", {"plain,--help"}),
    "choices": ("fedora-qa extract a.h5 F1 --effort st", {"plain,standard"}),
    "checks": ("fedora-qa explain imu.t", {"plain,imu.translation", "plain,imu.timing"}),
    "files": ("fedora-qa verify cert", {"file,cert"}),
    "schemas": ("fedora-qa schema p", {"plain,power", "plain,policy"}),
}


@pytest.mark.parametrize(("words", "answered"), COMPLETED.values(), ids=COMPLETED.keys())
def test_what_may_follow(words: str, answered: set[str]) -> None:
    """Whatever can stand at a place is offered there, and nothing else."""
    assert set(asked(words)) == answered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_each_shell(shell: str) -> None:
    """Each shell gets the script that asks the program by its variable."""
    text = "\n".join(asked("", f"{shell}_source"))
    assert f"{COMPLETION_VARIABLE}={shell}_complete" in text


def test_completing_commands_loads_nothing() -> None:
    """The names of commands come without their libraries, so that the shell does not wait."""
    code = (
        "import sys; from fedora_qa.cli.main import fedora_qa, LazyGroup; import click;"
        "context = click.Context(fedora_qa);"
        "print(len(fedora_qa.shell_complete(context, '')), 'numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(len(COMMANDS)), "False"]
