"""The version of a file, without reading the file."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Version:
    """Size in bytes, and what else changes with the content.

    ``tag`` is the time of the last change (ns) of a local file, the ETag of one behind a URL, or where there is none
    the time of its last change; empty where the server gives nothing.
    """

    size: int
    tag: str


def local_version(path: Path) -> Version:
    """Return the version of a file on this machine; without access size and tag are empty."""
    try:
        status = path.stat()
    except OSError:
        return Version(0, "")  # opening the file raises the reason
    return Version(status.st_size, str(status.st_mtime_ns))
