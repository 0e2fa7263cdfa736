"""``fedora-qa gate``: check a release against a policy, for CI."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import click

from fedora_qa.cli.check import check_options
from fedora_qa.cli.check_all import Request, check_all, executor_for
from fedora_qa.cli.exit_codes import CLEAN, exit_code
from fedora_qa.cli.options import PATH, allow_external_option, detail_options, record_options
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.record import evidence_arrays, record_of
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.summary import Detail, print_record
from fedora_qa.engine.options import FileRun
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.gate.baseline import baseline_of
from fedora_qa.gate.certificate import certificate_of, write_certificate
from fedora_qa.gate.contents import contents_of
from fedora_qa.gate.policy import read_policy
from fedora_qa.gate.release import find_release
from fedora_qa.gate.rules import release_results_of
from fedora_qa.gate.verdict import Judgement, judge_release, release_record
from fedora_qa.layout.dialect import load_choice, split_choice
from fedora_qa.record.json_io import read_record
from fedora_qa.storage.digest import whole_digest


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
    policy = read_policy(policy_path)
    choice = load_choice(policy.check.dialect, policy.check.metadata)
    release = find_release(folder, policy.files, split_choice(choice)[0])
    paths = [sequence.path for sequence in release.sequences]
    baseline = baseline_of(read_record(baseline_path)) if baseline_path else None
    outputs = replace(outputs, own=(certificate,))
    outputs.require_writable([*paths, policy_path, *([baseline_path] if baseline_path else [])])
    # Only what depends on the machine (cores, folders) may override the policy; what is checked may not.
    settings = replace(policy.check, jobs=jobs) if jobs else policy.check
    settings = replace(settings, allow_external=allow_external) if allow_external else settings
    policy = replace(policy, check=settings)
    # Evidence needs a follow-up of the worst places; it is gathered only where an output shows it.
    options = replace(check_options(settings), evidence=EvidenceOptions() if outputs.show_evidence else None)
    sequences_of(paths, options.dialect)
    now = datetime.now(UTC)
    started = now.isoformat(timespec="seconds")
    executor = executor_for(settings)
    jobs = executor.capacity
    runs = check_all(paths, Request(settings, options, started), executor)
    facts = {"jobs": jobs, "peak_worker_memory_mib": executor.peak_memory_mib}
    # A second executor: `check_all` has closed the first one.
    with executor_for(settings) as readers:
        contents, files = contents_of(policy, release, [run.record for run in runs], readers)
    runs = [replace(run, record=file) for run, file in zip(runs, files, strict=True)]
    # Last, as `judge_release` requires.
    runs.append(FileRun(release_record(release, files)))
    record = record_of(runs, settings, started, facts)
    digests: dict[str, str] = {}
    if certificate or policy.documents.checksums:
        # Records hold only partial digests of files over 1 GiB. Certificates and lists of checksums need whole ones,
        # for which every byte is read.
        for sequence, file in zip(release.sequences, files, strict=True):
            is_full = file.digest_kind == "full"
            digests[sequence.name] = file.sha256 if is_full else whole_digest(sequence.path)
    release_results = release_results_of(policy, release, files, contents, digests)
    record = judge_release(record, release, release_results, Judgement(policy, baseline, now.date()))
    outputs.write(record, evidence_arrays(runs))
    print_record(record, github=outputs.github, detail=detail)
    code = exit_code(record.files, "failed")
    if certificate and code == CLEAN:
        write_certificate(certificate_of(record, policy, whole_digest(policy_path), digests), certificate)
    elif certificate:
        click.echo("fedora-qa: no certificate is written, because the release is not clean", err=True)
    return code
