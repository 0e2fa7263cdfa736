"""Open a sequence from Python."""

from collections.abc import Sequence
from os import fspath

from fedora_qa.api.options import AnyPath, folder_texts, path_text
from fedora_qa.cli.settings import external_folders
from fedora_qa.layout.dialect import load_choice
from fedora_qa.sequence.sequence import Sequence as OpenSequence
from fedora_qa.sequence.sequence import open_sequence as open_place
from fedora_qa.storage.place import place_of


def open_sequence(
    path: AnyPath,
    *,
    dialect: AnyPath | None = None,
    metadata: AnyPath | None = None,
    allow_external: Sequence[AnyPath] = (),
) -> OpenSequence:
    """Open a file, or a folder of files that are one sequence, and read its rows in canonical units.

    Nothing is read but the layout and the metadata, until rows are asked for; nothing is ever written.

    Parameters
    ----------
    path
        An HDF5 file, on this machine or behind a URL; or a folder on this machine.
    dialect
        How the sequence names and scales its data: a name, or a TOML file; None: as it is recognised.
    metadata
        A TOML file whose table ``[metadata]`` declares what the sequence does not declare.
    allow_external
        Folders with other files that a local file may link to, or consist of.

    Returns
    -------
    Sequence
        A context manager. ``rows(key, start, stop)`` returns (stop - start, ...) rows of the dataset of a canonical
        key; timestamps are int64 ns from ``origin_ns``.

    Raises
    ------
    MisuseError
        No such file, not HDF5 at all, a folder that does not fit the dialect, or an illegal option.
    UnreadableFileError
        The file begins like HDF5 and cannot be opened.
    """
    place = place_of(fspath(path))
    choice = load_choice(path_text(dialect), path_text(metadata))
    return open_place(place, choice, allow_external=external_folders(folder_texts(allow_external) or ()))
