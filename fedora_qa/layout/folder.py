"""Match the files of a folder with the roles of a dialect, and keep its HDF5 files open."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

import h5py

from fedora_qa.errors import MisuseError, UnreadableFileError
from fedora_qa.layout.dialect import DIALECT_NAMES, Dialect, form_of, load_dialect
from fedora_qa.sources.arrays import npy_array, npy_frames, npz_array
from fedora_qa.sources.images import images_of, numbers_of
from fedora_qa.sources.source import OutsideRows
from fedora_qa.sources.text import number_table
from fedora_qa.storage.folder import list_files
from fedora_qa.storage.signature import require_signature

_SHOWN: Final = 2
"""Names of files that a message lists."""


@dataclass(frozen=True, slots=True)
class MatchedFolder:
    """A folder that fits a dialect.

    Attributes
    ----------
    folder
        The folder.
    dialect
        The dialect whose roles its files have.
    files
        The files of each role, in the order of their names; a role without files is missing.
    unused
        Names of the files without a role.
    is_named
        Whether the user named the dialect; else it was recognised.
    """

    folder: Path
    dialect: Dialect
    files: Mapping[str, tuple[Path, ...]]
    unused: tuple[str, ...] = ()
    is_named: bool = True

    def pattern(self, role: str) -> str:
        """Return the pattern of a role that matched, or its first."""
        patterns = self.dialect.files[role]
        names = [path.relative_to(self.folder).as_posix() for path in self.files.get(role, ())]
        return next((pattern for pattern in patterns if names and matches(names[0], pattern)), patterns[0])

    def in_words(self) -> dict[str, str]:
        """Return what each role is, in words, for the record."""
        return {
            role: paths[0].relative_to(self.folder).as_posix()
            if len(paths) == 1
            else f"{self.pattern(role)} ({len(paths)} files)"
            for role, paths in self.files.items()
        }


def matches(name: str, pattern: str) -> bool:
    """Whether a relative name fits a pattern, part by part: ``*`` does not stand for a slash."""
    parts, wanted = name.split("/"), pattern.split("/")
    return len(parts) == len(wanted) and all(map(fnmatchcase, parts, wanted))


def match_folder(folder: Path, dialect: Dialect, *, is_named: bool = True) -> MatchedFolder:
    """Return a folder with the roles of its files.

    Raises
    ------
    MisuseError
        The first role has no file, or a role of one file has two; the message names the role and the files.
    """
    names = [file.name for file in list_files(folder)]
    files: dict[str, tuple[Path, ...]] = {}
    used: set[str] = set()
    for role, patterns in dialect.files.items():
        fitting = next((fit for pattern in patterns if (fit := [name for name in names if matches(name, pattern)])), [])
        several = form_of(patterns[0]) == "images" or patterns[0].lower().endswith(".npy")
        if len(fitting) > 1 and not several:
            named = " and ".join(fitting[:_SHOWN]) + (" and others" if len(fitting) > _SHOWN else "")
            raise MisuseError(f"Expected one file for {role} of the dialect {dialect.name} in {folder}, got {named}")
        if not fitting:
            continue
        folders = {name.rpartition("/")[0] for name in fitting}
        if len(folders) > 1:
            named = " and ".join(sorted(folders)[:_SHOWN])
            raise MisuseError(f"Expected {role} of the dialect {dialect.name} in one folder, got {named} in {folder}")
        used.update(fitting)
        files[role] = tuple(folder / name for name in fitting)
    if dialect.first_role not in files:
        wanted = " or ".join(dialect.files[dialect.first_role])
        raise MisuseError(
            f"Expected {wanted} ({dialect.first_role} of the dialect {dialect.name}) in {folder}, got no such file"
        )
    unused = tuple(name for name in names if name not in used)
    return MatchedFolder(folder, dialect, files, unused, is_named)


def recognise_folder(folder: Path) -> MatchedFolder | None:
    """Return a folder in the dialect of the package of which it has most roles, the first of equals; None: in none."""
    candidates: list[MatchedFolder] = []
    for dialect in map(load_dialect, DIALECT_NAMES):
        if dialect.files:
            try:
                candidates.append(match_folder(folder, dialect, is_named=False))
            except MisuseError:
                continue  # it does not fit this one
    return max(candidates, key=lambda matched: len(matched.files), default=None)


def matched_folder(folder: Path, dialect: Dialect | None) -> MatchedFolder | None:
    """Return a folder with the roles of its files; None where it fits no dialect, or one of single files was named.

    Raises
    ------
    MisuseError
        It does not fit the dialect that was named; or it cannot be listed.
    """
    if dialect is None:
        return recognise_folder(folder)
    return match_folder(folder, dialect) if dialect.files else None


def is_sequence(folder: Path, dialect: Dialect | None) -> bool:
    """Whether a folder is one sequence, in the dialect or, where that is None, in one of the package."""
    try:
        return matched_folder(folder, dialect) is not None
    except MisuseError:
        return False


class OpenFolder:
    """A matched folder whose HDF5 files are open until it is closed.

    Raises
    ------
    NotHdf5Error, MisuseError
        A file that should be HDF5 is not.
    UnreadableFileError
        It begins like HDF5 and cannot be opened.
    """

    def __init__(self, matched: MatchedFolder, **options: Any) -> None:
        self.matched = matched
        self.hdf5: dict[str, h5py.File] = {}
        with ExitStack() as opened:
            for role, paths in matched.files.items():
                if form_of(paths[0].name) != "hdf5":
                    continue
                require_signature(paths[0])
                try:
                    self.hdf5[role] = opened.enter_context(h5py.File(paths[0], "r", locking="best-effort", **options))
                except OSError as error:
                    first = (str(error).splitlines() or [type(error).__name__])[0]
                    raise UnreadableFileError(f"Expected a complete HDF5 file, got {paths[0].name}: {first}") from error
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close all files."""
        self._opened.close()

    def source(self, role: str, path: str, *, of_names: bool) -> OutsideRows | None:
        """Return the rows of a role that is not HDF5; None where it has no file, or no array of this name.

        Parameters
        ----------
        path
            Name of an array in NPZ.
        of_names
            Whether the numbers in the names of images are meant, which are timestamps.

        Raises
        ------
        SourceError, OSError
            The file cannot be read.
        """
        paths = self.matched.files.get(role)
        if not paths:
            return None
        form = form_of(paths[0].name)
        if form == "images":
            return numbers_of(paths) if of_names else images_of(paths)
        if form == "text":
            return number_table(paths[0])
        if paths[0].suffix.lower() == ".npz":
            return npz_array(paths[0], path)
        return npy_array(paths[0]) if len(paths) == 1 else npy_frames(paths)
