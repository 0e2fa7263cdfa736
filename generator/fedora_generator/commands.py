"""The commands of ``fedora-generate`` with their arguments and help. Each imports its work when it runs.

Arguments are sizes, regions and lists of names, which shells complete. A shell waits for completion at every key: this
file loads nothing that draws.
"""

import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, get_args

import click
from click.shell_completion import CompletionItem

from fedora_generator.choices import DEFAULT_DURATION_S, MOST_SEED, SCENE_NAMES, STREAMS, Quality, scene_descriptions
from fedora_qa.causes import CAUSES

CAUSE_NAMES = tuple(cause for cause in CAUSES if cause != "unknown")
"""Causes that can be planted."""

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def read_size(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int] | None:
    """Read ``WIDTHxHEIGHT``, px.

    Raises
    ------
    click.BadParameter
        Not two whole numbers with an x between.
    """
    if value is None:
        return None
    match = re.fullmatch(r"([0-9]{1,6})x([0-9]{1,6})", value, flags=re.IGNORECASE)
    if match is None:
        raise click.BadParameter(f"Expected WIDTHxHEIGHT such as 720x540, got {value!r}")
    return int(match[1]), int(match[2])


def read_region(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int, int, int] | None:
    """Read ``x0,y0,x1,y1``."""
    if value is None:
        return None
    match = re.fullmatch(r"([0-9]{1,6}),([0-9]{1,6}),([0-9]{1,6}),([0-9]{1,6})", value)
    if match is None:
        raise click.BadParameter(f"Expected x0,y0,x1,y1 such as 0,0,320,240, got {value!r}")
    left, top, right, bottom = (int(digits) for digits in match.groups())
    return left, top, right, bottom


def read_list(_: click.Context, __: click.Parameter, value: str) -> tuple[str, ...]:
    """Read names with commas between."""
    return tuple(dict.fromkeys(name.strip() for name in value.split(",") if name.strip()))


