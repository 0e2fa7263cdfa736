"""Every rule about a release that a policy asks for, in a fixed order."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from fedora_qa.engine.executors import Executor
from fedora_qa.engine.opening import require_end_of_opening
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.errors import UnreadableFileError, WorkerLostError
from fedora_qa.gate.contents import Contents, read_contents
from fedora_qa.gate.documents import rule_on_checksums, rule_on_documents, whole_digest
from fedora_qa.gate.policy import Documents, Policy, each_stream
from fedora_qa.gate.release import Release
from fedora_qa.gate.release_result import ReleaseResult
from fedora_qa.gate.rules import rule_on_intrinsics, rule_on_names, rule_on_streams
from fedora_qa.gate.split_leakage import rule_on_distinct, rule_on_splits
from fedora_qa.gate.totals import rule_on_totals
from fedora_qa.layout.dialect import Dialect, load_dialect
from fedora_qa.record.types import FileRecord, Result

_CONTENT: Final = ("rgb", "depth", "events", "imu", "pose", "flow")
"""Streams that no two splits may share."""


def release_results_of(
    policy: Policy,
    release: Release,
    files: Sequence[FileRecord],
    contents_by_name: Mapping[str, Contents],
    digests: Mapping[str, str],
) -> Iterator[ReleaseResult]:
    """Yield what each rule found that the policy asks for.

    Parameters
    ----------
    files
        The records of the sequences, in the release's order.
    contents_by_name
        What ``contents_of`` found.
    digests
        SHA-256 of all of each sequence, by its name; may be empty where the policy asks for no checksums.
    """
    names = [sequence.name for sequence in release.sequences]
    if policy.naming is not None:
        yield rule_on_names(names, policy.naming)
    if policy.required_streams:
        yield rule_on_streams(contents_by_name, each_stream(policy.required_streams))
    if policy.same_intrinsics:
        yield rule_on_intrinsics(contents_by_name, policy.same_intrinsics)
    if policy.distinct_streams:
        yield rule_on_distinct(contents_by_name, each_stream(policy.distinct_streams))
    if policy.splits:
        yield rule_on_splits(names, contents_by_name, policy.splits)
    if policy.documents.checksums is not None:
        yield rule_on_checksums(release.folder, policy.documents.checksums, digests)
    if policy.documents != Documents():
        yield rule_on_documents(release.folder, policy.documents)
    if policy.totals:
        yield rule_on_totals(files, policy.totals)


def contents_of(
    policy: Policy, release: Release, files: Sequence[FileRecord], executor: Executor
) -> tuple[dict[str, Contents], list[FileRecord]]:
    """Read of each sequence what the policy asks for, in the executor's processes.

    Returns
    -------
    The contents of each sequence that can be opened, by name; and the records of all, incomplete where the process that
    read one has died over it. Files over which a check died already are not opened again.
    """
    if not (policy.required_streams or policy.same_intrinsics or policy.distinct_streams or policy.splits):
        return {}, list(files)
    dialect = load_dialect(policy.check.dialect) if policy.check.dialect else None
    names = (*policy.distinct_streams, *(_CONTENT if policy.splits else ()))
    streams = tuple(dict.fromkeys(each_stream(names)))
    folders = tuple(map(Path, policy.check.allow_external))
    contents_by_name, records_read = dict[str, Contents](), list[FileRecord]()
    for sequence, file in zip(release.sequences, files, strict=True):
        # A file whose checks all crashed would probably end the next process that opens it as well.
        died = file.results and all(result.outcome == "crashed" for result in file.results)
        task = partial(_read, sequence.path, dialect, streams, bool(policy.splits), folders)
        try:
            contents = None if died else executor.submit(task, quiet).result()
        except WorkerLostError as lost:
            records_read.append(replace(file, verdict="incomplete", results=(*file.results, _lost(lost))))
            continue
        records_read.append(file)
        if contents:
            contents_by_name[sequence.name] = contents
    return contents_by_name, records_read


def _read(
    path: Path, dialect: Dialect | None, streams: tuple[str, ...], poses: bool, folders: tuple[Path, ...], _: Progress
) -> Contents | None:
    with suppress(UnreadableFileError):
        require_end_of_opening(path, dialect, folders)
    return read_contents(path, dialect, streams, poses=poses, allow_external=folders)


def _lost(lost: WorkerLostError) -> Result:
    question = "Can be read what the rules of the release need?"
    return Result("release.contents", "crashed", question, reason=f"the process that read the file has died: {lost}")


def whole_digests(release: Release, files: Sequence[FileRecord]) -> dict[str, str]:
    """Return the SHA-256 of all of each sequence by its name; the record has that of files up to 1 GiB."""
    return {
        sequence.name: file.sha256 if file.digest_kind == "full" else whole_digest(sequence.path)
        for sequence, file in zip(release.sequences, files, strict=True)
    }
