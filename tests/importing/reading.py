"""Import a recording in this process, and read what was written."""

from pathlib import Path

import h5py

from fedora_qa.importing.run import Imported, ImportOptions, import_recording
from tests.support.prophesee import Event


def quiet(what: str, done: int, of: int) -> None:
    """Report nothing."""


def imported(source: Path, target: Path, options: ImportOptions | None = None) -> Imported:
    """Import a recording, and return what was written."""
    return import_recording(source, target, options or ImportOptions(), quiet)


def events_of(path: Path) -> list[Event]:
    """The events of a file: column, row, time in us, polarity."""
    with h5py.File(path) as file:
        columns = [file[f"path/events/{name}"][:].tolist() for name in "xytp"]
    return list(zip(*columns, strict=True))
