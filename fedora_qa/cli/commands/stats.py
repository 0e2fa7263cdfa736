"""``fedora-qa stats``: the sequence and flow tables of the paper, and tables of images and rates."""

from typing import Any

import click

from fedora_qa.cli.options import (
    PATH,
    allow_external_option,
    dialect_option,
    memory_option,
    metadata_option,
    table_options,
)
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("files", nargs=-1, required=True, type=PATH)
@dialect_option
@metadata_option
@memory_option
@allow_external_option
@table_options("json", "markdown", "latex")
def stats(**arguments: Any) -> int:
    """Print statistics of FILES or folders: duration, distance, greatest speeds, event rate, flow, depth, light."""
    with loading_modules():
        from fedora_qa.cli.stats import run_stats  # noqa: PLC0415 - loads what measures

    return run_stats(**arguments)
