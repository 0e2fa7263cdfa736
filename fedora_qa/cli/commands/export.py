"""``fedora-qa export``: a sequence in a layout of others."""

from typing import Any

import click

from fedora_qa.cli.options import PATH, dialect_option, metadata_option
from fedora_qa.cli.startup import loading_modules


@click.command("export")
@click.argument("source", type=PATH)
@click.argument("output", type=PATH)
@click.option(
    "--to", "form", type=click.Choice(["tum", "dsec"]), required=True, help="tum: a text of poses; dsec: a folder."
)
@dialect_option
@metadata_option
def export(**arguments: Any) -> int:
    """Write SOURCE, a file or folder, in a layout of others to OUTPUT.

    tum writes the poses of the body in the world. dsec writes events, images, flow of 10 Hz, and the calibration of
    pinhole cameras; depth, IMU, poses and other flow have no place there. OUTPUT gets its name when it is complete.

    Exit codes: 0 written; 2 SOURCE cannot be read, or OUTPUT not be written, and nothing is left behind.
    """
    with loading_modules():
        from fedora_qa.cli.export import run_export  # noqa: PLC0415 - loads what measures

    return run_export(**arguments)
