"""``fedora-qa layout``: the streams of a file, their places, and what was inferred."""

from typing import Any

import click

from fedora_qa.cli.options import PATH, allow_external_option, dialect_option, metadata_option
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("file", type=PATH)
@dialect_option
@metadata_option
@click.option("--draft-dialect", "draft_path", type=PATH, metavar="OUT", help="Write a first dialect for the file.")
@allow_external_option
def layout(**arguments: Any) -> int:
    """Describe where FILE, or a folder, keeps each stream, what is absent and why, and what was inferred."""
    with loading_modules():
        from fedora_qa.cli.layout import run_layout  # noqa: PLC0415 - loads what measures

    return run_layout(**arguments)
