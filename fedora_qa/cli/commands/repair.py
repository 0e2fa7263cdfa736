"""``fedora-qa repair``: a copy of a file in which confirmed, mechanical faults are undone."""

from typing import Any

import click

from fedora_qa.cli.options import PATH, config_option, dialect_option, ignore_option, metadata_option, select_option
from fedora_qa.cli.parameters import PlaceParam
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("file", type=PlaceParam())
@click.option("-o", "--output", type=PATH, metavar="OUT", help="The repaired file.")
@click.option("--dry-run", is_flag=True, help="Print what would be done, and write nothing.")
@click.option(
    "--only",
    multiple=True,
    metavar="D1,D2",
    help="Repair these diagnoses, which may be only supported. May be repeated.",
)
@click.option("--effort", type=click.Choice(["quick", "standard", "full", "exhaustive"]), help="As `check` has it.")
@select_option
@ignore_option
@config_option
@dialect_option
@metadata_option
@click.option("--profile", type=click.Choice(["release", "training", "strict"]), help="As `check` has it.")
@click.option("--memory", metavar="AMOUNT", help="Memory to aim at, such as 1GB.")
@click.option("--force", is_flag=True, help="Write over OUT where it exists.")
def repair(**arguments: Any) -> int:
    """Check FILE, undo what is confirmed and mechanical in a copy, check the copy, and keep it if it is better.

    Exit codes: 0 written, or with --dry-run there is something to repair; 1 nothing is confirmed, or the copy is not
    better, and nothing is left behind; 2 misuse.
    """
    with loading_modules():
        from fedora_qa.cli.repair import run_repair  # noqa: PLC0415 - loads what measures

    return run_repair(**arguments)
