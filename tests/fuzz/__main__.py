"""``make fuzz``: mutants in worker processes with limits; what should never be is counted, and kept by its number.

    python -m tests.fuzz [--mutants N] [--first SEED] [--jobs N] [--minutes M] [--out FOLDER]

A run goes on where those before it in its folder ended, with however many jobs. Worker processes are forked warm, with
everything compiled, for a batch of mutants each, so that one that dies or hangs costs the rest of no batch: the next
process goes on behind the mutant that did it, and what it was doing is kept.
"""

import argparse
import faulthandler
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from dataclasses import asdict
from json import dumps
from pathlib import Path
from typing import Final

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.fuzz.by_command import LONGEST_S, by_command
from tests.fuzz.tally import seeds_done, summarised
from tests.fuzz.trial import Trial, digests, offender, tried
from tests.support.handmade import write_handmade

BATCH: Final = 500
WAITS_S: Final = 600
"""A process that waits takes no processor time, nor does one that others leave none."""

MOST_BYTES: Final = 6 << 30
MEMORY: Final = Path("/dev/shm")
"""Where mutants are written, if there is such a folder: a disk is not what is tried."""

HANGS: Final = (signal.SIGALRM, signal.SIGPROF)


def main() -> int:
    """Try mutants and return 1 where one did what none may."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("--mutants", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after so long, to go on another time")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    until = time.monotonic() + 60 * given.minutes
    done = seeds_done(given.out)
    left = [seed for seed in range(given.first, given.first + given.mutants) if seed not in done]
    check_file(write_handmade(given.out / "clean.h5"), CheckOptions(evidence=None))  # no worker compiles anew
    children = []
    for job in range(given.jobs):
        child = os.fork()
        if child == 0:
            with tempfile.TemporaryDirectory(prefix="fuzz-", dir=MEMORY if MEMORY.is_dir() else None) as scratch:
                _work(left[job :: given.jobs], given.out, job, until, Path(scratch))
            os._exit(0)
        children.append(child)
    for child in children:
        os.waitpid(child, 0)
    return summarised(given.out)


def _work(left: list[int], out: Path, job: int, until: float, scratch: Path) -> None:
    """Try the mutants of one worker, batch by batch, each in a process of its own."""
    log, mutant = out / f"trials-{job}.jsonl", scratch / "mutant.h5"
    clean = write_handmade(scratch / "clean.h5")
    content, true = clean.read_bytes(), digests(clean)
    while left and time.monotonic() < until:
        batch = left[:BATCH]
        child = os.fork()
        if child == 0:
            _limit(scratch)
            for seed in batch:
                if time.monotonic() >= until:
                    break
                (scratch / "now").write_text(str(seed))
                signal.setitimer(signal.ITIMER_PROF, LONGEST_S)  # processor time: others may use the machine
                signal.alarm(WAITS_S)
                trial = tried(content, true, seed, mutant, out)
                signal.setitimer(signal.ITIMER_PROF, 0)
                signal.alarm(0)
                _log(log, trial)
            os._exit(0)
        _, status = os.waitpid(child, 0)
        if not os.WIFSIGNALED(status):
            left = left[len(batch) :]
            continue
        seed, ended = int((scratch / "now").read_text()), signal.Signals(os.WTERMSIG(status))
        shutil.copy(mutant, offender(out, seed))
        stack = (scratch / "stack").read_text().partition("Extension modules")[0]
        became = by_command(offender(out, seed)) if ended in HANGS else "death"
        _log(log, Trial(seed, "", became, f"{ended.name}: {stack[:2000]}"))
        left = left[left.index(seed) + 1 :]


def _log(log: Path, trial: Trial) -> None:
    with log.open("a") as file:
        file.write(dumps(asdict(trial)) + "\n")


def _limit(scratch: Path) -> None:
    """Bound a worker, and have it write where it stands when a signal ends it."""
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, sys.stderr.fileno())
    stack = os.open(scratch / "stack", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    faulthandler.enable(stack)
    for number in HANGS:
        faulthandler.register(number, stack, chain=True)


if __name__ == "__main__":
    sys.exit(main())
