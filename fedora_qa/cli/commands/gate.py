"""``fedora-qa gate``: check a release against a policy, for CI."""

from typing import Any

import click

from fedora_qa.cli.options import PATH, allow_external_option, detail_options, record_options
from fedora_qa.cli.parameters import PlaceParam
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("folder", metavar="DIR", type=PlaceParam())
@click.option("--policy", "policy_path", required=True, type=PATH, metavar="POLICY.toml", help="What must hold.")
@click.option(
    "--baseline", "baseline_path", type=PATH, metavar="RECORD", help="Accept the findings of an earlier gate's record."
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    help="Files, and windows of a file, checked at once.  [default: as many as cores]",
)
@click.option("--dask", metavar="ADDRESS", help="Do the work on a Dask cluster, such as tcp://host:8786.")
@click.option("--certificate", type=PATH, metavar="OUT", help="Certify what was checked, where the release is clean.")
@allow_external_option
@detail_options
@record_options
def gate(**arguments: Any) -> int:
    """Check every sequence in DIR, and DIR as a whole, as a policy demands; DIR may be a prefix, s3://bucket/prefix/.

    The record holds the sequences and, last, the release itself. Exit codes: 0 clean; 1 findings; 2 misuse; 3
    incomplete.
    """
    with loading_modules():
        from fedora_qa.cli.gate import run_gate  # noqa: PLC0415 - loads what measures

    return run_gate(**arguments)
