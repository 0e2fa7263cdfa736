"""A release: a folder of sequences and documents, or a prefix of an object store; and the results of its rules.

Names and links that lead out of it are refused.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Literal

from fedora_qa.errors import MisuseError
from fedora_qa.layout.dialect import Dialect
from fedora_qa.layout.folder import sequences_in
from fedora_qa.record.types import FOLDER, FileRecord, Finding, Result, Where
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.server import list_objects


@dataclass(frozen=True, slots=True)
class SequenceFile:
    """A sequence of the release, a file or a folder; ``name`` is relative to the folder, with slashes."""

    name: str
    path: Place


@dataclass(frozen=True, slots=True)
class Release:
    """A folder and its sequences, in the order of their names."""

    folder: Place
    sequences: tuple[SequenceFile, ...]


def find_release(folder: Place, patterns: Iterable[str], dialect: Dialect | None = None) -> Release:
    """Find the sequences of a folder.

    Parameters
    ----------
    patterns
        Of names of files, and of folders that are one sequence each.
    dialect
        The dialect of the sequences; None: recognised.

    Raises
    ------
    MisuseError
        There is no such folder, no sequence in it, or a link in it leads out of it.
    """
    sequences = find_sequences(folder, patterns, dialect)
    if not sequences:
        raise MisuseError(f"Expected at least one sequence in {folder}, got none that matches {', '.join(patterns)}")
    return Release(folder, sequences)


def find_sequences(folder: Place, patterns: Iterable[str], dialect: Dialect | None = None) -> tuple[SequenceFile, ...]:
    """Return what matches any pattern and is a sequence, none hidden; raises ``MisuseError`` as ``find_release`` does.

    Files in a folder that is a sequence are parts of it. Of a prefix, each object that matches is a sequence.
    """
    patterns = tuple(patterns)
    if isinstance(folder, Path) and not folder.is_dir():
        raise MisuseError(f"Expected a folder with a release, got: {folder}")
    if isinstance(folder, RemoteFile) and not folder.is_prefix:
        raise MisuseError(f"Expected a folder with a release, or a prefix (s3://bucket/prefix/), got: {folder}")
    for pattern in patterns:
        if not is_plain(pattern):
            raise MisuseError(f"Expected patterns beneath the folder with a release, got {pattern!r}")
    if isinstance(folder, RemoteFile):
        return tuple(
            SequenceFile(each.name, each.place)
            for each in list_objects(folder)
            if any(_matches(PurePosixPath(each.name).parts, PurePosixPath(pattern).parts) for pattern in patterns)
        )
    matching = {path for pattern in patterns for path in folder.glob(pattern)}
    in_folders = {path: sequences_in(path, dialect) for path in matching if path.is_dir() and path != folder}
    folders = {path for path, sequences in in_folders.items() if sequences}
    files = {path for path in matching if path.is_file() and folders.isdisjoint(path.parents)}
    paths = files.union(*in_folders.values())
    names = sorted(path.relative_to(folder).as_posix() for path in paths)
    return tuple(
        SequenceFile(name, inside(folder, name))
        for name in names
        if not any(part.startswith(".") for part in PurePosixPath(name).parts)
    )


def _matches(parts: tuple[str, ...], pattern: tuple[str, ...]) -> bool:
    """Whether a name matches a pattern part by part; ``**`` stands for any number of folders, as in ``Path.glob``."""
    if not pattern or (not parts and pattern != ("**",)):
        return parts == pattern
    if pattern[0] == "**":
        return _matches(parts, pattern[1:]) or (bool(parts) and _matches(parts[1:], pattern))
    return fnmatchcase(parts[0], pattern[0]) and _matches(parts[1:], pattern[1:])


def has_document(folder: Place, name: str) -> bool:
    """Whether a release has a document that is not blank; of an object only the size is looked at."""
    if isinstance(folder, RemoteFile):
        return any(each.name == name and each.size for each in list_objects(folder))
    path = inside(folder, name)
    return path.is_file() and bool(path.read_bytes().strip())


def is_plain(name: str) -> bool:
    """Whether a name is relative, stays where it is on every system, and can be written as UTF-8."""
    path = PurePosixPath(name)
    # A backslash separates folders on Windows; a lone surrogate cannot be written as UTF-8.
    odd = {"\\", "\0"} & set(name) or any("\ud800" <= character <= "\udfff" for character in name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts and not odd


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file by its name in a folder.

    Raises
    ------
    MisuseError
        The name, or a link that it names, leads out of the folder, or cannot be written down.
    """
    if not is_plain(name):
        raise MisuseError(f"Expected the name of a file within {folder}, got {name!r}")
    path = folder / name
    # The name alone does not show where a link leads: the resolved path does.
    if not path.resolve().is_relative_to(folder.resolve()):
        raise MisuseError(f"Expected files within {folder}, got a link that leads out of it: {name!r}")
    return path


@dataclass(frozen=True, slots=True)
class Violation:
    """A rule that the file of this name breaks, and when; ``code`` is the last part of the finding's code."""

    name: str
    code: str
    message: str
    stream: str | None = None
    start_us: float | None = None
    stop_us: float | None = None


@dataclass(frozen=True, slots=True)
class ReleaseResult:
    """The result of one rule.

    Attributes
    ----------
    rule
        The name of the rule among checks, ``release.<rule>``.
    question
        The question that the rule answers.
    about
        ``each``: every sequence has a result; ``FOLDER``: the release has one. The release may break either.
    violations
        Empty where the rule is kept.
    not_applicable
        Why the rule does not apply; empty where it does.
    """

    rule: str
    question: str
    about: Literal["each", "."]
    violations: tuple[Violation, ...] = ()
    not_applicable: str = ""


def with_release_results(name: str, file: FileRecord, release_results: Iterable[ReleaseResult]) -> FileRecord:
    """Return the file with the result of every rule about it; ``name`` is the name of the file in the release."""
    count = sum(len(result.findings) for result in file.results if result.check.startswith("release."))
    results = list(file.results)
    for release_result in release_results:
        broken = [violation for violation in release_result.violations if violation.name == name]
        if not broken and (release_result.about == FOLDER) != (name == FOLDER):
            continue
        rule, question = release_result.rule, release_result.question
        # Numbering continues over all rules, so that the findings of a file have different identifiers.
        findings = tuple(
            Finding(
                f"R{number}",
                f"{rule}.{violation.code}",
                "error",
                violation.message,
                Where(violation.stream, violation.start_us, violation.stop_us),
            )
            for number, violation in enumerate(broken, start=count + 1)
        )
        count += len(findings)
        if release_result.not_applicable:
            results.append(Result(rule, "not_applicable", question, reason=release_result.not_applicable))
        else:
            results.append(Result(rule, "failed" if findings else "passed", question, findings=findings))
    return replace(file, results=tuple(results))
