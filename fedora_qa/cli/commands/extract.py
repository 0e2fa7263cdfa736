"""``fedora-qa extract``: the smallest file that shows a finding, to be sent to somebody."""

from typing import Any, Final

import click

from fedora_qa.cli.options import PATH, allow_external_option
from fedora_qa.cli.parameters import complete_dialect
from fedora_qa.cli.startup import loading_modules

LONGEST_S: Final = 20.0
"""Default length of the longest piece that is tried, s: its file is still small enough to be sent."""


@click.command()
@click.argument("file", type=PATH)
@click.argument("finding")
@click.option("-o", "--output", required=True, type=PATH, metavar="OUT", help="The small file.")
@click.option(
    "--record", "record_path", type=PATH, metavar="RECORD", help="Where FINDING stands; else FILE is checked."
)
@click.option(
    "--longest",
    "longest_s",
    type=click.FloatRange(min=0, min_open=True),
    default=LONGEST_S,
    show_default=True,
    metavar="SECONDS",
    help="The longest piece to try.",
)
@click.option("--effort", type=click.Choice(["quick", "standard", "full", "exhaustive"]), help="As `check` had it.")
@click.option("--config", type=PATH, help="As `check` had it.")
@click.option("--dialect", metavar="NAME|FILE.toml", shell_complete=complete_dialect, help="As `check` had it.")
@allow_external_option
@click.option("--force", is_flag=True, help="Write over OUT where it exists.")
def extract(**arguments: Any) -> int:
    """Write the part of FILE around the place of FINDING, such as F1, and check that it still shows the finding.

    Pieces are tried from short to long. Exit codes: 0 written, and the finding is in it; 2 misuse; 3 written, and the
    finding is not in it.
    """
    with loading_modules():
        from fedora_qa.cli.extract import run_extract  # noqa: PLC0415 - loads what measures

    return run_extract(**arguments)
