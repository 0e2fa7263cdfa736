"""``fedora-generate corpus``: clean and faulty sequences, and the manifest that lists which is which."""

from pathlib import Path
from typing import Any, Final, get_args

import click

from fedora_generator.choices import Quality
from fedora_generator.completion import CAUSE_NAMES, list_completion
from fedora_generator.image_size import read_size
from fedora_generator.scene_names import SCENE_NAMES

DEFAULT_SCENES: Final = "park-day,fast-turn,park-noisy"


def _read_list(_: click.Context, __: click.Parameter, value: str) -> tuple[str, ...]:
    """Read names with commas between."""
    return tuple(dict.fromkeys(name.strip() for name in value.split(",") if name.strip()))


@click.command()
@click.option("-o", "--output", "folder", required=True, type=click.Path(path_type=Path), help="The folder to fill.")
@click.option(
    "--scenes",
    default=DEFAULT_SCENES,
    show_default=True,
    callback=_read_list,
    metavar="LIST",
    shell_complete=list_completion(SCENE_NAMES),
)
@click.option("--clean", default=2, show_default=True, type=click.IntRange(min=1), help="Clean sequences a scene.")
@click.option(
    "--causes",
    default="",
    callback=_read_list,
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
    callback=_read_list,
    metavar="LIST",
    shell_complete=list_completion(CAUSE_NAMES),
    help="Causes that get more trials.",
)
@click.option("--deep-trials", default=60, show_default=True, type=click.IntRange(1, 10_000), help="How many.")
@click.option("--spread", is_flag=True, help="Begin the sequences of a scene at different places of its flight.")
@click.option("--off-grid", is_flag=True, help="Draw sizes, directions, times and regions of trials at random.")
@click.option("--dry-run", is_flag=True, help="Print what would be made, and make nothing.")
@click.option("--force", is_flag=True, help="Write into a folder that holds something else.")
def corpus(**arguments: Any) -> None:
    """Make clean sequences of several scenes, and copies of them with every fault in several sizes.

    Run again after an interrupt, it goes on where it was.
    """
    from fedora_generator.corpus.cli import run_corpus  # noqa: PLC0415 - loads what renders

    run_corpus(**arguments)
