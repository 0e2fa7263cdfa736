"""Checks more than a thousand correct files: ``python -m tests.benchmarks.foreign.study --all``, 20 minutes or more.

Writes docs/foreign.md. What the checks said of a file is kept in out/foreign, so that an interrupted study goes on
where it was; ``--fresh`` forgets it, as it must be after a change to the checks. Without ``--all`` the held-out third
is neither checked nor shown, and no page is written.
"""

import shutil
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final

import click

from tests.benchmarks.foreign.checked import Outcome, check_transformed
from tests.benchmarks.foreign.page import page
from tests.benchmarks.foreign.scenes import SCENES, SEEDS, Size, Source
from tests.benchmarks.foreign.table import TRANSFORMATIONS, UNCHANGED
from tests.benchmarks.foreign.transformation import Transformation
from tests.benchmarks.processes import in_processes

ROOT: Final = Path(__file__).parents[3]
TARGET: Final = ROOT / "docs" / "foreign.md"
KEPT: Final = ROOT / "out" / "foreign"
_KINDS: Final = {kind.name: kind for kind in (UNCHANGED, *TRANSFORMATIONS)}


@click.command()
@click.option("--jobs", default=2, show_default=True, help="Processes.")
@click.option("--all", "held_out", is_flag=True, help="The held-out transformations too; writes the page.")
@click.option(
    "--scene", "scenes", multiple=True, type=click.Choice(tuple(SCENES)), help="Only of this scene, for a first look."
)
@click.option("--seeds", default=SEEDS, show_default=True, help="Sequences of a scene.")
@click.option(
    "--kind",
    "names",
    multiple=True,
    type=click.Choice(tuple(_KINDS)),
    metavar="NAME",
    help="Only this transformation, for a first look.",
)
@click.option("--size", type=(int, int, float), default=(270, 200, 1.0), show_default=True, help="Pixels and seconds.")
@click.option("--fresh", is_flag=True, help="Forget sequences and outcomes of before.")
def main(
    jobs: int,
    held_out: bool,
    scenes: tuple[str, ...],
    seeds: int,
    names: tuple[str, ...],
    size: tuple[int, int, float],
    fresh: bool,
) -> None:
    """Check them all; with --all alone, write docs/foreign.md."""
    kinds = [kind for kind in _KINDS.values() if (held_out or not kind.held_out) and (not names or kind.name in names)]
    sources = [Source(scene, seed) for scene in scenes or SCENES for seed in range(seeds)]
    extent = Size(*size)
    folder = KEPT / extent.name
    if fresh:
        shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    in_processes(jobs, partial(_write_clean, extent), sources, lambda number, _: None)
    items = [(kind.name, source) for source, kind in product(sources, kinds)]
    outcomes = in_processes(jobs, partial(_check, extent), items, _report)
    text = "".join(page(kinds, outcomes, extent))
    if held_out and not scenes and not names and seeds == SEEDS and extent == Size():
        TARGET.write_text(text, encoding="utf-8")
    click.echo(text)


def _report(number: str, outcome: Outcome) -> None:
    place = f"{outcome.transformation}, {outcome.scene}, seed {outcome.seed}"
    click.echo("\n  ".join((f"{number} {place}: {outcome.verdict}", *outcome.alarms)), err=True)


def _clean_path(size: Size, source: Source) -> Path:
    return KEPT / size.name / f"{source.scene}-{source.seed}.h5"


def _write_clean(size: Size, source: Source) -> None:
    target = _clean_path(size, source)
    if not target.exists():
        source.write(size, target)


def _check(size: Size, item: tuple[str, Source]) -> Outcome:
    """Check the transformation of that name: functions within functions cannot be sent to a process."""
    name, source = item
    transformation: Transformation = _KINDS[name]
    return check_transformed(transformation, source, KEPT / size.name, _clean_path(size, source))


if __name__ == "__main__":
    main()
