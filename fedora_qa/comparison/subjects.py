"""The input of a comparison: files with their statistics, distributions and records."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from numpy.typing import NDArray

from fedora_qa.comparison.distributions import SampledCounts
from fedora_qa.comparison.types import ComparedFile, Design, Subject
from fedora_qa.record.types import FileRecord, Scalar


@dataclass(frozen=True, slots=True)
class KeptArrays:
    """Where the evidence of a file lies: in the file ``path``, under names that begin with ``prefix``."""

    path: Path
    prefix: str


@dataclass(frozen=True, slots=True)
class FileInput:
    """One file.

    ``record`` is None where it was not checked, ``sampled`` where its distributions are unknown, ``kept`` where no
    evidence lies beside its record.
    """

    path: str
    statistics: Mapping[str, Mapping[str, Scalar]]
    sampled: SampledCounts | None
    record: FileRecord | None = None
    kept: KeptArrays | None = None


@dataclass(frozen=True, slots=True)
class SubjectInput:
    """The files that one argument names."""

    name: str
    files: tuple[FileInput, ...]

    @property
    def by_name(self) -> Mapping[str, FileInput]:
        """The files by the end of their path, or the whole of it where two have the same end."""
        ends = [PurePath(file.path).name for file in self.files]
        return {end if ends.count(end) == 1 else file.path: file for end, file in zip(ends, self.files, strict=True)}

    @property
    def subject(self) -> Subject:
        """The subject as the document holds it."""
        return Subject(
            self.name,
            tuple(
                ComparedFile(name, file.path, file.statistics, file.record.verdict if file.record else None)
                for name, file in self.by_name.items()
            ),
        )


@dataclass(frozen=True, slots=True)
class Match:
    """One file in two versions."""

    name: str
    before: FileInput
    after: FileInput


def design_of(before: SubjectInput, after: SubjectInput) -> Design:
    """Return what two subjects are to each other: versions where files have the same names, else what they hold."""
    if before.by_name.keys() & after.by_name.keys():
        return "versions"
    return "sequences" if len(before.files) == len(after.files) == 1 else "datasets"


def matches(before: SubjectInput, after: SubjectInput) -> tuple[Match, ...]:
    """Return the files that are in both, by name; two single files are versions of each other whatever their names."""
    if len(before.files) == len(after.files) == 1:
        names = [*before.by_name, *after.by_name]
        return (Match(" → ".join(dict.fromkeys(names)), before.files[0], after.files[0]),)
    others = after.by_name
    return tuple(Match(name, file, others[name]) for name, file in before.by_name.items() if name in others)


@dataclass(frozen=True, slots=True)
class SharedFile:
    """A file that several subjects have, None for those that lack it; in the order of the subjects."""

    name: str
    files: tuple[FileInput | None, ...]


@dataclass(frozen=True, slots=True)
class SharedEvidence:
    """The evidence of a shared file by the names of ``fedora_qa.record.evidence``, for each subject.

    None for a subject that lacks the file, and nothing for one that kept no evidence of it.
    """

    name: str
    arrays: tuple[Mapping[str, NDArray[Any]] | None, ...]


def shared_files(inputs: Sequence[SubjectInput]) -> tuple[SharedFile, ...]:
    """Return the files of the first subject that another has as well; single files are one, whatever their names."""
    if all(len(subject.files) == 1 for subject in inputs):
        name = " · ".join(dict.fromkeys(name for subject in inputs for name in subject.by_name))
        return (SharedFile(name, tuple(subject.files[0] for subject in inputs)),)
    by_name = [subject.by_name for subject in inputs]
    return tuple(
        SharedFile(name, tuple(files.get(name) for files in by_name))
        for name in by_name[0]
        if any(name in files for files in by_name[1:])
    )


def labels(paths: Sequence[str]) -> tuple[str, ...]:
    """Return a short name for each path: its end, with as many folders before it as distinguish it."""
    parts = [PurePath(path).parts or (path,) for path in paths]
    names: list[str] = []
    for part in parts:
        # The fewest parts from the end that no other path ends in.
        lengths = range(1, len(part) + 1)
        length = next((n for n in lengths if sum(other[-n:] == part[-n:] for other in parts) == 1), len(part))
        names.append("/".join(part[-length:]).replace("//", "/"))
    return tuple(names)
