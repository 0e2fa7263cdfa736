"""Mark a record incomplete if its file changed meanwhile: parts were read before the change, parts after it."""

from dataclasses import replace
from typing import Final

from fedora_qa.record.types import FileRecord, Result
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.version import Version, local_version

NAME: Final = "unchanged"
QUESTION: Final = "Did the file stay as it was while it was checked?"


def version_before(place: Place) -> Version | None:
    """Return the version of a local file; None behind a URL, where reading detects a change."""
    return None if isinstance(place, RemoteFile) else local_version(place)


def hold_to_version(file: FileRecord, place: Place, before: Version | None) -> FileRecord:
    """Return the record, incomplete if the size or the time of the last change of its file differs now.

    A record and its digest belong to one content; data read partly before and partly after a change belong to none.
    """
    if version_before(place) == before:
        return file
    reason = "Expected the file to stay as it is while it is checked, got a change; check it again"
    # As a crashed result every format shows it, with the exit code of an incomplete run.
    return replace(
        file, verdict="incomplete", results=(*file.results, Result(NAME, "crashed", QUESTION, reason=reason))
    )
