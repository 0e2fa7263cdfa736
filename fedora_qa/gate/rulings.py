"""Every rule about a release that a policy asks for, in a fixed order."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from fedora_qa.gate.contents import Contents, read_contents
from fedora_qa.gate.documents import rule_on_checksums, rule_on_documents, whole_digest
from fedora_qa.gate.likeness import rule_on_distinct, rule_on_splits
from fedora_qa.gate.policy import Documents, Policy, each_stream
from fedora_qa.gate.release import Release
from fedora_qa.gate.rules import rule_on_intrinsics, rule_on_names, rule_on_streams
from fedora_qa.gate.ruling import Ruling
from fedora_qa.gate.totals import rule_on_totals
from fedora_qa.layout.dialect import load_dialect
from fedora_qa.record.types import FileRecord

_CONTENT: Final = ("rgb", "depth", "events", "imu", "pose", "flow")
"""Streams that no two splits may share."""


def rulings_of(
    policy: Policy, release: Release, files: Sequence[FileRecord], digests: Mapping[str, str]
) -> Iterator[Ruling]:
    """Yield what each rule found that the policy asks for.

    Parameters
    ----------
    files
        The records of the sequences, in the release's order.
    digests
        SHA-256 of all of each sequence, by its name; may be empty where the policy asks for no checksums.
    """
    names = [sequence.name for sequence in release.sequences]
    known = contents_of(policy, release)
    if policy.naming is not None:
        yield rule_on_names(names, policy.naming)
    if policy.required_streams:
        yield rule_on_streams(known, each_stream(policy.required_streams))
    if policy.same_intrinsics:
        yield rule_on_intrinsics(known, policy.same_intrinsics)
    if policy.distinct_streams:
        yield rule_on_distinct(known, each_stream(policy.distinct_streams))
    if policy.splits:
        yield rule_on_splits(names, known, policy.splits)
    if policy.documents.checksums is not None:
        yield rule_on_checksums(release.folder, policy.documents.checksums, digests)
    if policy.documents != Documents():
        yield rule_on_documents(release.folder, policy.documents)
    if policy.totals:
        yield rule_on_totals(files, policy.totals)


def contents_of(policy: Policy, release: Release) -> dict[str, Contents]:
    """Return the contents of each sequence that can be opened, as far as the policy asks for them."""
    dialect = load_dialect(policy.check.dialect) if policy.check.dialect else None
    names = (*policy.distinct_streams, *(_CONTENT if policy.splits else ()))
    streams = tuple(dict.fromkeys(each_stream(names)))
    read = {
        sequence.name: read_contents(
            sequence.path,
            dialect,
            streams,
            poses=bool(policy.splits),
            allow_external=map(Path, policy.check.allow_external),
        )
        for sequence in release.sequences
    }
    return {name: contents for name, contents in read.items() if contents}


def whole_digests(release: Release, files: Sequence[FileRecord]) -> dict[str, str]:
    """Return the SHA-256 of all of each sequence by its name; the record has that of files up to 1 GiB."""
    return {
        sequence.name: file.sha256 if file.digest_kind == "full" else whole_digest(sequence.path)
        for sequence, file in zip(release.sequences, files, strict=True)
    }
