"""``fedora-qa verify``: compare a release with its certificate."""

from typing import Any

import click

from fedora_qa.cli.options import PATH
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("certificate_path", metavar="CERTIFICATE", type=PATH)
@click.argument("folder", metavar="DIR", type=PATH)
def verify(**arguments: Any) -> int:
    """Compare every byte of DIR with CERTIFICATE, which `gate --certificate` wrote.

    Exit codes: 0 the same; 1 something was changed, added or removed, or a waiver has expired; 2 misuse.
    """
    with loading_modules():
        from fedora_qa.cli.verify import run_verify  # noqa: PLC0415 - loads what measures

    return run_verify(**arguments)
