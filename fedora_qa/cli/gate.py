"""``fedora-qa gate``: check a release by a policy, for CI. ``verify``: compare it with its certificate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
from numpy.typing import NDArray

from fedora_qa.cli.arrays import ArrayStore
from fedora_qa.cli.check import Request, check_all, executor_for
from fedora_qa.cli.exit_codes import CLEAN, FINDINGS, exit_code
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.record import evidence_arrays, record_of
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.settings import check_options, with_jobs
from fedora_qa.cli.summary import Detail, print_record
from fedora_qa.engine.options import FileRun
from fedora_qa.errors import MisuseError
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.gating.acceptance import Baseline, baseline_of
from fedora_qa.gating.certificate import certificate_of, differences, read_certificate, write_certificate
from fedora_qa.gating.contents import contents_of
from fedora_qa.gating.policy import Policy, read_policy
from fedora_qa.gating.release import Release, find_release
from fedora_qa.gating.rules import release_results_of
from fedora_qa.gating.verdict import Judgement, judge_release, release_record
from fedora_qa.layout.dialect import load_choice, split_choice
from fedora_qa.record.json_io import read_record
from fedora_qa.record.types import Record
from fedora_qa.record.wording import unobeyed
from fedora_qa.storage.digest import whole_digest
from fedora_qa.storage.place import Place, RemoteFile


def run_gate(
    folder: Place,
    policy_path: Path,
    baseline_path: Path | None,
    jobs: int | None,
    dask: str | None,
    certificate: Path | None,
    allow_external: tuple[str, ...],
    outputs: Outputs,
    detail: Detail,
) -> int:
    """Run the command and return its exit code."""
    if dask and jobs:
        raise MisuseError("Expected either --jobs or --dask, got both")
    plan = plan_gate(folder, policy_path, baseline_path, jobs, allow_external)
    require_disk(plan.release.folder, "a certificate", certificate)
    outputs = replace(outputs, own=(certificate,))
    outputs.require_writable(plan.inputs)
    # Evidence needs a follow-up of the worst places; it is gathered only where an output shows it.
    gated = gate_release(plan, evidence=outputs.show_evidence, with_digests=certificate is not None, dask=dask)
    outputs.write(gated.record, gated.arrays)
    print_record(gated.record, outputs, detail)
    if certificate and gated.is_clean:
        gated.write_certificate(certificate)
    elif certificate:
        click.echo("fedora-qa: no certificate is written, because the release is not clean", err=True)
    return exit_code(gated.record.files, "failed")


@dataclass(frozen=True, slots=True)
class GatePlan:
    """What is to be gated.

    Attributes
    ----------
    release
        The folder and its sequences.
    policy
        What must hold, with the options of this machine in place of its own.
    baseline
        The findings that are accepted; None: there is none.
    inputs
        Every file that is read, which no output may overwrite.
    policy_path
        The file of the policy, whose digest a certificate states.
    """

    release: Release
    policy: Policy
    baseline: Baseline | None
    inputs: tuple[Path, ...]
    policy_path: Path


@dataclass(frozen=True, slots=True)
class GatedRelease:
    """The result: a record of the sequences and, last, of the release; and what a certificate needs beside it.

    Attributes
    ----------
    digests
        SHA-256 of each whole sequence by its name; empty where neither a certificate nor the policy needs them.
    """

    plan: GatePlan
    record: Record
    arrays: Mapping[str, NDArray[Any]]
    digests: Mapping[str, str]

    @property
    def is_clean(self) -> bool:
        """Whether the sequences and the release are clean, so that they may be certified."""
        return exit_code(self.record.files, "failed") == CLEAN

    def write_certificate(self, path: Path) -> None:
        """Certify what was checked; the caller ensures that the release is clean."""
        digest = whole_digest(self.plan.policy_path)
        write_certificate(certificate_of(self.record, self.plan.policy, digest, dict(self.digests)), path)


def require_disk(folder: Place, what: str, asked: object) -> None:
    """Raise ``MisuseError`` where the digest of every byte is asked for of a release behind a URL."""
    if asked and isinstance(folder, RemoteFile):
        raise MisuseError(f"Expected a release on a disk for {what}, got {folder}; copy it, because every byte is read")


def plan_gate(
    folder: Place, policy_path: Path, baseline_path: Path | None, jobs: int | None, allow_external: Sequence[str]
) -> GatePlan:
    """Read the policy and the baseline, and find the sequences.

    Raises
    ------
    MisuseError
        There is no such folder, policy or baseline, no sequence, or an illegal option.
    """
    policy = read_policy(policy_path)
    choice = load_choice(policy.check.dialect, policy.check.metadata)
    require_disk(folder, "checksums", policy.documents.checksums)
    release = find_release(folder, policy.files, split_choice(choice)[0])
    baseline = baseline_of(read_record(baseline_path)) if baseline_path else None
    # Only what depends on the machine (cores, folders) may override the policy; what is checked may not.
    settings = replace(policy.check, jobs=jobs) if jobs else policy.check
    settings = replace(settings, allow_external=tuple(allow_external)) if allow_external else settings
    others = [policy_path, *([baseline_path] if baseline_path else [])]
    inputs = (*(each.path for each in release.sequences if isinstance(each.path, Path)), *others)
    return GatePlan(release, replace(policy, check=settings), baseline, inputs, policy_path)


def gate_release(
    plan: GatePlan, *, evidence: bool, with_digests: bool, in_process: bool = False, dask: str | None = None
) -> GatedRelease:
    """Check every sequence of a release, and judge them and the release.

    Parameters
    ----------
    evidence
        Whether to gather images and series for an output that shows them; the worst places are looked at again.
    with_digests
        Whether to read every byte for the digests of a certificate.
    in_process
        Whether a single job opens files in this process.
    dask
        Address of the cluster that does the work; None: processes of this machine.

    Raises
    ------
    MisuseError
        A sequence is not HDF5, or an option has an illegal value.
    """
    policy, release = plan.policy, plan.release
    paths = [sequence.path for sequence in release.sequences]
    # A cluster has workers of its own.
    settings = replace(policy.check, jobs=None) if dask else policy.check
    settings = settings if in_process or dask else with_jobs(settings, paths)
    options = replace(check_options(settings), evidence=EvidenceOptions() if evidence else None)
    # Only to refuse what is not HDF5 before hours of measuring.
    sequences_of(paths, options.dialect)
    now = datetime.now(UTC)
    started = now.isoformat(timespec="seconds")
    executor = executor_for(settings, dask, in_process=in_process)
    # Read before the executor is closed: afterwards it has no workers to count.
    jobs = executor.capacity
    aside = ArrayStore() if evidence else None
    runs = check_all(paths, Request(settings, options, started, aside=aside), executor)
    workers = {"peak_worker_memory_mib": executor.peak_memory_mib} if executor.peak_memory_mib else {}
    facts = {"jobs": jobs, **workers}
    # A second executor: `check_all` has closed the first one.
    with executor_for(settings, dask, in_process=in_process) as readers:
        contents, files = contents_of(policy, release, [run.record for run in runs], readers)
    runs = [replace(run, record=file) for run, file in zip(runs, files, strict=True)]
    # Last, as `judge_release` requires.
    runs.append(FileRun(release_record(release, files)))
    record = record_of(runs, settings, started, facts)
    digests: dict[str, str] = {}
    if with_digests or policy.documents.checksums:
        # Records hold only partial digests of files over 1 GiB. Certificates and lists of checksums need whole ones,
        # for which every byte is read.
        for sequence, file in zip(release.sequences, files, strict=True):
            if isinstance(sequence.path, Path):
                is_full = file.digest_kind == "full"
                digests[sequence.name] = file.sha256 if is_full else whole_digest(sequence.path)
    release_results = release_results_of(policy, release, files, contents, digests)
    record = judge_release(record, release, release_results, Judgement(policy, plan.baseline, now.date()))
    return GatedRelease(plan, record, evidence_arrays(runs), digests)


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
