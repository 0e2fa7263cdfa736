"""``fedora-qa report``: render a record again, without the data."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from numpy.typing import NDArray

from fedora_qa.cli.arrays import arrays_beside, read_arrays
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.summary import show_record
from fedora_qa.cli.terminal import stdout_console
from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import read_record
from fedora_qa.record.types import Record
from fedora_qa.record.wording import printable

PATH = click.Path(path_type=Path)


@click.command(short_help="Render a record again, without the data.")
@click.argument("record_path", metavar="RECORD", type=PATH)
@click.option("--html", "html_path", type=PATH, metavar="OUT", help="Write a report with pictures, in one HTML file.")
@click.option("--markdown", "markdown_path", type=PATH, metavar="OUT", help="Write a summary for a pull request.")
def report(record_path: Path, html_path: Path | None, markdown_path: Path | None) -> int:
    """Show RECORD, which `check --json` wrote, as check showed it. The exit code is 0, whatever the verdict.

    Pictures come from RECORD.arrays.npz beside it; without that file the report is drawn without pictures.
    """
    outputs = Outputs(html=html_path, markdown=markdown_path)
    outputs.require_writable([record_path, arrays_beside(record_path)])
    record = read_record(record_path)
    outputs.write(record, _evidence(record, record_path) if html_path else {})
    show_record(stdout_console(), record)
    return 0


def _evidence(record: Record, record_path: Path) -> Mapping[str, NDArray[Any]]:
    """Return the arrays that the record names; none, and a word on stderr, where they are missing or damaged."""
    if not any(file.evidence for file in record.files):
        return {}
    try:
        return read_arrays(arrays_beside(record_path))
    except MisuseError as problem:
        click.echo(f"fedora-qa: {printable(str(problem))}; the report is drawn without pictures", err=True)
        return {}
