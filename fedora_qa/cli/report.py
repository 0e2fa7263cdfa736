"""``fedora-qa report``: render a record again, without the data."""

from pathlib import Path

import click

from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.summary import show_record
from fedora_qa.cli.terminal import stdout_console
from fedora_qa.record.json_io import read_record


@click.command(short_help="Render a record again, without the data.")
@click.argument("record_path", metavar="RECORD", type=click.Path(path_type=Path))
@click.option(
    "--markdown",
    "markdown_path",
    type=click.Path(path_type=Path),
    metavar="OUT",
    help="Write a summary for a pull request.",
)
def report(record_path: Path, markdown_path: Path | None) -> int:
    """Show RECORD, which `check --json` wrote, as check showed it. The exit code is 0, whatever the verdict."""
    outputs = Outputs(markdown=markdown_path)
    outputs.require_writable([record_path])
    record = read_record(record_path)
    outputs.write(record, {})
    show_record(stdout_console(), record)
    return 0
