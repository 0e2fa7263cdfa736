"""``fedora-qa report``: render a record again, without the data."""

from typing import Any

import click

from fedora_qa.cli.options import PATH, detail_options, output_options
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("record_path", metavar="RECORD", type=PATH)
@detail_options
@output_options
def report(**arguments: Any) -> int:
    """Show RECORD, which `check --json` wrote, as check showed it. The exit code is 0, whatever the verdict.

    Pictures come from RECORD.arrays.npz beside it; without that file the report is drawn without pictures.
    """
    with loading_modules():
        from fedora_qa.cli.report import run_report  # noqa: PLC0415 - loads what measures

    return run_report(**arguments)
