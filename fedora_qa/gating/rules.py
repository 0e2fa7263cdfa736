"""Rules about a release: its sequences by themselves and beside each other, its documents, and its totals."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import combinations
from math import isfinite
from pathlib import Path
from typing import Final

import numpy as np

from fedora_qa.errors import MisuseError
from fedora_qa.gating.contents import Contents
from fedora_qa.gating.policy import Bounds, Documents, Policy, Total, each_stream
from fedora_qa.gating.release import Release, ReleaseResult, Violation, has_document, inside
from fedora_qa.record.types import FOLDER, FileRecord, Where
from fedora_qa.record.wording import number, place
from fedora_qa.sequence.declared import Camera, Lens
from fedora_qa.storage.digest import whole_digest
from fedora_qa.storage.folder import is_folder, list_files, root_of
from fedora_qa.storage.place import Place

ContentsByName = Mapping[str, Contents]
"""The contents of each sequence that can be opened, by its name, in order."""

_SHARED_POSES: Final = 10
"""Distinct poses in common from which two files show one flight. Two flights can share the pose in which they start;
ten equal float64 poses in different flights do not happen."""

_CHECKSUM_LINE: Final = re.compile(r"([0-9a-fA-F]{64}) [ *](.+)")
"""A line of ``sha256sum``: digest and name."""

_STATISTICS: Final[Mapping[Total, tuple[str, str]]] = {
    "duration_s": ("sequence", "duration_s"),
    "distance_m": ("motion", "distance_m"),
    "events": ("events", "count"),
}
"""Group and name of the statistic that is summed."""


def release_results_of(
    policy: Policy,
    release: Release,
    files: Sequence[FileRecord],
    contents_by_name: ContentsByName,
    digests: Mapping[str, str],
) -> Iterator[ReleaseResult]:
    """Yield the result of each rule of the policy.

    Parameters
    ----------
    files
        The records of the sequences, in the release's order.
    contents_by_name
        The result of ``contents_of``.
    digests
        SHA-256 of all of each sequence, by its name; may be empty where the policy names no checksums.
    """
    names = [sequence.name for sequence in release.sequences]
    if policy.naming is not None:
        yield rule_on_names(names, policy.naming)
    if policy.required_streams:
        yield rule_on_streams(contents_by_name, policy.required_streams)
    if policy.same_intrinsics:
        yield rule_on_intrinsics(contents_by_name, policy.same_intrinsics)
    if policy.distinct_streams:
        yield rule_on_distinct(contents_by_name, policy.distinct_streams)
    if not policy.same_sequence:
        yield rule_on_identity(contents_by_name)
    if policy.splits:
        yield rule_on_splits(names, contents_by_name, policy.splits)
    # Every byte is needed for them: ``plan_gate`` refuses them of a prefix.
    if policy.documents.checksums is not None and isinstance(release.folder, Path):
        yield rule_on_checksums(release.folder, policy.documents.checksums, digests)
    if policy.documents != Documents():
        yield rule_on_documents(release.folder, policy.documents)
    if policy.totals:
        yield rule_on_totals(files, policy.totals)


def rule_on_names(names: Iterable[str], pattern: str) -> ReleaseResult:
    """Every name matches the pattern as a whole."""
    violations = [
        Violation(name, "pattern", f"Expected a name that matches {pattern}, got {name}")
        for name in names
        if not re.fullmatch(pattern, name)
    ]
    return ReleaseResult("release.naming", "Is the sequence named as the policy asks?", "each", tuple(violations))


def rule_on_streams(contents_by_name: ContentsByName, required: Iterable[str]) -> ReleaseResult:
    """Every sequence holds the required streams."""
    violations = []
    for name, contents in contents_by_name.items():
        for stream in each_stream(required, {*contents.streams, *contents.absent}):
            if stream not in contents.streams:
                why = contents.absent.get(stream, "the file has no such rate")
                violations.append(Violation(name, "missing", f"Expected the stream {stream}, got none: {why}", stream))
    return ReleaseResult("release.streams", "Are all required streams there?", "each", tuple(violations))


def rule_on_intrinsics(contents_by_name: ContentsByName, cameras: Iterable[str]) -> ReleaseResult:
    """Every sequence declares the intrinsics of the first that declares any."""
    violations = []
    for name in cameras:
        declared = {sequence: contents.cameras.get(name) for sequence, contents in contents_by_name.items()}
        reference = next((pair for pair in declared.items() if pair[1]), None)
        for sequence, camera in declared.items():
            if camera is None:
                message = f"Expected the camera {name} to be declared, got none"
                violations.append(Violation(sequence, "undeclared", message, name))
                continue
            if reference is None or reference[1] is None:
                continue
            first = reference[1]
            same_sensor = (camera.width, camera.height, camera.model) == (first.width, first.height, first.model)
            # To nine digits: what is declared may have passed through text.
            same_sensor = same_sensor and _same_lens(camera.lens, first.lens)
            if not same_sensor or not np.allclose(camera.K, first.K, rtol=1e-9, atol=0.0):
                message = (
                    f"Expected the intrinsics of the camera {name} in {reference[0]} ({_intrinsics_text(first)}), "
                    f"got {_intrinsics_text(camera)}"
                )
                violations.append(Violation(sequence, "differ", message, name))
    question = "Are the intrinsics those of the other sequences?"
    return ReleaseResult("release.intrinsics", question, "each", tuple(violations))


def rule_on_distinct(contents_by_name: ContentsByName, streams: Iterable[str]) -> ReleaseResult:
    """No content of a stream occurs in two sequences."""
    violations = []
    digested = {stream for contents in contents_by_name.values() for stream in contents.digests}
    for stream in each_stream(streams, digested):
        first: dict[str, str] = {}
        for name, contents in contents_by_name.items():
            digest = contents.digests.get(stream)
            if digest and first.setdefault(digest, name) != name:
                message = f"Expected sequences that differ, got the same {stream} as in {first[digest]}"
                violations.append(Violation(name, stream, message, stream))
    return ReleaseResult("release.distinct", "Is every stream its own, and none a copy?", "each", tuple(violations))


def rule_on_identity(contents_by_name: ContentsByName) -> ReleaseResult:
    """No declared sequence has other data in another file.

    Files of one sequence are compared by the streams that both hold, so that one sequence may be stored in a file for
    each stream. The same data under one name are a copy, which ``release.distinct`` and ``release.splits`` find.
    """
    violations = []
    first: dict[str, str] = {}
    for name, contents in contents_by_name.items():
        if not contents.sequence or first.setdefault(contents.sequence, name) == name:
            continue
        earlier = contents_by_name[first[contents.sequence]]
        shared = [stream for stream in contents.digests if stream in earlier.digests]
        other = [stream for stream in shared if contents.digests[stream] != earlier.digests[stream]]
        if other:
            where = f"world {contents.world!r}, light {contents.illumination!r}"
            earlier_where = f"world {earlier.world!r}, light {earlier.illumination!r}"
            message = (
                f"Expected a sequence name of its own, got {contents.sequence!r} ({where}), which "
                f"{first[contents.sequence]} declares ({earlier_where}) with other {', '.join(other)}; rename one, or "
                "set same_sequence in the policy"
            )
            violations.append(Violation(name, "other_data", message))
    question = "Does no other sequence of the release declare this name?"
    return ReleaseResult("release.identity", question, "each", tuple(violations))


def rule_on_splits(
    names: Iterable[str], contents_by_name: ContentsByName, splits: Mapping[str, tuple[str, ...]]
) -> ReleaseResult:
    """Every sequence is in one split, and no content in two."""
    homes = {
        name: [split for split, patterns in splits.items() if any(fnmatchcase(name, pattern) for pattern in patterns)]
        for name in names
    }
    violations = []
    for name, home in homes.items():
        if len(home) != 1:
            message = f"Expected a sequence in one split, got it in {', '.join(home) or 'none'}"
            violations.append(Violation(name, "several" if home else "unassigned", message))
    for first, other in combinations(contents_by_name, 2):
        # Sequences of one split may be alike: only what two splits share leaks.
        if not set(homes[first]).isdisjoint(homes[other]):
            continue
        mine, theirs = contents_by_name[first], contents_by_name[other]
        same = [stream for stream, digest in mine.digests.items() if theirs.digests.get(stream) == digest]
        shared = [f"the same {', '.join(same)}"] if same else []
        poses = mine.poses.keys() & theirs.poses.keys()
        here, lie = Where(), ""
        if len(poses) >= _SHARED_POSES:
            shared.append(f"{len(poses)} of the poses")
            there, here = (_segment_of([contents.poses[pose] for pose in poses]) for contents in (mine, theirs))
            if there != Where() != here:
                lie = f"; these lie from {place(there)} there, and from {place(here)} here"
        if shared:
            split = " and ".join(homes[first]) or "no split"
            message = (
                f"Expected splits that do not leak, got {' and '.join(shared)} of {first}, which is in {split}{lie}"
            )
            violations.append(Violation(other, "leak", message, start_us=here.start_us, stop_us=here.stop_us))
    return ReleaseResult(
        "release.splits", "Is the sequence in one split, and unlike all in others?", "each", tuple(violations)
    )


def _segment_of(times_us: Sequence[float]) -> Where:
    """Return the first and the last of some times; no time where one of them is unknown."""
    return (
        Where(start_us=min(times_us), stop_us=max(times_us)) if times_us and all(map(isfinite, times_us)) else Where()
    )


def rule_on_documents(folder: Place, documents: Documents) -> ReleaseResult:
    """Datasheet, licence and checksums are there and not empty."""
    violations = []
    for kind, name in documents.names.items():
        if not has_document(folder, name):
            message = f"Expected the {kind} in {name}, got no such file, or an empty one"
            violations.append(Violation(FOLDER, kind, message))
    return ReleaseResult("release.documents", "Are datasheet, licence and checksums there?", FOLDER, tuple(violations))


def rule_on_checksums(folder: Path, listing: str, digests: Mapping[str, str]) -> ReleaseResult:
    """Every sequence is listed, of a folder every file, and every digest is correct.

    Parameters
    ----------
    listing
        Name of the checksums, in the form of ``sha256sum``.
    digests
        SHA-256 of each sequence, by its name.
    """
    path = inside(folder, listing)
    violations: list[Violation] = []
    listed: dict[str, str] = {}
    # Names of files need not be UTF-8: surrogates keep them readable and comparable.
    text = path.read_text(encoding="utf-8", errors="surrogateescape") if path.is_file() else ""
    for line_number, line in enumerate(text.splitlines(), start=1):
        match = _CHECKSUM_LINE.fullmatch(line)
        if match:
            listed[match[2].removeprefix("./")] = match[1].lower()
        elif line.strip():
            message = f"Expected a digest and a name in line {line_number} of {path.name}, got something else"
            violations.append(Violation(FOLDER, "unreadable", message))
    folders = {name for name in digests if is_folder(folder / name)}
    for name in sorted(folders):
        root = root_of(folder / name).relative_to(folder)
        parts = [(root / file.name).as_posix() for file in list_files(folder / name)]
        unlisted = [part for part in parts if part not in listed]
        if unlisted:
            message = f"Expected all {len(parts)} files of the sequence in {path.name}, got no line for {unlisted[0]}"
            others = f", nor for {len(unlisted) - 1} others" if len(unlisted) > 1 else ""
            violations.append(Violation(name, "unlisted", message + others))
    for name in sorted(digests.keys() - listed.keys() - folders):
        violations.append(Violation(name, "unlisted", f"Expected the sequence in {path.name}, got no line for it"))
    for name, digest in listed.items():
        actual = digests.get(name)
        if not actual:
            # A listed file that is no sequence: its digest, or why there is none.
            try:
                beside = inside(folder, name)
            except MisuseError:
                actual = "no name of a file within the release"
            else:
                actual = whole_digest(beside) if beside.is_file() else "no such file"
        if actual != digest:
            message = f"Expected {name} with the SHA-256 {digest}, which {path.name} lists, got {actual}"
            violations.append(Violation(name if name in digests else FOLDER, "wrong", message))
    question = "Are the checksums complete and right?"
    return ReleaseResult("release.checksums", question, "each", tuple(violations))


def rule_on_totals(files: Sequence[FileRecord], totals: Mapping[Total, Bounds]) -> ReleaseResult:
    """Sum over all sequences, and compare each sum with its bounds."""
    violations = []
    for total, bounds in totals.items():
        amount = amount_of(files, total)
        if amount is None:
            message = f"Expected to sum {total}, got a sequence whose statistics lack it"
        elif bounds.least is not None and amount < bounds.least:
            message = f"Expected {total} of at least {number(bounds.least)}, got {number(amount)}"
        elif bounds.most is not None and amount > bounds.most:
            message = f"Expected {total} of at most {number(bounds.most)}, got {number(amount)}"
        else:
            continue
        violations.append(Violation(FOLDER, total, message))
    return ReleaseResult("release.totals", "Does the release amount to what it should?", FOLDER, tuple(violations))


def amount_of(files: Sequence[FileRecord], total: Total) -> float | None:
    """Return the sum over all sequences, in the unit of the total; None where one of them lacks the statistic."""
    if total == "sequences":
        return float(len(files))
    if total == "bytes":
        return float(sum(file.size for file in files))
    group, name = _STATISTICS[total]
    values = [file.statistics.get(group, {}).get(name) for file in files]
    # A sum that lacks a sequence would look like a smaller release.
    if any(not isinstance(value, int | float) for value in values):
        return None
    return float(sum(value for value in values if isinstance(value, int | float)))


def _intrinsics_text(camera: Camera) -> str:
    focal, centre = np.diag(camera.K)[:2], camera.K[:2, 2]
    return (
        f"{camera.model} {camera.width}x{camera.height}, f {focal[0]:.9g}, {focal[1]:.9g}, "
        f"c {centre[0]:.9g}, {centre[1]:.9g} px"
        + (
            f", {camera.lens.model} {', '.join(f'{each:.9g}' for each in camera.lens.coefficients)}"
            if camera.lens
            else ""
        )
    )


def _same_lens(lens: Lens | None, other: Lens | None) -> bool:
    """Whether two lenses distort alike, to nine digits."""
    if lens is None or other is None:
        return lens is other
    return (
        lens.model == other.model
        and len(lens.coefficients) == len(other.coefficients)
        and np.allclose(lens.coefficients, other.coefficients, rtol=1e-9, atol=0.0)
    )
