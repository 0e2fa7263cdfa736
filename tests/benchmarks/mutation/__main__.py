"""Change estimators and judgement at random places and see whether their unit tests notice: ``make mutation``.

Writes docs/mutation.md. Each mutant lives in a copy of the tree; the tree itself is never touched. What was seen of a
survivor stands in ``notes.toml`` beside this file, by its place and change.
"""

import os
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal

import click

from tests.benchmarks.mutation.mutants import Mutant, changed_line, drawn, mutants_of
from tests.benchmarks.mutation.unit_tests import modules, unit_tests_of

ROOT: Final = Path(__file__).parents[3]
TARGET: Final = ROOT / "docs" / "mutation.md"
NOTES: Final = Path(__file__).with_name("notes.toml")
COPIED: Final = ("fedora_qa", "generator", "reports", "tests", "pyproject.toml")

Fate = Literal["killed", "timed out", "survived"]

HEAD: Final = """\
# Do the unit tests detect small changes?

Written by `make mutation`, {date}. There are {of} possible small changes of the estimators and of judgement: a
comparison reversed, a number off by one, an operator exchanged, a condition negated, a loop left out. {count} were
drawn at random (seed {seed}). For each, the unit tests of both packages that can reach the module were run. {killed}
changes were detected, {timed_out} never ended, and {survived} were not detected ({share:.0%} detected). Compiled
kernels are left out, because each change would have to be compiled again.

"""


@dataclass(frozen=True, slots=True)
class Tried:
    """A mutant, the line before and after, and what became of it."""

    mutant: Mutant
    before: str
    after: str
    fate: Fate

    @property
    def place(self) -> str:
        """File and line, from the root."""
        return f"{self.mutant.module.relative_to(ROOT)}:{self.mutant.line}"


@click.command()
@click.option("--mutants", "count", default=100, show_default=True, help="How many to draw.")
@click.option("--seed", default=1, show_default=True, help="Of the draw.")
@click.option("--minutes", default=30.0, show_default=True, help="Time after which no further mutant is begun.")
@click.option("--each", "limit_s", default=300.0, show_default=True, help="Seconds that the tests of one may take.")
def main(count: int, seed: int, minutes: float, limit_s: float) -> None:
    """Try a sample and write the page."""
    every = [mutant for module in modules(ROOT) for mutant in mutants_of(module)]
    stop = time.monotonic() + 60 * minutes
    tried: list[Tried] = []
    with TemporaryDirectory(prefix="mutation-") as folder:
        copy = Path(folder)
        for part in COPIED:
            source = ROOT / part
            (shutil.copytree if source.is_dir() else shutil.copy2)(source, copy / part)
        for mutant in drawn(every, count, seed):
            if time.monotonic() > stop:
                break
            tried.append(_try(mutant, copy, limit_s))
            click.echo(f"{tried[-1].fate:9} {tried[-1].place}  {tried[-1].before}  ->  {tried[-1].after}", err=True)
    TARGET.write_text(_page(tried, len(every), seed), encoding="utf-8")


def _try(mutant: Mutant, copy: Path, limit_s: float) -> Tried:
    """Run the tests that reach a mutant in the copy of the tree, and undo it there."""
    relative = mutant.module.relative_to(ROOT)
    source = mutant.module.read_text(encoding="utf-8")
    changed = mutant.code(source)
    tests = [str(path.relative_to(ROOT)) for path in unit_tests_of(mutant.module, ROOT)]
    (copy / relative).write_text(changed, encoding="utf-8")
    try:
        fate = _fate(tests, copy, limit_s) if tests else "survived"
    finally:
        shutil.copy2(mutant.module, copy / relative)
    return Tried(mutant, *changed_line(source, changed), fate)


def _fate(tests: Sequence[str], copy: Path, limit_s: float) -> Fate:
    paths = os.pathsep.join(str(copy / part) for part in (".", "generator", "reports"))
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(
            command,
            cwd=copy,
            env={**os.environ, "PYTHONPATH": paths},
            capture_output=True,
            timeout=limit_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "timed out"
    return "survived" if done.returncode == 0 else "killed"


def _page(tried: Sequence[Tried], of: int, seed: int) -> str:
    fates = [result.fate for result in tried]
    survived = sorted((result for result in tried if result.fate == "survived"), key=lambda result: result.place)
    head = HEAD.format(
        date=datetime.now(UTC).date().isoformat(),
        of=of,
        count=len(tried),
        seed=seed,
        killed=fates.count("killed"),
        timed_out=fates.count("timed out"),
        survived=len(survived),
        share=1 - len(survived) / max(len(tried), 1),
    )
    notes = tomllib.loads(NOTES.read_text(encoding="utf-8"))
    rows = [
        f"| {result.place} | `{_cell(result.before)}` | `{_cell(result.after)}` | {_note(result, notes)} |"
        for result in survived
    ]
    table = ["| change that was not detected | before | after | assessment |", "| --- | --- | --- | --- |", *rows]
    return head + ("\n".join(table) if rows else "All changes were detected.") + "\n"


def _note(result: Tried, notes: dict[str, str]) -> str:
    return notes.get(f"{result.mutant.module.stem}: {result.after}", "not yet")


def _cell(line: str) -> str:
    return line.replace("|", "\\|").replace("`", "'")


if __name__ == "__main__":
    main()
