"""Whether plain conventions of exporters are named: ``python -m tests.benchmarks.conventions.study --help``.

Each convention is written into a copy of one generated sequence, which is then checked. A table states those whose
first diagnosis has another name.
"""

import shutil
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Final

import click
import h5py

from fedora_qa.causes import stream_family
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.benchmarks.conventions.convention import Conventions
from tests.benchmarks.conventions.declarations import CAMERAS, CLOCKS
from tests.benchmarks.conventions.images import COLOUR, DEPTH, EVENTS, FLOW
from tests.benchmarks.conventions.motion import IMU, POSES
from tests.benchmarks.foreign.scenes import Size
from tests.benchmarks.foreign_faults.sources import SPAN_S, Source
from tests.benchmarks.processes import in_processes

CONVENTIONS: Final[Conventions] = MappingProxyType(
    {**POSES, **IMU, **FLOW, **DEPTH, **COLOUR, **EVENTS, **CAMERAS, **CLOCKS}
)
_SIZE: Final = Size(270, 200, 1.0)


@click.command()
@click.option("--scene", type=click.Choice(sorted(SPAN_S)), default="park-day", show_default=True)
@click.option("--seed", default=1, show_default=True, help="Which sequence of the scene.")
@click.option("--processes", default=2, show_default=True)
@click.option("--begins", multiple=True, metavar="TEXT", help="Only conventions whose names begin so.")
def main(scene: str, seed: int, processes: int, begins: tuple[str, ...]) -> None:
    """Write each convention into a copy of a sequence, check it, and list those that have another name."""
    names = [name for name in CONVENTIONS if not begins or name.startswith(begins)]
    with TemporaryDirectory() as folder:
        clean = Path(folder) / "clean.h5"
        Source(scene, seed).write(_SIZE, clean)
        firsts = in_processes(processes, partial(first_diagnosis, clean), names, lambda number, _: None)
    others = [(name, first) for name, first in zip(names, firsts, strict=True) if first not in CONVENTIONS[name].truth]
    click.echo(f"{len(names) - len(others)} of {len(names)} conventions of {scene} are named first.\n")
    click.echo("| convention | right names | first diagnosis |\n| --- | --- | --- |")
    for name, first in others:
        click.echo(f"| {name} | {', '.join(CONVENTIONS[name].truth)} | {first or 'none'} |")


def first_diagnosis(clean: Path, name: str, select: tuple[str, ...] = ()) -> str:
    """Return the stream and the cause that come first where a convention is written into a copy; empty without any.

    ``select`` names the checks that are run, all where it is empty.
    """
    target = clean.with_name(f"{list(CONVENTIONS).index(name)}.h5")
    shutil.copyfile(clean, target)
    try:
        with h5py.File(target, "r+") as file:
            CONVENTIONS[name].change(file)
        diagnoses = check_file(target, CheckOptions(select=select, evidence=None, profile="release")).record.diagnoses
    finally:
        target.unlink()
    return f"{stream_family(diagnoses[0].stream)}:{diagnoses[0].cause}" if diagnoses else ""


if __name__ == "__main__":
    main()
