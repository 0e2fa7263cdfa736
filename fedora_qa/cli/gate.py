"""``fedora-qa gate``: check a release against a policy, for CI."""

from dataclasses import replace
from pathlib import Path

import click

from fedora_qa.cli.exit_codes import exit_code
from fedora_qa.cli.gate_release import gate_release, plan_gate
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.summary import Detail, print_record


def run_gate(
    folder: Path,
    policy_path: Path,
    baseline_path: Path | None,
    jobs: int | None,
    certificate: Path | None,
    allow_external: tuple[str, ...],
    outputs: Outputs,
    detail: Detail,
) -> int:
    """Do what the command says and return its exit code."""
    plan = plan_gate(folder, policy_path, baseline_path, jobs, allow_external)
    outputs = replace(outputs, own=(certificate,))
    outputs.require_writable(plan.inputs)
    # Evidence needs a follow-up of the worst places; it is gathered only where an output shows it.
    gated = gate_release(plan, evidence=outputs.show_evidence, with_digests=certificate is not None)
    outputs.write(gated.record, gated.arrays)
    print_record(gated.record, outputs, detail)
    if certificate and gated.is_clean:
        gated.write_certificate(certificate)
    elif certificate:
        click.echo("fedora-qa: no certificate is written, because the release is not clean", err=True)
    return exit_code(gated.record.files, "failed")
