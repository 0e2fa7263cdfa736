"""``fedora-qa compare``: sequences, datasets, or two versions of a release side by side."""

from typing import Any, Final

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

DEFAULT_FALSE_ALARM_RATE: Final = 0.01
"""Of a whole comparison: one in a hundred reports a difference where there is none."""


@click.command()
@click.argument("paths", nargs=-1, required=True, type=PATH, metavar="A B...")
@click.option(
    "--as",
    "design",
    type=click.Choice(["versions", "sequences", "datasets"]),
    help="How to compare them; versions where files have the same names, else sequences or datasets.",
)
@click.option(
    "--false-alarm-rate",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=DEFAULT_FALSE_ALARM_RATE,
    show_default=True,
    help="Probability that the comparison reports any difference where there is none.",
)
@dialect_option
@metadata_option
@memory_option
@allow_external_option
@table_options("json", "html", "markdown", "latex")
def compare(**arguments: Any) -> int:
    """Compare B and the others with A: sequences, folders of them, or records that `check --json` wrote.

    Files are measured; records are read, with the arrays beside them, and their findings compared. Exit codes: 0
    compared, whatever the result; 2 misuse.
    """
    with loading_modules():
        from fedora_qa.cli.compare import run_compare  # noqa: PLC0415 - loads what measures

    return run_compare(**arguments)
