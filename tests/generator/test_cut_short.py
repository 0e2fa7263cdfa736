"""A run that is interrupted, killed, or meets a full disk leaves no file that looks whole."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from fedora_generator.corpus.manifest import MANIFEST
from tests.generator.tiny_sequence import write_tiny_sequence

TINY = ("--size", "72x54", "--quality", "draft")

EXIT_CODES = {"SIGINT": 130, "SIGTERM": 143, "SIGHUP": 129, "SIGKILL": -signal.SIGKILL, "limit": 2}
WORDS = {"SIGINT": "no file was left that is not whole", "limit": "got a full disk"}

Runs = list[dict[str, Any]]


@dataclass(frozen=True)
class CutShort:
    """A command, and its runs in folders of their own beneath ``folder``, the first one left alone."""

    folder: Path
    runs: Runs


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> dict[str, CutShort]:
    """Each command, run again and again by one process."""
    base = tmp_path_factory.mktemp("cut-short")
    clean = base / "clean.h5"
    write_tiny_sequence(clean)
    sequence = ["sequence", "park-day", "-o", "{out}/a.h5", "--duration", "0.1", *TINY]
    fault = ["fault", str(clean), "wrong_dtype", "--stream", "flow", "-o", "{out}/a.h5"]
    corpus = ["corpus", "-o", "{out}", "--scenes", "park-day", "--clean", "1", "--causes", "gyro_bias", *TINY]
    how = {
        "sequence": ("often", sequence),
        "fault": ("seldom", fault),
        "corpus": ("seldom", [*corpus, "--duration", "0.1"]),
    }
    asked = []
    for name, (often, arguments) in how.items():
        (base / name).mkdir()
        asked.append([often, str(base / name), arguments])
    command = [sys.executable, "-m", "tests.generator.cut_short"]
    environment = os.environ | {"NUMBA_NUM_THREADS": "1"}  # without threads it can be forked
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, env=environment, timeout=300, input=json.dumps(asked)
    )
    return {name: CutShort(base / name, runs) for name, runs in zip(how, json.loads(done.stdout), strict=True)}


def files(folder: Path) -> dict[str, bytes]:
    """What has a name that can be seen, by path beneath the folder."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in found if ".partial" not in path.name}


def require_whole_or_absent(command: CutShort) -> None:
    """A run that ended before its time says so; each file that it left is that of the run left alone."""
    folder, runs = command.folder, command.runs
    alone = files(folder / runs[0]["folder"])
    assert runs[0]["exit_code"] == 0
    cut = set()
    for run in runs[1:]:
        left, stopped_by = files(folder / run["folder"]), run["stopped_by"]
        sequences = {name for name in left if name.endswith(".h5")}
        assert all(left[name] == alone[name] for name in sequences), run
        assert (MANIFEST in left) <= (left == alone), run
        if sequences != {name for name in alone if name.endswith(".h5")}:
            cut.add(stopped_by)
            assert run["exit_code"] == EXIT_CODES[stopped_by], run
            assert WORDS.get(stopped_by, "") in run["stderr"], run
            assert run["stderr"].strip().count("\n") == 0, run
        if stopped_by != "SIGKILL":
            assert not list((folder / run["folder"]).rglob(".*")), run
    assert "limit" in cut


def test_a_sequence_is_whole_or_absent(commands: dict[str, CutShort]) -> None:
    """Whenever a signal comes and wherever the disk is full; exit code, one line, and no crash at the end of it."""
    require_whole_or_absent(commands["sequence"])


def test_a_faulty_copy_is_whole_or_absent(commands: dict[str, CutShort]) -> None:
    """Likewise while a fault is planted."""
    require_whole_or_absent(commands["fault"])


def test_a_corpus_is_whole_or_has_no_manifest(commands: dict[str, CutShort]) -> None:
    """Likewise each of its files."""
    require_whole_or_absent(commands["corpus"])
