"""What the mutants of all runs came to: by kind, and those that did what none may."""

from collections import Counter
from json import loads
from pathlib import Path
from typing import Any, Final

NEVER: Final = ("traceback", "crashed", "wrongly clean", "hang", "death")


def seeds_done(out: Path) -> set[int]:
    """Return the numbers of the mutants that were tried, by any run."""
    return {trial["seed"] for trial in _trials(out)}


def summarised(out: Path) -> int:
    """Print the tally as a table of markdown, then the offenders; return 1 where there is one."""
    trials = _trials(out)
    kinds, became = sorted({one["kind"] for one in trials}), [*dict.fromkeys(one["became"] for one in trials)]
    counts = Counter((one["kind"], one["became"]) for one in trials)
    print(f"| kind | {' | '.join(became)} |\n| --- |{' --- |' * len(became)}")
    for kind in kinds:
        print(f"| {kind or '(ended by a signal)'} | {' | '.join(str(counts[kind, one]) for one in became)} |")
    seeds = [one["seed"] for one in trials]
    milliseconds = 1000 * sum(one["seconds"] for one in trials) / max(len(trials), 1)
    print(f"{len(trials)} mutants of {min(seeds, default=0)} to {max(seeds, default=0)}, {milliseconds:.0f} ms each")
    offenders = [one for one in trials if one["became"] in NEVER]
    for one in offenders:
        print(f"{one['became']}, mutant {one['seed']} ({one['kind']}): {one['said'].strip()[-300:]}")
    return 1 if offenders else 0


def _trials(out: Path) -> list[dict[str, Any]]:
    lines = [line for log in sorted(out.glob("trials-*.jsonl")) for line in log.read_text().splitlines()]
    return [loads(line) for line in lines]
