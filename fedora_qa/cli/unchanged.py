"""Hold a record to the file that it is of: one that changed meanwhile was seen partly before and partly after."""

from dataclasses import replace
from typing import Final

from fedora_qa.record.types import FileRecord, Result
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.version import Version, local_version

NAME: Final = "unchanged"
QUESTION: Final = "Did the file stay as it was while it was checked?"


def version_before(place: Place) -> Version | None:
    """Return which version a local file is; None behind a URL, where whoever reads it notices a change."""
    return None if isinstance(place, RemoteFile) else local_version(place)


def hold_to_version(file: FileRecord, place: Place, before: Version | None) -> FileRecord:
    """Return the record, incomplete where the size of its file or the time of its last change is another now.

    A record is of the bytes of one moment, of which it has the digest, and what was read before and after a change is
    of no file that ever was.
    """
    if version_before(place) == before:
        return file
    reason = "Expected the file to stay as it is while it is checked, got a change; check it again"
    return replace(
        file, verdict="incomplete", results=(*file.results, Result(NAME, "crashed", QUESTION, reason=reason))
    )
