"""``fedora-qa gate``: check a release against a policy, for CI."""

from dataclasses import replace
from pathlib import Path

import click

from fedora_qa.cli.exit_codes import exit_code
from fedora_qa.cli.gate_release import gate_release, plan_gate
from fedora_qa.cli.options import PATH, allow_external_option, detail_options, record_options
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.summary import Detail, print_record


@click.command()
@click.argument("folder", metavar="DIR", type=PATH)
@click.option("--policy", "policy_path", required=True, type=PATH, metavar="POLICY.toml", help="What must hold.")
@click.option(
    "--baseline", "baseline_path", type=PATH, metavar="RECORD", help="Accept the findings of an earlier gate's record."
)
@click.option("--jobs", type=click.IntRange(min=1), help="Files, and windows of a file, checked at once.")
@click.option("--certificate", type=PATH, metavar="OUT", help="Certify what was checked, where the release is clean.")
@allow_external_option
@detail_options
@record_options
def gate(
    folder: Path,
    policy_path: Path,
    baseline_path: Path | None,
    jobs: int | None,
    certificate: Path | None,
    allow_external: tuple[str, ...],
    outputs: Outputs,
    detail: Detail,
) -> int:
    """Check every sequence in DIR, and DIR as a whole, as a policy demands.

    The record holds the sequences and, last, the release itself. Exit codes: 0 clean; 1 findings; 2 misuse; 3
    incomplete.
    """
    plan = plan_gate(folder, policy_path, baseline_path, jobs, allow_external)
    outputs = replace(outputs, own=(certificate,))
    outputs.require_writable(plan.inputs)
    # Evidence needs a follow-up of the worst places; it is gathered only where an output shows it.
    gated = gate_release(plan, evidence=outputs.show_evidence, with_digests=certificate is not None)
    outputs.write(gated.record, gated.arrays)
    print_record(gated.record, github=outputs.github, detail=detail)
    if certificate and gated.is_clean:
        gated.write_certificate(certificate)
    elif certificate:
        click.echo("fedora-qa: no certificate is written, because the release is not clean", err=True)
    return exit_code(gated.record.files, "failed")
