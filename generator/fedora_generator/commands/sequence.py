"""``fedora-generate sequence``: one sequence of a scene."""

from pathlib import Path
from typing import Any, get_args

import click

from fedora_generator.choices import DEFAULT_DURATION_S, MOST_SEED, STREAMS, Quality
from fedora_generator.completion import complete_scene, list_completion
from fedora_generator.image_size import read_size


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
