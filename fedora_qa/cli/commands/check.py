"""``fedora-qa check``: check files, write the requested outputs, and print a summary."""

from typing import Any

import click

from fedora_qa.cli.options import (
    PATH,
    allow_external_option,
    config_option,
    detail_options,
    dialect_option,
    ignore_option,
    metadata_option,
    record_options,
    select_option,
)
from fedora_qa.cli.parameters import BudgetParam, PlaceParam
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("files", nargs=-1, required=True, type=PlaceParam())
@click.option(
    "--effort",
    type=click.Choice(["quick", "standard", "full", "exhaustive"]),
    help="How much to look at; full unless configured otherwise.",
)
@click.option(
    "--budget",
    type=BudgetParam(),
    metavar="TIME",
    help="Look at as much as fits into a time such as 60s, 5m or 0.5h, in place of an effort.",
)
@select_option
@ignore_option
@config_option
@dialect_option
@metadata_option
@click.option(
    "--profile",
    type=click.Choice(["release", "training", "strict"]),
    help="From which size a deviation matters: to publish the data (default), to train on them, or any size.",
)
@click.option("--fail-on", type=click.Choice(["failed", "warned"]), help="From which outcome on to exit with 1.")
@click.option(
    "--memory",
    metavar="AMOUNT",
    help="Memory to aim at, of all processes together; a peak may exceed it.  [default: 700MB a job, and 1GB at least]",
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    help="Files, and windows of a file, checked at once; they share the memory.  [default: as many as cores]",
)
@click.option("--dask", metavar="ADDRESS", help="Do the work on a Dask cluster, such as tcp://host:8786.")
@click.option(
    "--resume",
    type=PATH,
    metavar="DIR",
    help="Keep the result of each file in DIR, and check only files without one. Made where it is missing.",
)
@click.option(
    "--canary",
    is_flag=True,
    default=None,
    help="Plant a fault for each check, in memory: a check that does not detect its own is reported as crashed.",
)
@allow_external_option
@detail_options
@record_options
def check(**arguments: Any) -> int:
    """Check FILES, or folders of them: recompute what must hold between their streams, and report what does not.

    Exit codes: 0 clean; 1 findings at or above --fail-on; 2 misuse; 3 incomplete. With several, 2 before 3 before 1.
    """
    with loading_modules():
        from fedora_qa.cli.check import run_check  # noqa: PLC0415 - loads what measures

    return run_check(**arguments)
