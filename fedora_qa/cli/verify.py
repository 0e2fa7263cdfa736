"""``fedora-qa verify``: compare a release with its certificate."""

from datetime import UTC, datetime
from pathlib import Path

import click

from fedora_qa.cli.exit_codes import CLEAN, FINDINGS
from fedora_qa.gating.certificate import differences, read_certificate
from fedora_qa.record.wording import unobeyed


def run_verify(certificate_path: Path, folder: Path) -> int:
    """Run the command and return its exit code."""
    certificate = read_certificate(certificate_path)
    # The day in UTC, as in `gate`: whether a waiver has expired must not depend on the time zone.
    deviations = differences(certificate, folder, datetime.now(UTC).date())
    for difference in deviations:
        click.echo(f"differs: {unobeyed(difference)}")
    if deviations:
        return FINDINGS
    click.echo(
        f"{len(certificate.files)} sequences and {len(certificate.documents)} documents are as certified on "
        f"{unobeyed(certificate.issued)} by {unobeyed(certificate.tool.name)} {unobeyed(certificate.tool.version)}"
    )
    return CLEAN
