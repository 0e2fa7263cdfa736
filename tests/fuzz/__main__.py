"""``make fuzz``: mutants in worker processes with limits; what should never be is counted, and kept by its number.

    python -m tests.fuzz [--mutants N] [--jobs N] [--first SEED] [--out FOLDER]

A run goes on where the last one in its folder ended. Worker processes are forked for a batch of mutants each, so that
one that dies or hangs costs the rest of no batch: it goes on behind the mutant that did it.
"""

import argparse
import os
import resource
import signal
import sys
from collections import Counter
from dataclasses import asdict
from json import dumps, loads
from pathlib import Path
from typing import Final

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.run import check_file
from tests.fuzz.trial import digests, tried
from tests.support.handmade import write_handmade

BATCH: Final = 200
LONGEST_S: Final = 10
WAITS_S: Final = 120
"""A process that waits takes no processor time."""

MOST_BYTES: Final = 6 << 30
NEVER: Final = ("traceback", "crashed", "wrongly clean", "hang", "death")


def main() -> int:
    """Try mutants and return 1 where one did what none may."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("--mutants", type=int, default=100_000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    seeds = range(given.first, given.first + given.mutants)
    check_file(write_handmade(given.out / "clean.h5"), CheckOptions())  # so that no worker compiles kernels anew
    children = []
    for job in range(given.jobs):
        child = os.fork()
        if child == 0:
            os._exit(_work(seeds[job :: given.jobs], given.out / f"trials-{job}-of-{given.jobs}.jsonl", given.out))
        children.append(child)
    for child in children:
        os.waitpid(child, 0)
    return _summarised(given.out)


def _work(seeds: range, log: Path, out: Path) -> int:
    """Try the mutants of one worker, batch by batch, each in a process of its own."""
    folder = out / log.stem
    folder.mkdir(exist_ok=True)
    clean = write_handmade(folder / "clean.h5")
    content, true = clean.read_bytes(), digests(clean)
    done = {loads(line)["seed"] for line in log.read_text().splitlines()} if log.exists() else set()
    left = [seed for seed in seeds if seed not in done]
    while left:
        child = os.fork()
        if child == 0:
            _limit()
            for seed in left[:BATCH]:
                (folder / "now").write_text(str(seed))
                signal.setitimer(signal.ITIMER_PROF, LONGEST_S)  # processor time: others may use the machine
                signal.alarm(WAITS_S)
                trial = tried(content, true, seed, folder / "mutant.h5")
                signal.setitimer(signal.ITIMER_PROF, 0)
                signal.alarm(0)
                with log.open("a") as file:
                    file.write(dumps(asdict(trial)) + "\n")
            os._exit(0)
        _, status = os.waitpid(child, 0)
        if not os.WIFSIGNALED(status):
            left = left[BATCH:]
            continue
        seed, ended = int((folder / "now").read_text()), os.WTERMSIG(status)
        became = "hang" if ended in {signal.SIGALRM, signal.SIGPROF} else "death"
        (folder / "mutant.h5").replace(folder / f"offender-{seed}.h5")
        with log.open("a") as file:
            file.write(dumps({"seed": seed, "kind": "", "became": became, "said": f"signal {ended}"}) + "\n")
        left = left[left.index(seed) + 1 :]
    return 0


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, sys.stderr.fileno())


def _summarised(out: Path) -> int:
    trials = [loads(line) for log in sorted(out.glob("trials-*.jsonl")) for line in log.read_text().splitlines()]
    for became, count in Counter(trial["became"] for trial in trials).most_common():
        print(f"{count:8d}  {became}")
    seconds = sum(trial.get("seconds", 0.0) for trial in trials)
    print(f"{len(trials):8d}  mutants, {1000 * seconds / max(len(trials), 1):.0f} ms each")
    offenders = [trial for trial in trials if trial["became"] in NEVER]
    for trial in offenders[:20]:
        print(f"{trial['became']}, mutant {trial['seed']} ({trial['kind']}): {trial['said'].strip()[-160:]}")
    return 1 if offenders else 0


if __name__ == "__main__":
    sys.exit(main())
