"""A way to run the command line inside a test, and files for it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from fedora_qa.cli.main import run
from tests.support.handmade import write_handmade


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command left behind."""

    code: int
    out: str
    err: str


Command = Callable[..., Outcome]


@pytest.fixture
def fedora_qa(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run ``fedora-qa`` with arguments, as when it is piped."""
    for variable in ("FORCE_COLOR", "COLUMNS", "FEDORA_QA_TRACEBACK"):
        monkeypatch.delenv(variable, raising=False)

    def command(*arguments: str | Path) -> Outcome:
        code = run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return command


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    """A small clean file of this test's own."""
    return write_handmade(tmp_path / "seq.h5")
