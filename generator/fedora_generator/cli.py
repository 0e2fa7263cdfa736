"""``fedora-generate``: sequences whose truth is known."""

import signal
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import cast

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from fedora_generator.corpus.cli import corpus
from fedora_generator.errors import GeneratorError
from fedora_generator.faults.cli import fault
from fedora_generator.generate import DEFAULT_DURATION_S, STREAMS, Request, generate_sequence
from fedora_generator.image_size import read_size
from fedora_generator.instants import whole_us
from fedora_generator.sampling import MOTION_BOUND_PX, Quality
from fedora_generator.scene import list_scenes, load_scene
from fedora_generator.scene_tables import MOST_SEED

MISUSE_EXIT_CODE = 2
INTERRUPT_EXIT_CODE = 130


@click.group(no_args_is_help=False)
@click.version_option(package_name="fedora-qa")
def commands() -> None:
    """Generate event-camera sequences whose truth is known, and plant faults in copies of them."""


@commands.command()
def scenes() -> None:
    """List the scenes of the package, one a line, its name first."""
    package_scenes = list_scenes()
    if sys.stdout.isatty():
        table = Table("scene", "description", box=None)
        for scene in package_scenes:
            table.add_row(scene.name, scene.description)
        Console().print(table)
        return
    width = max(len(scene.name) for scene in package_scenes)
    for scene in package_scenes:
        click.echo(f"{scene.name:<{width}}  {scene.description}")


@commands.command()
@click.argument("scene", metavar="SCENE")
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
@click.option("--streams", default=",".join(STREAMS), show_default=True, metavar="LIST", help="Comma-separated.")
@click.option(
    "--quality",
    default="standard",
    show_default=True,
    type=click.Choice(list(MOTION_BOUND_PX)),
    help="How closely events follow the light: docs/generator.md says what each costs and leaves.",
)
@click.option("--seed", type=click.IntRange(0, MOST_SEED), help="Seed of every noise.  [default: the scene's]")
@click.option("--force", is_flag=True, help="Overwrite the file if it exists.")
def sequence(
    scene: str,
    output: Path,
    start: float | None,
    duration: float | None,
    size: tuple[int, int] | None,
    streams: str,
    quality: str,
    seed: int | None,
    force: bool,
) -> None:
    """Generate one sequence of SCENE, a name of `fedora-generate scenes` or the path of a TOML file."""
    start_time = time.monotonic()
    description = load_scene(scene)
    if start is not None:
        description = description.starting_at(start)
    if duration is None:
        duration = description.remaining_s or DEFAULT_DURATION_S
    if size is not None:
        description = description.with_size(*size)
    if seed is not None:
        description = replace(description, seed=seed)
    request = Request(
        duration_s=duration,
        streams=frozenset(name.strip() for name in streams.split(",") if name.strip()),
        quality=cast(Quality, quality),
    )
    console = Console(stderr=True)
    columns = (BarColumn(), TextColumn("{task.percentage:3.0f}%"), TimeRemainingColumn())
    with Progress("{task.description}", *columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(description.name, total=whole_us(request.duration_s))
        summary = generate_sequence(
            description,
            output,
            request,
            overwrite=force,
            progress=lambda time_us: bar.update(task, completed=time_us),
            warn=lambda message: click.echo(f"Warning: {message}", err=True),
        )
    click.echo(
        f"{output}: {summary.frames} frames, {summary.events} events, {summary.size_bytes / 1e6:.1f} MB "
        f"in {time.monotonic() - start_time:.1f} s",
        err=True,
    )


commands.add_command(fault)
commands.add_command(corpus)


def main() -> None:
    """Entry point: an error that people can act on is one line on stderr and exit code 2."""
    for number in (signal.SIGTERM, signal.SIGHUP):  # so that temporary files are removed
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup has it
            signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        commands.main(prog_name="fedora-generate", standalone_mode=False)
    except click.ClickException as error:
        _fail(error.format_message())
    except GeneratorError as error:
        _fail(str(error))
    except MemoryError as error:
        _fail(f"Expected enough memory, got none left ({error or 'out of memory'}); use a smaller --size")
    except (click.Abort, KeyboardInterrupt):
        click.echo("Interrupted; no file was left that is not whole", err=True)
        sys.exit(INTERRUPT_EXIT_CODE)


def _fail(message: str) -> None:
    click.echo(f"Error: {message}", err=True)
    sys.exit(MISUSE_EXIT_CODE)
