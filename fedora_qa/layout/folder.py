"""Match the files of a folder with the roles of a dialect, and keep its HDF5 files open."""

import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any, Final

import h5py

from fedora_qa.errors import MisuseError, UnreadableFileError, first_line
from fedora_qa.layout.dialect import DIALECT_NAMES, FORMS, Dialect, Form, form_of, load_dialect
from fedora_qa.sources.arrays import arrays_of
from fedora_qa.sources.images import images_of, numbers_of
from fedora_qa.sources.source import OutsideRows
from fedora_qa.sources.text import number_table
from fedora_qa.storage.folder import DOCUMENTS, FolderFile, divided_names, levels_above_files, list_files, root_of
from fedora_qa.storage.signature import require_signature

_SHOWN: Final = 2
"""Names of files that a message lists."""

_FEWEST_SEQUENCES: Final = 2
"""Sequences of a folder that lie side by side."""

_MOST_UNUSED: Final = 0.75
"""Share of the files, of formats that are read, from which on most of a folder is unused. Of DSEC the right camera is
half, and two thirds with labels."""

_FEWEST_ROLES: Final = 2
"""Of how many roles a folder has files of other formats than HDF5 where it is meant to be a sequence of the dialect."""


@dataclass(frozen=True, slots=True)
class RoleFiles:
    """The files of one role: the pattern that they match, and their names, all in one folder."""

    pattern: str
    folder: Path
    names: tuple[str, ...]

    @property
    def first(self) -> Path:
        """The first file; of most roles the only one."""
        return self.folder / self.names[0]

    def places(self, root: Path) -> tuple[str, ...]:
        """Return the names of the files relative to the folder of the sequence."""
        return tuple((self.folder / name).relative_to(root).as_posix() for name in self.names)

    @property
    def form(self) -> Form:
        """Format of the files."""
        return form_of(self.names[0])


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
        The files of each role; a role without files is missing.
    unused
        Names of the files without a role, relative to the folder.
    is_named
        Whether the user named the dialect; else it was recognised.
    """

    folder: Path
    dialect: Dialect
    files: Mapping[str, RoleFiles]
    unused: tuple[str, ...] = ()
    is_named: bool = True

    @property
    def unused_data(self) -> tuple[str, ...]:
        """Names of the files without a role in formats that are read."""
        return tuple(name for name in self.unused if PurePosixPath(name).suffix.lower() in FORMS)

    @property
    def is_mostly_unused(self) -> bool:
        """Whether most files in formats that are read have no role."""
        used = sum(len(files.names) for files in self.files.values())
        return len(self.unused_data) > _MOST_UNUSED * (used + len(self.unused_data))

    @property
    def draft_command(self) -> str:
        """What drafts a dialect for the folder."""
        return f"fedora-qa layout {shlex.quote(str(self.folder))} --draft-dialect mine.toml"

    def place(self, role: str) -> str:
        """Return where the files of a role lie, or would: the name of one, the pattern of several or of none."""
        files = self.files.get(role)
        if files is None:
            return self.dialect.files[role][0]
        return files.first.relative_to(self.folder).as_posix() if len(files.names) == 1 else files.pattern

    def missing_files(self, owner: str) -> tuple[str, ...]:
        """Return the patterns of the files that the folder lacks and in which the dialect has parts of a declaration.

        Parameters
        ----------
        owner
            Object of the layout that the declaration belongs to, such as ``metadata/cameras/rgb``.
        """
        roles = self.dialect.roles_of_declaration(owner)
        return tuple(self.place(role) for role in roles if role not in self.files)

    def in_words(self) -> dict[str, str]:
        """Return what each role is, in words, for the record."""
        return {
            role: f"{self.place(role)} ({len(files.names)} files)" if len(files.names) > 1 else self.place(role)
            for role, files in self.files.items()
        }


def match_folder(folder: Path, dialect: Dialect, *, is_named: bool = True) -> MatchedFolder:
    """Return a folder with the roles of its files.

    Raises
    ------
    MisuseError
        The first role has no file, or a role of one file has two; the message names the role and the files.
    """
    return _match_files(folder, list_files(folder), dialect, is_named=is_named)


def _match_files(folder: Path, listed: Sequence[FolderFile], dialect: Dialect, *, is_named: bool) -> MatchedFolder:
    """Return a folder of listed files as ``match_folder``: for several dialects it is listed once."""
    root = root_of(folder)
    levels_above = levels_above_files(folder)
    by_folder = _names_by_folder(listed if root == folder or levels_above else list_files(root))
    others: set[str] = set()
    if root != folder and not levels_above:
        together = _side_by_side(by_folder, dialect)
        if folder.name not in together:
            raise MisuseError(
                f"Expected a sequence of the dialect {dialect.name}, got {folder}, which does not exist"
                + (f"; {root} holds {_listed(together)}" if together else "")
            )
        by_folder = together.pop(folder.name)
        others = {place for names in together.values() for place in _places(names)}
    files, problems = _files_of_roles(root, by_folder, dialect, levels_above)
    if problems:
        raise MisuseError(problems[0])
    used = {place for files_of_role in files.values() for place in files_of_role.places(root)} | others
    unused = tuple(file.name for file in listed if file.name not in used)
    return MatchedFolder(root, dialect, files, unused, is_named)


def _places(by_folder: Mapping[str, list[str]]) -> Iterator[str]:
    return (f"{inside}/{name}" if inside else name for inside, names in by_folder.items() for name in names)


def _listed(names: Collection[str]) -> str:
    return " and ".join(list(names)[:_SHOWN]) + (" and others" if len(names) > _SHOWN else "")


def _side_by_side(by_folder: Mapping[str, list[str]], dialect: Dialect) -> dict[str, dict[str, list[str]]]:
    """Return, by name of sequence, the files that have a role in it, where one folder holds several sequences.

    A sequence has the name of which the first ``*`` in the pattern of the first role takes the place, without
    separators at its ends. A file of another role belongs to the sequence of the same name. A document belongs to those
    whose names begin like its own, the longest of several; the only one belongs to all. It is empty where there are
    fewer than two files of the first role, or none of another, or a file or sequence has no such partner: then two
    files have one role.
    """
    first, *others = (_fitting_first(by_folder, patterns) for patterns in dialect.files.values())
    names = {name: place for place, name in first.items()}
    if len(names) < _FEWEST_SEQUENCES or len(names) < len(first) or "" in names or not any(others):
        return {}
    files = {name: [place] for name, place in names.items()}
    for fitting in others:
        if fitting and all(PurePosixPath(place).suffix.lower() in DOCUMENTS for place in fitting):
            for name, places in files.items():
                fits = [place for place, stem in fitting.items() if stem and name.startswith(stem)]
                if not fits and len(fitting) > 1:
                    return {}
                places.append(max(fits or fitting, key=lambda place: len(fitting[place])))
            continue
        for place, stem in fitting.items():
            if stem not in files:
                return {}
            files[stem].append(place)
    together: dict[str, dict[str, list[str]]] = {}
    for name, places in files.items():
        own = together.setdefault(name, {})
        for place in places:
            inside, _, last = place.rpartition("/")
            own.setdefault(inside, []).append(last)
    return together


def _fitting_first(by_folder: Mapping[str, list[str]], patterns: Sequence[str]) -> dict[str, str]:
    """Return what fits the first pattern that anything fits, and for what the first ``*`` beside a name stands.

    Of ``*_images/*.png`` this is the name of a sequence, and the second ``*`` stands for the number of an image.
    """
    for pattern in patterns:
        if fitting := _fitting(by_folder, pattern):
            parts = pattern.split("/")
            level = next((level for level, part in enumerate(parts) if "*" in part and part != "*"), len(parts) - 1)
            before, _, after = parts[level].partition("*")
            return {
                place: place.split("/")[level].removeprefix(before).removesuffix(after).strip("_-. ")
                if after and not set("*?[") & {*before, *after}
                else ""
                for place in _places(fitting)
            }
    return {}


def _names_by_folder(files: Sequence[FolderFile]) -> dict[str, list[str]]:
    by_folder: dict[str, list[str]] = {}
    for file in files:
        inside, _, name = file.name.rpartition("/")
        by_folder.setdefault(inside, []).append(name)
    return by_folder


def _files_of_roles(
    folder: Path, by_folder: Mapping[str, list[str]], dialect: Dialect, levels_above: int = 0
) -> tuple[dict[str, RoleFiles], list[str]]:
    """Return the files of each role, and why the folder does not fit the dialect, in sentences.

    Parameters
    ----------
    levels_above
        Folders above the files, in which the patterns of the dialect do not begin.
    """
    files: dict[str, RoleFiles] = {}
    problems: list[str] = []
    for role, patterns in dialect.files.items():
        pattern, fitting = next(
            ((pattern, fits) for pattern in patterns if (fits := _fitting(by_folder, pattern, levels_above))), ("", {})
        )
        several = form_of(patterns[0]) in {"images", "array"}
        relative = [f"{inside}/{name}" if inside else name for inside, names in fitting.items() for name in names]
        if len(relative) > 1 and not several:
            problems.append(
                f"Expected one file for {role} of the dialect {dialect.name} in {folder}, got {_listed(relative)}; "
                "give all files of a sequence one name, or move other files out"
            )
        elif len(fitting) > 1:
            named = " and ".join(sorted(fitting)[:_SHOWN])
            problems.append(f"Expected {role} of the dialect {dialect.name} in one folder, got {named} in {folder}")
        elif fitting:
            ((inside, names),) = fitting.items()
            files[role] = RoleFiles(pattern, folder / inside, tuple(names))
        elif role == dialect.first_role:
            wanted = " or ".join(patterns)
            problems.append(f"Expected {wanted} ({role} of the dialect {dialect.name}) in {folder}, got no such file")
    return files, problems


def misfit(folder: Path) -> str:
    """Return why a folder does not fit the dialect of the package of which it has most roles, as a sentence.

    It is empty where the folder has fewer than two roles of it with files of other formats than HDF5: files of HDF5
    may be sequences by themselves. A folder of many files, of which a single name is that of a dialect, is named.
    """
    by_folder = _names_by_folder(list_files(folder))
    for matched in _folders_of_dialects(folder):
        if _is_of_one_name(matched):
            (role,) = matched.files
            unused = matched.unused_data
            return (
                f"Expected more of the dialect {matched.dialect.name} in {folder} than {role} ({matched.place(role)}), "
                f"got {len(unused)} files without a role, such as {unused[0]}; draft a dialect with "
                f"`{matched.draft_command}`"
            )
    sentences: dict[str, int] = {}
    for dialect in map(load_dialect, DIALECT_NAMES):
        files, problems = _files_of_roles(folder, by_folder, dialect)
        roles = sum(each.form != "hdf5" for each in files.values())
        if problems and roles >= _FEWEST_ROLES:
            sentences[problems[0]] = roles
    return max(sentences, key=lambda sentence: sentences[sentence], default="")


def _fitting(by_folder: Mapping[str, list[str]], pattern: str, levels_above: int = 0) -> dict[str, list[str]]:
    """Return the names that fit a pattern, by folder: part by part, so that ``*`` does not stand for a slash."""
    *parts, last = pattern.split("/")
    fitting: dict[str, list[str]] = {}
    for inside, names in by_folder.items():
        folders = inside.split("/")[levels_above:] if inside else []
        if len(folders) == len(parts) and all(map(fnmatchcase, folders, parts)):
            fits = [name for name in names if fnmatchcase(name, last)]
            if fits:
                fitting[inside] = fits
    return fitting


def recognise_folder(folder: Path) -> MatchedFolder | None:
    """Return a folder in the dialect of the package of which it has most roles, the first of equals; None: in none.

    One name, such as ``events_left/events.h5``, identifies no dialect in a folder whose other files it does not read.
    """
    candidates = [matched for matched in _folders_of_dialects(folder) if not _is_of_one_name(matched)]
    return max(candidates, key=lambda matched: len(matched.files), default=None)


def _folders_of_dialects(folder: Path) -> Iterator[MatchedFolder]:
    """Yield a folder in each dialect of the package that it fits."""
    listed = list_files(folder)
    for dialect in map(load_dialect, DIALECT_NAMES):
        if dialect.files:
            try:
                matched = _match_files(folder, listed, dialect, is_named=False)
            except MisuseError:
                continue  # it does not fit this one
            if len(matched.files) >= dialect.fewest_roles:
                yield matched


def _is_of_one_name(matched: MatchedFolder) -> bool:
    return len(matched.files) == 1 and matched.is_mostly_unused


def matched_folder(folder: Path, dialect: Dialect | None) -> MatchedFolder | None:
    """Return a folder with the roles of its files; None where it fits no dialect, or one of single files was named.

    Raises
    ------
    MisuseError
        It does not fit the dialect that was named; or it cannot be listed.
    """
    is_divided = levels_above_files(folder) > 0
    if root_of(folder) == folder or is_divided:
        if dialect is None:
            matched = recognise_folder(folder)
        else:
            matched = match_folder(folder, dialect) if dialect.files else None
        if matched is None and is_divided:
            raise MisuseError(f"Expected a file or a folder, got a path that does not exist: {folder}")
        return matched
    is_named = dialect is not None
    # Its neighbours decide with it, so that all sequences of a folder are read in one dialect.
    dialect = dialect if dialect and dialect.files else _dialect_of_several(folder.parent, dialect)
    if dialect is None:
        raise MisuseError(f"Expected a file or a folder, got a path that does not exist: {folder}")
    return match_folder(folder, dialect, is_named=is_named)


def is_sequence(folder: Path, dialect: Dialect | None) -> bool:
    """Whether a folder is one sequence, in the dialect or, where that is None, in one of the package."""
    try:
        return matched_folder(folder, dialect) is not None
    except MisuseError:
        return False


def sequences_in(folder: Path, dialect: Dialect | None) -> tuple[Path, ...]:
    """Return the sequence that a folder is, or ``FOLDER/NAME`` of each of several that lie in it.

    These are sequences whose roles are divided among folders ``FOLDER/*/NAME``, or else sequences whose files lie in
    the folder side by side. It is empty where the folder does not fit the dialect, or, where that is None, none of the
    package.

    Raises
    ------
    MisuseError
        A role has two files whose names do not name two sequences, or the folder cannot be listed.
    """
    if is_sequence(folder, dialect):
        return (folder,)
    if divided := tuple(folder / name for name in divided_names(folder) if _is_divided(folder / name, dialect)):
        return divided
    several = _dialect_of_several(folder, dialect)
    if several is None:
        return ()
    if not (together := _side_by_side(_names_by_folder(list_files(folder)), several)):
        match_folder(folder, several)  # raises which role has two files
    return tuple(folder / name for name in sorted(together))


def _is_divided(sequence: Path, dialect: Dialect | None) -> bool:
    """Whether a sequence has roles in several of the folders of its name: one of them alone is less of a sequence."""
    try:
        matched = matched_folder(sequence, dialect)
    except MisuseError:
        return False
    files = matched.files.values() if matched else ()
    return len({each.folder.relative_to(sequence.parent).parts[0] for each in files}) > 1


def _dialect_of_several(folder: Path, dialect: Dialect | None) -> Dialect | None:
    """Return the dialect of which a folder has most roles, where one role has two files; None: of none enough."""
    by_folder = _names_by_folder(list_files(folder))
    most, best = 0, None
    for candidate in (dialect,) if dialect else map(load_dialect, DIALECT_NAMES):
        if not candidate.files or not _fitting_first(by_folder, candidate.files[candidate.first_role]):
            continue
        roles = sum(bool(_fitting_first(by_folder, patterns)) for patterns in candidate.files.values())
        is_meant = dialect is not None or roles >= max(candidate.fewest_roles, _FEWEST_ROLES)
        if is_meant and roles > most and _files_of_roles(folder, by_folder, candidate)[1]:
            most, best = roles, candidate
    return best


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
            for role, files in matched.files.items():
                if files.form != "hdf5":
                    continue
                require_signature(files.first)
                try:
                    self.hdf5[role] = opened.enter_context(
                        h5py.File(files.first, "r", locking="best-effort", **options)
                    )
                except OSError as error:
                    raise UnreadableFileError(
                        f"Expected a complete HDF5 file, got {files.first.name}: {first_line(error)}"
                    ) from error
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close all files."""
        self._opened.close()

    def source(self, role: str, path: str, *, of_names: bool, is_joined: bool = False) -> OutsideRows | None:
        """Return the rows of a role that is not HDF5; None where it has no file, or no array of this name.

        Parameters
        ----------
        path
            Name of an array in NPZ, or a pattern of names.
        of_names
            Whether the numbers in the names of images are meant, which are timestamps.
        is_joined
            Whether several arrays of NumPy lie end to end; else each is a row.

        Raises
        ------
        SourceError, OSError
            The file cannot be read.
        """
        files = self.matched.files.get(role)
        if files is None:
            return None
        if files.form == "images":
            return numbers_of(files.folder, files.names) if of_names else images_of(files.folder, files.names)
        if files.form == "text":
            return number_table(files.first)
        return arrays_of(files.folder, files.names, path, is_joined=is_joined)
