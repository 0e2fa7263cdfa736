"""Plants real faults by code of its own: ``python -m tests.benchmarks.foreign_faults.study --held-out``, some hours.

How often is a fault found, and does the first diagnosis name it? What was said of a file is kept in out/foreign-faults,
so that an interrupted study goes on where it was; ``--fresh`` forgets it, as it must be after a change to checks or
diagnosis. Without ``--held-out`` the last round of kinds, which is held out, is neither planted nor shown.
"""

import shutil
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final

import click

from tests.benchmarks.foreign.scenes import Size
from tests.benchmarks.foreign_faults.outcome import Outcome, diagnose_planted
from tests.benchmarks.foreign_faults.page import page
from tests.benchmarks.foreign_faults.sources import SEEDS, SPAN_S, Source
from tests.benchmarks.foreign_faults.table import KINDS
from tests.benchmarks.processes import in_processes

ROOT: Final = Path(__file__).parents[3]
KEPT: Final = ROOT / "out" / "foreign-faults"
_BY_NAME: Final = {kind.name: kind for kind in KINDS}


@click.command()
@click.option("--processes", default=2, show_default=True)
@click.option("--held-out", is_flag=True, help="The held-out kinds too.")
@click.option(
    "--scenes", multiple=True, type=click.Choice(tuple(SPAN_S)), help="Only of this scene; may be given several times."
)
@click.option("--seeds", default=SEEDS, show_default=True, help="Sequences of a scene.")
@click.option(
    "--kinds",
    "names",
    multiple=True,
    type=click.Choice(tuple(_BY_NAME)),
    metavar="NAME",
    help="Only this kind; may be given several times.",
)
@click.option("--size", type=(int, int, float), default=(270, 200, 1.0), show_default=True, help="Pixels and seconds.")
@click.option("--fresh", is_flag=True, help="Forget sequences and outcomes of before.")
@click.option("--page", "target", type=click.Path(path_type=Path), help="Write the page here, not to the terminal.")
def main(
    processes: int,
    held_out: bool,
    scenes: tuple[str, ...],
    seeds: int,
    names: tuple[str, ...],
    size: tuple[int, int, float],
    fresh: bool,
    target: Path | None,
) -> None:
    """Plant, check, and write the page."""
    kinds = [kind for kind in KINDS if (held_out or not kind.held_out) and (not names or kind.name in names)]
    sources = [Source(scene, seed) for scene in scenes or SPAN_S for seed in range(seeds)]
    extent = Size(*size)
    folder = KEPT / extent.name
    if fresh:
        shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    needed = dict.fromkeys([*sources, *(source.donor for source in sources)])
    in_processes(processes, partial(_write_clean, folder, extent), needed, lambda number, _: None)
    items = [(kind.name, source) for source, kind in product(sources, kinds) if source.scene in kind.scenes]
    outcomes = in_processes(processes, partial(_diagnose, folder), items, _report)
    text = "".join(page([kind for kind in kinds if any(kind.name == x.kind for x in outcomes)], outcomes, extent))
    if target is None:
        click.echo(text)
    else:
        target.write_text(text, encoding="utf-8")


def _report(number: str, outcome: Outcome) -> None:
    kind = _BY_NAME[outcome.kind]
    first = outcome.diagnoses[0].name if outcome.diagnoses else "nothing"
    right = "right" if outcome.is_first_right(kind) else f"not {' or '.join(kind.truth) or 'named'}"
    place = f"{outcome.kind} {outcome.size:.4g}, {outcome.scene}, seed {outcome.seed}"
    click.echo(f"{number} {place}: {outcome.verdict}; {first}, {right}", err=True)


def _clean_path(folder: Path, source: Source) -> Path:
    return folder / f"{source.scene}-{source.seed}.h5"


def _write_clean(folder: Path, size: Size, source: Source) -> None:
    target = _clean_path(folder, source)
    if not target.exists():
        partial_target = target.with_suffix(".partial")
        source.write(size, partial_target)
        partial_target.rename(target)


def _diagnose(folder: Path, item: tuple[str, Source]) -> Outcome:
    """Plant the kind of that name: functions within functions cannot be sent to a process."""
    name, source = item
    clean, donor = _clean_path(folder, source), _clean_path(folder, source.donor)
    return diagnose_planted(_BY_NAME[name], source, folder, clean, donor)


if __name__ == "__main__":
    main()
