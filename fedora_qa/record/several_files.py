"""What the files of a record are together: their gravest verdict, and the release that a gate judged."""

from collections.abc import Iterable
from pathlib import PurePath
from typing import Final

from fedora_qa.record.types import FileRecord, Record, Verdict

FOLDER: Final = "."
"""The name of the release itself, beside those of its files."""


def gravest_verdict(files: Iterable[FileRecord]) -> Verdict:
    """Return the gravest verdict of files: incomplete before findings before clean."""
    verdicts = {file.verdict for file in files}
    gravest_first: tuple[Verdict, ...] = ("incomplete", "findings", "clean")
    # Without files nothing was tested: incomplete.
    return next((verdict for verdict in gravest_first if verdict in verdicts), "incomplete")


def names_in_release(record: Record) -> tuple[str, ...]:
    """Return the names of the files of a gate's record, with their folders; empty for any other record.

    The release itself comes last, by the name ``FOLDER``.
    """
    if not record.files or not any(result.check.startswith("release.") for result in record.files[-1].results):
        return ()
    *files, release = record.files
    paths = [PurePath(file.path) for file in files]
    if not all(path.is_relative_to(release.path) for path in paths):
        return ()
    return (*(path.relative_to(release.path).as_posix() for path in paths), FOLDER)
