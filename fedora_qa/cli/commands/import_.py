"""``fedora-qa import``: a canonical file from a recording."""

from typing import Any

import click

from fedora_qa.cli.options import PATH
from fedora_qa.cli.parameters import ResolutionParam
from fedora_qa.cli.startup import loading_modules


@click.command("import")
@click.argument("source", type=PATH)
@click.option("-o", "--output", type=PATH, required=True, metavar="OUT.h5", help="The canonical file.")
@click.option(
    "--resolution", type=ResolutionParam(), metavar="WxH", help="Size of the event camera, where SOURCE lacks it."
)
@click.option(
    "--topics", type=PATH, metavar="FILE.toml", help="Which topic of a bag holds which stream, in a table [topics]."
)
@click.option("--kind", type=click.Choice(["recorded", "synthetic"]), help="Whether sensors made SOURCE.")
@click.option("--allow-backwards", is_flag=True, help="Write timestamps that decrease as they are.")
@click.option(
    "--compression",
    type=click.IntRange(1, 9),
    default=2,
    show_default=True,
    metavar="LEVEL",
    help="Of Zstandard: 1 is the fastest, 9 makes the smallest file.",
)
@click.option("--force", is_flag=True, help="Write over OUT.h5 where it exists.")
def import_(**arguments: Any) -> int:
    """Write a canonical file from SOURCE, a recording in a format of event cameras.

    SOURCE is a Prophesee recording (EVT2, EVT3 or DAT), AEDAT 4.0, or a bag of ROS 1 or ROS 2. It is only read, in
    blocks. OUT.h5 gets its name when it is complete.

    Exit codes: 0 written; 2 SOURCE cannot be read, or OUT.h5 not be written, and nothing is left behind.
    """
    with loading_modules():
        from fedora_qa.cli.import_ import run_import  # noqa: PLC0415 - loads what measures

    return run_import(**arguments)
