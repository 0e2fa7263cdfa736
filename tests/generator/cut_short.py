"""Runs ``fedora-generate`` again and again, each time stopped by a signal or by a limit of the file size.

``python -m tests.generator.cut_short`` imports once and forks for each run. From standard input it reads one JSON
document, a list of commands: how often each is stopped (``often``, ``seldom``), a folder, and its arguments. Each run
has a folder of its own beneath that one; the word ``{out}`` in an argument stands for it. Prints one JSON document: for
each command a list of runs.
"""

import json
import os
import resource
import signal
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from fedora_generator.cli import main

Stops = tuple[tuple[signal.Signals, float], ...]
"""Which signal comes when, as a share of the time that a run takes that is left alone."""

STOPS: Final[dict[str, Stops]] = {
    "often": (
        *((signal.SIGINT, share) for share in (0.1, 0.5, 0.9)),
        *((signal.SIGTERM, 0.4), (signal.SIGHUP, 0.6)),
        *((signal.SIGKILL, share) for share in (0.3, 0.7)),
    ),
    "seldom": ((signal.SIGINT, 0.3), (signal.SIGKILL, 0.6)),
}

SHARES_OF_SIZE: Final = {"often": (0.1, 0.6, 0.95), "seldom": (0.6,)}
"""Largest size that a file may have, of that of the whole one: EFBIG, which is to a program what a full disk is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """How one run ended: what stopped it, its exit code (negative: that signal), its words, and what it left."""

    stopped_by: str
    exit_code: int
    stderr: str
    folder: str


def run(folder: Path, arguments: list[str], *, stop: int = 0, after_s: float = 0.0, most_bytes: int = 0) -> Run:
    """Run once in a fork."""
    folder.mkdir()
    words = folder.with_suffix(".stderr")
    ready, started = os.pipe()
    child = os.fork()
    if child == 0:
        _be_the_program(folder, arguments, words, started, most_bytes)
    os.close(started)
    os.read(ready, 1)
    os.close(ready)
    if stop:
        time.sleep(after_s)
        os.kill(child, stop)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    stopped_by = signal.Signals(stop).name if stop else "limit" if most_bytes else "nothing"
    return Run(stopped_by=stopped_by, exit_code=status, stderr=words.read_text(), folder=folder.name)


def _be_the_program(folder: Path, arguments: list[str], words: Path, started: int, most_bytes: int) -> None:
    """Never returns."""
    os.dup2(os.open(words, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
    if most_bytes:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))
    os.write(started, b"x")
    sys.exit(_generate(folder, arguments))


def _generate(folder: Path, arguments: list[str]) -> int:
    sys.argv = ["fedora-generate", *(argument.format(out=folder) for argument in arguments)]
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def _largest_file(folder: Path) -> int:
    return max(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def cut_short(how: str, folder: Path, arguments: list[str]) -> list[Run]:
    """Run once here, so that each fork finds everything compiled; once left alone; then cut short each time."""
    for name in ("warm", "timed"):
        (folder / name).mkdir()
        begun = time.monotonic()
        _generate(folder / name, arguments)
    alone_s, size = time.monotonic() - begun, _largest_file(folder / "timed")
    runs = [run(folder / "alone", arguments)]
    for stop, share in STOPS[how]:
        runs.append(run(folder / f"{stop.name}-{share}", arguments, stop=stop, after_s=share * alone_s))
    for share in SHARES_OF_SIZE[how]:
        runs.append(run(folder / f"limit-{share}", arguments, most_bytes=round(share * size)))
    return runs


if __name__ == "__main__":
    commands = json.load(sys.stdin)
    print(json.dumps([[asdict(each) for each in cut_short(how, Path(folder), rest)] for how, folder, rest in commands]))
