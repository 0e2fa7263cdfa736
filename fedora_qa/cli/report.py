"""``fedora-qa report``: render a record again, without the data."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from numpy.typing import NDArray

from fedora_qa.cli.arrays import arrays_beside, read_arrays
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.summary import Detail, print_record
from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import read_record
from fedora_qa.record.wording import unobeyed


def run_report(record_path: Path, outputs: Outputs, detail: Detail) -> int:
    """Run the command and return its exit code."""
    # The record and its arrays are inputs, even where no picture is drawn from them.
    outputs.require_writable([record_path, arrays_beside(record_path)])
    record = read_record(record_path)
    arrays: Mapping[str, NDArray[Any]] = {}
    if outputs.html and any(file.evidence for file in record.files):
        try:
            arrays = read_arrays(arrays_beside(record_path))
        except MisuseError as problem:
            # A warning, not misuse: verdict, findings and tables need no arrays.
            click.echo(f"fedora-qa: {unobeyed(str(problem))}; the report is drawn without pictures", err=True)
    outputs.write(record, arrays)
    print_record(record, outputs, detail)
    return 0
