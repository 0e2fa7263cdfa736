"""Hold a release to its policy from Python."""

from collections.abc import Sequence
from os import fspath
from pathlib import Path

from fedora_qa.api.check import CheckedRecord, with_arrays
from fedora_qa.api.options import AnyPath, folder_texts
from fedora_qa.cli.gate import gate_release, plan_gate, require_disk
from fedora_qa.cli.outputs import Outputs
from fedora_qa.errors import MisuseError
from fedora_qa.storage.place import place_of


def gate(
    folder: AnyPath,
    policy: AnyPath,
    *,
    baseline: AnyPath | None = None,
    certificate: AnyPath | None = None,
    jobs: int | None = None,
    allow_external: Sequence[AnyPath] | None = None,
    evidence: bool = True,
    apart: bool = False,
) -> CheckedRecord:
    """Check every sequence in a folder, and the folder as a whole, as a policy demands; as ``fedora-qa gate`` does.

    Parameters
    ----------
    folder
        The release: sequences and documents, in a folder or below a prefix (``s3://bucket/prefix/``).
    policy
        A TOML file with what must hold.
    baseline
        The record of an earlier gate, whose findings are accepted; None: none is.
    certificate
        Where to certify what was checked; written only where the release is clean. None: nowhere.
    jobs
        Files, and windows of a file, checked at once, each in a process of its own; None: as the policy states it.
    allow_external
        Folders with other files that a sequence may link to, or consist of; None: as the policy states them.
    evidence
        Whether to keep images and series for the report.
    apart
        Whether to open files in another process even with a single job; as for ``check``.

    Returns
    -------
    CheckedRecord
        The sequences in the order of their names and, last in ``files``, the release itself.

    Raises
    ------
    MisuseError
        No such folder, policy or baseline, a sequence that is not HDF5, or an option that has an illegal value.
    """
    if jobs is not None and jobs < 1:
        raise MisuseError(f"Expected one job or more, got {jobs}; pass jobs=1 to check one file at a time")
    external = folder_texts(allow_external) or ()
    accepted = None if baseline is None else Path(baseline)
    plan = plan_gate(place_of(fspath(folder)), Path(policy), accepted, jobs, external)
    require_disk(plan.release.folder, "a certificate", certificate)
    output = None if certificate is None else Path(certificate)
    Outputs(own=(output,)).require_writable(plan.inputs)
    gated = gate_release(plan, evidence=evidence, with_digests=output is not None, in_process=not apart)
    if output and gated.is_clean:
        gated.write_certificate(output)
    return with_arrays(gated.record, gated.arrays)
