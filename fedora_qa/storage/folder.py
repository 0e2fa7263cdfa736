"""The files of a folder that is read as one sequence, and the version of a file or folder. No file is opened.

A folder may hold the files of several sequences side by side. ``FOLDER/NAME``, where no file has this name, stands for
the sequence of those whose names have NAME as a word, such as ``NAME_data.h5``. The documents of the folder belong to
each of them.

A sequence may also be divided among folders: archives of events and of images, each unpacked into a folder of its own.
``FOLDER/NAME`` then stands for all files below ``FOLDER/*/NAME``, of which there are at least two.
"""

import hashlib
import os
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from fedora_qa.errors import MisuseError

MOST_FILES: Final = 200_000
"""Files below one folder: an hour of images at 50 Hz has 180,000."""

DEEPEST: Final = 8
"""Folders within folders; DSEC has three."""

DOCUMENTS: Final = frozenset({".yaml", ".yml", ".toml", ".json"})
"""Endings of names of documents, such as a calibration, which several sequences may share."""

_FEWEST_PARTS: Final = 2
_MOST_PARTS: Final = 16
"""Folders among which a divided sequence is divided. More folders of one name, such as ``images``, are those of as many
sequences: a dialect seldom has more roles."""

_LEVELS_ABOVE_A_PART: Final = 2
"""Of ``FOLDER/*/NAME``: the folder of the part, and that of the sequence in it."""


def is_folder(path: Path) -> bool:
    """Whether a path is a folder, or stands for files of its parent that are one sequence."""
    if path.is_dir():
        return True
    return path.parent.is_dir() and not os.path.lexists(path) and (_has_names_of(path) or bool(part_folders(path)))


def part_folders(path: Path) -> tuple[Path, ...]:
    """Return the folders ``FOLDER/*/NAME`` for which ``FOLDER/NAME`` stands; none where it stands for other files."""
    if os.path.lexists(path) or path.name.startswith("."):
        return ()
    within = (folder / path.name for folder in _folders_in(path.parent))
    parts = tuple(part for part in within if part.is_dir() and not part.is_symlink())
    return parts if _FEWEST_PARTS <= len(parts) <= _MOST_PARTS else ()


def levels_above_files(folder: Path) -> int:
    """Return how many folders in names of ``list_files`` lie above the layout of a sequence: two of a divided one."""
    return _LEVELS_ABOVE_A_PART if part_folders(folder) else 0


def divided_names(folder: Path) -> tuple[str, ...]:
    """Return each NAME for which ``FOLDER/NAME`` stands for several folders ``FOLDER/*/NAME``."""
    counts = Counter(part.name for within in _folders_in(folder) for part in _folders_in(within))
    return tuple(
        name
        for name in sorted(counts)
        if _FEWEST_PARTS <= counts[name] <= _MOST_PARTS and not os.path.lexists(folder / name)
    )


def _folders_in(folder: Path) -> list[Path]:
    """Return the folders in a folder by name, without links and hidden ones; none where it may not be listed."""
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if entry.is_dir(follow_symlinks=False)]
    except OSError:
        return []  # opening it raises the reason
    return [folder / name for name in sorted(names) if not name.startswith(".") and name.isprintable()]


def root_of(path: Path) -> Path:
    """Return the folder to which the names of ``list_files`` are relative."""
    return path if path.is_dir() or not is_folder(path) else path.parent


def _has_names_of(path: Path) -> bool:
    try:
        return any(_is_of(path.name, file.name) for file in path.parent.iterdir())
    except OSError:
        return False  # opening it raises the reason


def _is_of(sequence: str, name: str) -> bool:
    """Whether a file's name has that of a sequence as a word: ``run1_data.h5`` that of ``run1``, not of ``run``."""
    letter = "[0-9A-Za-z]"
    return re.search(f"(?<!{letter}){re.escape(sequence)}(?!{letter})", name) is not None


