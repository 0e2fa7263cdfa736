"""Rules about sequences beside each other: none twice, and nothing of one split in another."""

from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from itertools import combinations
from typing import Final

from fedora_qa.gate.release_result import ReleaseResult, Violation
from fedora_qa.gate.rules import ContentsByName

_SHARED_POSES: Final = 10
"""Distinct poses in common from which two files show one flight. Two flights can share the pose in which they start;
ten equal float64 poses in different flights do not happen."""


def rule_on_distinct(contents_by_name: ContentsByName, streams: Iterable[str]) -> ReleaseResult:
    """No content of a stream occurs in two sequences."""
    violations = []
    for stream in streams:
        first: dict[str, str] = {}
        for name, contents in contents_by_name.items():
            digest = contents.digests.get(stream)
            if digest and first.setdefault(digest, name) != name:
                message = f"Expected sequences that differ, got the same {stream} as in {first[digest]}"
                violations.append(Violation(name, stream, message, stream))
    return ReleaseResult("release.distinct", "Is every stream its own, and none a copy?", "each", tuple(violations))


def rule_on_splits(
    names: Iterable[str], contents_by_name: ContentsByName, splits: Mapping[str, tuple[str, ...]]
) -> ReleaseResult:
    """Every sequence is in one split, and no content in two."""
    homes = {name: _splits_of(name, splits) for name in names}
    violations = [
        Violation(name, "several" if home else "unassigned", _home_message(home))
        for name, home in homes.items()
        if len(home) != 1
    ]
    for first, other in combinations(contents_by_name, 2):
        # Sequences of one split may be alike: only what two splits share leaks.
        apart = set(homes[first]).isdisjoint(homes[other])
        # What two sequences have in common, in words; empty where they differ.
        if apart and (shared := " and ".join(_alike(contents_by_name, first, other))):
            split = " and ".join(homes[first]) or "no split"
            message = f"Expected splits that do not leak, got {shared} of {first}, which is in {split}"
            violations.append(Violation(other, "leak", message))
    return ReleaseResult(
        "release.splits", "Is the sequence in one split, and unlike all in others?", "each", tuple(violations)
    )


def _splits_of(name: str, splits: Mapping[str, tuple[str, ...]]) -> list[str]:
    return [split for split, patterns in splits.items() if any(fnmatchcase(name, pattern) for pattern in patterns)]


def _home_message(home: list[str]) -> str:
    return f"Expected a sequence in one split, got it in {', '.join(home) or 'none'}"


def _alike(contents_by_name: ContentsByName, first: str, other: str) -> Iterator[str]:
    mine, theirs = contents_by_name[first], contents_by_name[other]
    same = [stream for stream, digest in mine.digests.items() if theirs.digests.get(stream) == digest]
    if same:
        yield f"the same {', '.join(same)}"
    poses = len(mine.poses & theirs.poses)
    if poses >= _SHARED_POSES:
        yield f"{poses} of the poses"
