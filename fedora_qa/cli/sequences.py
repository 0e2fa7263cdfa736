"""Find the sequences that arguments name: files, folders that are one sequence, and sequences in folders."""

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Final

from fedora_qa.errors import MisuseError
from fedora_qa.storage.folder import is_folder, list_files, part_folders, require_readable
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.server import list_objects
from fedora_qa.storage.signature import require_signature

if TYPE_CHECKING:  # commands that are given no folder load no HDF5 here
    from fedora_qa.layout.dialect import Dialect, DialectChoice

HDF5_SUFFIXES: Final = frozenset({".h5", ".hdf5"})

_NAMED: Final = 3
"""Sequences that a message names."""

_DEEPEST: Final = 8
"""Folders within folders in which sequences are looked for."""


def sequences_of(places: Sequence[Place], choice: "DialectChoice") -> tuple[Place, ...]:
    """Return the sequences that arguments name.

    A folder that fits a dialect with files is one sequence. Where its files are those of several, each is meant, as
    ``FOLDER/NAME``, which names one of them as an argument as well; so is a sequence that is divided among folders
    ``FOLDER/*/NAME``. Of another folder, every sequence below it is meant: files of HDF5, and folders that fit; of a
    prefix of an object store, every HDF5 file. A folder without any is returned as it is, so that its record states
    that no dialect fits.

    Raises
    ------
    MisuseError
        A path is missing, given twice, or not HDF5, or a file of a folder may not be read; or a folder can be read in
        two ways, or has no files.
    """
    from fedora_qa.layout.dialect import split_choice  # noqa: PLC0415 - loads HDF5
    from fedora_qa.layout.folder import matched_folder  # noqa: PLC0415 - loads HDF5

    sequences: list[Place] = []
    for place in places:
        if isinstance(place, Path) and place.is_dir():
            sequences += _in_folder(place, choice)
        elif isinstance(place, Path) and is_folder(place):
            matched_folder(place, split_choice(choice)[0])  # raises where there is no such sequence
            sequences.append(place)
        elif isinstance(place, RemoteFile) and place.is_prefix:
            sequences += _below_prefix(place)
        else:
            sequences.append(place)
    require_hdf5([place for place in sequences if not (isinstance(place, Path) and is_folder(place))])
    for place in sequences:
        if isinstance(place, Path) and is_folder(place):
            require_readable(place)
    _require_each_once(sequences, "sequence")
    return tuple(sequences)


def require_one_sequence(path: Path, choice: "DialectChoice") -> None:
    """Raise ``MisuseError`` before any work where a path is neither an HDF5 file nor a folder that is one sequence."""
    if not is_folder(path):
        require_hdf5([path])
        return
    sequences = sequences_of([path], choice)
    if sequences != (path,):
        names = ", ".join(map(str, sequences[:_NAMED])) + (", ..." if len(sequences) > _NAMED else "")
        raise MisuseError(f"Expected one sequence, got {path}, which holds {len(sequences)}; name one of {names}")


def require_hdf5(files: Sequence[Place]) -> None:
    """Raise ``MisuseError`` before any work where a path is missing, given twice, or not an HDF5 file.

    Only the first bytes of a file are read here: HDF5 may crash on the rest, so that other processes read it.
    """
    _require_each_once(files, "file")
    for path in files:
        require_signature(path)


def _require_each_once(places: Sequence[Place], kind: str) -> None:
    for place, count in Counter(places).items():
        if count > 1:
            raise MisuseError(f"Expected each {kind} once, got {place} {count} times")


def _below_prefix(prefix: RemoteFile) -> list[RemoteFile]:
    """Return the objects below a prefix that are named like HDF5; of a store, folders of other files are not read."""
    objects = list_objects(prefix)
    sequences = [each.place for each in objects if PurePosixPath(each.name).suffix.lower() in HDF5_SUFFIXES]
    if not sequences:
        raise MisuseError(
            f"Expected HDF5 files ({', '.join(sorted(HDF5_SUFFIXES))}) below {prefix}, got {len(objects)} other objects"
        )
    return sequences


def _in_folder(folder: Path, choice: "DialectChoice") -> list[Path]:
    from fedora_qa.layout.dialect import split_choice  # noqa: PLC0415 - loads HDF5
    from fedora_qa.layout.folder import match_folder, matched_folder, misfit, sequences_in  # noqa: PLC0415 - loads HDF5

    dialect, _ = split_choice(choice)
    below = list(_below(folder, dialect, _DEEPEST))
    within = [path for path in below if is_folder(path)]
    try:
        sequences = list(sequences_in(folder, dialect))
    except MisuseError:
        # It may be a folder of sequences; a role with two files is an error where no other folder fits.
        if not within:
            raise
        return below
    if not sequences:
        if dialect and dialect.files and not below:
            match_folder(folder, dialect)  # raises why it does not fit
        # Images and tables beside a file of HDF5 make that file no sequence by itself.
        if dialect is None and not within and (sentence := misfit(folder)):
            raise MisuseError(f"{sentence}; complete the folder, or describe it (--dialect)")
        if not below and not list_files(folder):
            raise MisuseError(f"Expected a sequence, or a folder of sequences, got a folder without files: {folder}")
        return below or [folder]
    if part_folders(sequences[0]):
        return [*sequences, *_undivided(folder, below, sequences)]
    if within:
        dialect_name = matched.dialect.name if (matched := matched_folder(sequences[0], dialect)) else ""
        held = "is one" if sequences == [folder] else "holds several"
        raise MisuseError(
            f"Expected one sequence or a folder of sequences, got {folder}, which {held} in the dialect {dialect_name} "
            f"and holds another, {within[0]}; name the one that is meant"
        )
    for sequence in sequences:
        matched = matched_folder(sequence, dialect)
        for files in matched.files.values() if matched else ():
            if files.form == "hdf5":
                require_signature(files.first)
    return sequences


def _below(folder: Path, dialect: "Dialect | None", levels: int) -> Iterator[Path]:
    """Yield the sequences in a folder, none hidden, in the order of their names."""
    from fedora_qa.layout.folder import sequences_in  # noqa: PLC0415 - loads HDF5

    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except OSError as error:
        raise MisuseError(f"Expected a folder that can be read, got {error.strerror or error}: {folder}") from error
    for entry in entries:
        path = folder / entry.name
        if entry.name.startswith("."):
            continue
        # Links to folders may lead in circles, or out.
        if entry.is_dir(follow_symlinks=False) and levels:
            try:
                sequences = sequences_in(path, dialect)
            except MisuseError:
                deeper = list(_below(path, dialect, levels - 1))
                if not any(map(is_folder, deeper)):
                    raise
                yield from deeper
            else:
                yield from sequences
                if not sequences:
                    yield from _below(path, dialect, levels - 1)
                elif part_folders(sequences[0]):
                    yield from _undivided(path, _below(path, dialect, levels - 1), sequences)
        elif path.suffix.lower() in HDF5_SUFFIXES and entry.is_file() and not (dialect and dialect.files):
            yield path


def _undivided(folder: Path, below: Iterable[Path], divided: Sequence[Path]) -> Iterator[Path]:
    """Yield the sequences below a folder that are no part of those which are divided among ``FOLDER/*/NAME``."""
    names = {sequence.name for sequence in divided}
    return (path for path in below if names.isdisjoint(path.relative_to(folder).parts[1:2]))