@dataclass(frozen=True, slots=True)
class FolderFile:
    """A file below a folder; ``name`` is relative to it, with slashes."""

    name: str
    size: int
    changed_ns: int


def list_files(folder: Path) -> tuple[FolderFile, ...]:
    """Return the regular files below a folder, in the order of their names; or those of one sequence in it.

    Hidden files and folders are left out: programs keep their own there. A link to a file counts as that file if it
    lies in the folder as well. Links to folders, and links that lead nowhere or out, are left out: a folder must not
    decide which files outside of it are read.

    Raises
    ------
    MisuseError
        There is no such folder, it may not be read, or it holds more than ``MOST_FILES``.
    """
    if parts := part_folders(folder):
        files = [
            FolderFile((part.relative_to(folder.parent) / file.name).as_posix(), file.size, file.changed_ns)
            for part in parts
            for file in list_files(part)
        ]
        return tuple(sorted(files, key=lambda file: file.name))
    if not folder.is_dir() and is_folder(folder):
        return tuple(
            file
            for file in list_files(folder.parent)
            if _is_of(folder.name, file.name) or PurePosixPath(file.name).suffix.lower() in DOCUMENTS
        )
    files = []
    root = Path(os.path.realpath(folder))
    waiting = [("", 0)]
    try:
        while waiting:
            inside, depth = waiting.pop()
            with os.scandir(folder / inside) as entries:
                for entry in entries:
                    name = f"{inside}/{entry.name}" if inside else entry.name
                    # A name that is no UTF-8 is in no dialect, and cannot be written into a record.
                    if entry.name.startswith(".") or not entry.name.isprintable():
                        continue
                    if entry.is_symlink() and not _leads_into(root, entry.path):
                        continue
                    if entry.is_dir(follow_symlinks=False):
                        if depth < DEEPEST:
                            waiting.append((name, depth + 1))
                    elif entry.is_file():
                        status = entry.stat()
                        files.append(FolderFile(name, status.st_size, status.st_mtime_ns))
                        if len(files) > MOST_FILES:
                            raise MisuseError(f"Expected {MOST_FILES} files at most below {folder}, got more")
    except OSError as error:
        raise MisuseError(f"Expected a folder that can be read, got {error.strerror or error}: {folder}") from error
    return tuple(sorted(files, key=lambda file: file.name))


def _leads_into(root: Path, link: str) -> bool:
    """Whether a link leads to something below a folder; one that leads nowhere, or to itself, does not."""
    try:
        return Path(os.path.realpath(link, strict=True)).is_relative_to(root)
    except OSError:
        return False


def require_readable(folder: Path) -> None:
    """Raise ``MisuseError`` where a file of a folder, or of one sequence in it, may not be read."""
    root = root_of(folder)
    for file in list_files(folder):
        if not os.access(root / file.name, os.R_OK):
            raise MisuseError(f"Expected a readable file, got Permission denied: {root / file.name}")


@dataclass(frozen=True, slots=True)
class Version:
    """Size in bytes, and what else changes with the content.

    ``tag`` is the time of the last change (ns) of a local file, the ETag of one behind a URL, or where there is none
    the time of its last change; empty where the server gives nothing. Of a folder ``size`` is the sum over its files,
    and ``tag`` a digest of their names, sizes and times of change.
    """

    size: int
    tag: str


def local_version(path: Path) -> Version:
    """Return the version of a file or folder on this machine; without access to a file size and tag are empty.

    Raises
    ------
    MisuseError
        It is a folder that cannot be listed.
    """
    if is_folder(path):
        files = list_files(path)
        facts = "".join(f"{file.name}\0{file.size}\0{file.changed_ns}\n" for file in files)
        return Version(sum(file.size for file in files), hashlib.sha256(facts.encode()).hexdigest())
    try:
        status = path.stat()
    except OSError:
        return Version(0, "")  # opening the file raises the reason
    return Version(status.st_size, str(status.st_mtime_ns))
