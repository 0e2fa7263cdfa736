"""``fedora-qa score``: what a learner predicts against the truth of a sequence."""

from typing import Any

import click

from fedora_qa.cli.options import PATH, allow_external_option, dialect_option, metadata_option, table_options
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("predictions", type=PATH)
@click.argument("sequence", type=PATH)
@click.option(
    "--format",
    "form",
    type=click.Choice(["canonical", "dsec"]),
    help="canonical: an HDF5 file; dsec: a folder of PNG images of flow. By what lies there where absent.",
)
@dialect_option
@metadata_option
@allow_external_option
@table_options("json", "html", "markdown", has_format=False)
def score(**arguments: Any) -> int:
    """Score PREDICTIONS of flow, depth and pose against the truth of SEQUENCE, a file or folder.

    PREDICTIONS lie in an HDF5 file at the keys of the format, with timestamps of the sequence: path/flow/10hz in px,
    path/depth in mm, path/pose. NaN is a missing prediction. Flow may be a folder of PNG images, as DSEC has it.
    --dialect and --metadata are of SEQUENCE. Exit codes: 0 scored, whatever the result; 2 misuse, also predictions that
    do not fit the sequence; 1 and 3 as of check, where SEQUENCE cannot be read.
    """
    with loading_modules():
        from fedora_qa.cli.score import run_score  # noqa: PLC0415 - loads what measures

    return run_score(**arguments)
