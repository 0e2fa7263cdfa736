"""The version of a file, without reading the file."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from fedora_qa.storage.folder import list_files


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
    if path.is_dir():
        files = list_files(path)
        facts = "".join(f"{file.name}\0{file.size}\0{file.changed_ns}\n" for file in files)
        return Version(sum(file.size for file in files), hashlib.sha256(facts.encode()).hexdigest())
    try:
        status = path.stat()
    except OSError:
        return Version(0, "")  # opening the file raises the reason
    return Version(status.st_size, str(status.st_mtime_ns))
