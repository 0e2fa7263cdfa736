"""A run that is interrupted, killed, or meets a full disk leaves no file that looks whole."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from fedora_generator.corpus.manifest import MANIFEST
from tests.generator.tiny_sequence import write_tiny_sequence

TINY = ("--size", "72x54", "--quality", "draft")

EXIT_CODES = {"SIGINT": 130, "SIGTERM": 143, "SIGHUP": 129, "SIGKILL": -signal.SIGKILL, "limit": 2}
WORDS = {"SIGINT": "no file was left that is not whole", "limit": "got a full disk"}

Runs = list[dict[str, Any]]


def cut_short(how: str, folder: Path, *arguments: str) -> Runs:
    """Runs in folders of their own beneath ``folder``, the first one left alone."""
    command = [sys.executable, "-m", "tests.generator.cut_short", how, str(folder), *arguments]
    environment = os.environ | {"NUMBA_THREADING_LAYER": "workqueue", "NUMBA_NUM_THREADS": "1"}  # it can be forked
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment, timeout=300)
    found: Runs = json.loads(done.stdout)
    return found


def files(folder: Path) -> dict[str, bytes]:
    """What has a name that can be seen, by path beneath the folder."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in found if ".partial" not in path.name}


def require_whole_or_absent(folder: Path, runs: Runs) -> None:
    """A run that ended before its time says so; each file that it left is that of the run left alone."""
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


def test_a_sequence_is_whole_or_absent(tmp_path: Path) -> None:
    """Whenever a signal comes and wherever the disk is full; exit code, one line, and no crash at the end of it."""
    runs = cut_short("often", tmp_path, "sequence", "park-day", "-o", "{out}/a.h5", "--duration", "0.2", *TINY)
    require_whole_or_absent(tmp_path, runs)


def test_a_faulty_copy_is_whole_or_absent(tmp_path: Path) -> None:
    """Likewise while a fault is planted."""
    clean = tmp_path / "clean.h5"
    write_tiny_sequence(clean)
    runs = cut_short("seldom", tmp_path, "fault", str(clean), "wrong_dtype", "--stream", "flow", "-o", "{out}/a.h5")
    require_whole_or_absent(tmp_path, runs)


def test_a_corpus_is_whole_or_has_no_manifest(tmp_path: Path) -> None:
    """Likewise each of its files."""
    arguments = ("corpus", "-o", "{out}", "--scenes", "park-day", "--clean", "1", "--causes", "gyro_bias", *TINY)
    runs = cut_short("seldom", tmp_path, *arguments, "--duration", "0.1")
    require_whole_or_absent(tmp_path, runs)