def complete_scene(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the scenes that begin so, and leave files of scenes to the shell."""
    return [*_beginning(SCENE_NAMES, incomplete), CompletionItem(incomplete, type="file")]


def complete_cause(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the causes that begin so."""
    return _beginning(CAUSE_NAMES, incomplete)


def complete_stream(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the streams that begin so, of those that the cause on the command line can befall."""
    # click parses no arguments behind an option that still lacks its value, and leaves them in `args`.
    names = (str(context.params.get("cause")), *context.args)
    streams = next((CAUSES[name].streams for name in names if name in CAUSES), STREAMS)
    return _beginning(streams, incomplete)


def list_completion(names: Sequence[str]) -> Complete:
    """Return what completes the last of several names with commas between."""

    def complete(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
        before, comma, last = incomplete.rpartition(",")
        return [CompletionItem(before + comma + item.value) for item in _beginning(names, last)]

    return complete


def _beginning(names: Sequence[str], incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(name) for name in names if name.startswith(incomplete)]


DEFAULT_SCENES: Final = "park-day,fast-turn,park-noisy"


@click.command()
def scenes() -> None:
    """List the scenes of the package, one a line, its name first."""
    descriptions = scene_descriptions()
    if sys.stdout.isatty():
        from rich.console import Console  # noqa: PLC0415 - other commands need none of it
        from rich.table import Table  # noqa: PLC0415

        table = Table("scene", "description", box=None)
        for name, description in descriptions.items():
            table.add_row(name, description)
        Console().print(table)
        return
    width = max(map(len, descriptions))
    for name, description in descriptions.items():
        click.echo(f"{name:<{width}}  {description}")


@click.command()
@click.argument("scene", metavar="SCENE", shell_complete=complete_scene)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="The file to write.")
@click.option(
    "--start", type=float, metavar="S", help="Seconds into the flight, where stamps are 0.  [default: the scene's]"
)
@click.option(
    "--duration",
    type=float,
    metavar="S",
    help=f"Seconds.  [default: to the end of the flight; {DEFAULT_DURATION_S:g} where it has none]",
)
@click.option(
    "--size",
    metavar="WxH",
    callback=read_size,
    help="Size of RGB and depth; events scale by 640/1440.  [default: 1440x1080]",
)
@click.option(
    "--streams",
    default=",".join(STREAMS),
    show_default=True,
    metavar="LIST",
    shell_complete=list_completion(STREAMS),
    help="Comma-separated.",
)
@click.option(
    "--quality",
    default="standard",
    show_default=True,
    type=click.Choice(get_args(Quality)),
    help="How closely events follow the light: docs/generator.md says what each costs and leaves.",
)
@click.option("--seed", type=click.IntRange(0, MOST_SEED), help="Seed of every noise.  [default: the scene's]")
@click.option("--force", is_flag=True, help="Overwrite the file if it exists.")
def sequence(**arguments: Any) -> None:
    """Generate one sequence of SCENE, a name of `fedora-generate scenes` or the path of a TOML file."""
    from fedora_generator.sequence import run_sequence  # noqa: PLC0415 - loads what renders

    run_sequence(**arguments)


@click.command(epilog=f"Causes: {', '.join(CAUSE_NAMES)}.")
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("cause", shell_complete=complete_cause)
@click.option(
    "--stream",
    shell_complete=complete_stream,
    help="Stream that the fault befalls; events, or the only one that it can befall.",
)
@click.option("--magnitude", type=float, help="Size; positive is too late, or too large. Needed where it has a unit.")
@click.option("--unit", help="Unit of the magnitude; for a time ms unless given.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="For what is placed at random.")
@click.option("--start", "start_s", type=float, help="Confine the fault: seconds after the file's first stamp.")
@click.option("--stop", "stop_s", type=float, help="End of the confinement, not included.")
@click.option(
    "--region",
    callback=read_region,
    metavar="X0,Y0,X1,Y1",
    help="Confine the fault to this part of the image, the last column and row not included.",
)
@click.option(
    "--direction", "direction_deg", type=float, help="Of a shift of rgb or flow: degrees, clockwise from right."
)
@click.option("--donor", type=click.Path(path_type=Path), help="The file that other_sequence takes the stream from.")
@click.option("--stale-maps", is_flag=True, help="Leave the index maps as they were before the fault.")
@click.option("--force", is_flag=True, help="Replace the output if it exists.")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="The faulty copy.")
def fault(**arguments: Any) -> None:
    """Plant CAUSE in a copy of FILE."""
    from fedora_generator.faults.cli import run_fault  # noqa: PLC0415 - loads what reads and writes files

    run_fault(**arguments)


@click.command()
@click.option("-o", "--output", "folder", required=True, type=click.Path(path_type=Path), help="The folder to fill.")
@click.option(
    "--scenes",
    default=DEFAULT_SCENES,
    show_default=True,
    callback=read_list,
    metavar="LIST",
    shell_complete=list_completion(SCENE_NAMES),
)
@click.option("--clean", default=2, show_default=True, type=click.IntRange(min=1), help="Clean sequences a scene.")
@click.option(
    "--causes",
    default="",
    callback=read_list,
    metavar="LIST",
    shell_complete=list_completion(CAUSE_NAMES),
    help="Causes, or STREAM:CAUSE.  [default: all]",
)
@click.option("--ladder", default=3, show_default=True, type=click.IntRange(1, 15), help="Magnitudes of each fault.")
@click.option("--size", default="270x200", show_default=True, callback=read_size, metavar="WxH")
@click.option("--duration", "duration_s", default=1.0, show_default=True, metavar="S", help="Seconds of a sequence.")
@click.option("--quality", default="draft", show_default=True, type=click.Choice(get_args(Quality)))
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0), help="First seed of each scene.")
@click.option("--trials", type=click.IntRange(0, 10_000), default=0, metavar="N", help="Draw N magnitudes, no ladder.")
@click.option(
    "--deep",
    default="",
    callback=read_list,
    metavar="LIST",
    shell_complete=list_completion(CAUSE_NAMES),
    help="Causes that get more trials.",
)
@click.option("--deep-trials", default=60, show_default=True, type=click.IntRange(1, 10_000), help="How many.")
@click.option("--spread", is_flag=True, help="Begin the sequences of a scene at different places of its flight.")
@click.option("--off-grid", is_flag=True, help="Draw sizes, directions, times and regions of trials at random.")
@click.option("--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Files that are made at once.")
@click.option("--dry-run", is_flag=True, help="Print what would be made, and make nothing.")
@click.option("--force", is_flag=True, help="Write into a folder that holds something else.")
def corpus(**arguments: Any) -> None:
    """Make clean sequences of several scenes, and copies of them with every fault in several sizes.

    Run again after an interrupt, it goes on where it was.
    """
    from fedora_generator.corpus.cli import run_corpus  # noqa: PLC0415 - loads what renders

    run_corpus(**arguments)
