"""Before HDF5 opens a file: whether it begins like HDF5, and how long the opening may take."""

import math
import os
from contextlib import closing
from typing import BinaryIO, Final

from fedora_qa.errors import MisuseError, NotHdf5Error
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.remote_bytes import RemoteBytes

_SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
_LARGEST_USER_BLOCK: Final = 1 << 20

_OTHER_FORMATS: Final = (
    (b"PK\x03\x04", "a ZIP archive; unpack it first"),
    (b"\x1f\x8b", "a gzip archive; unpack it first"),
    (b"\xfd7zXZ", "an xz archive; unpack it first"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive; unpack it first"),
    (b"\x89PNG", "a PNG image; give the folder of the sequence"),
    (b"\x93NUMPY", "an array of NumPy; give the folder of the sequence"),
    (b"CDF", "a netCDF 3 file"),
    (b"#AEDAT", "an AEDAT recording"),
    (b"#!AER-DAT", "an AEDAT recording"),
    (b"#ROSBAG", "a ROS bag"),
    (b"\x89MCAP", "an MCAP recording"),
)
"""First bytes of other formats that are given in place of HDF5, and what they are."""

_TEXT: Final = frozenset(b"\t\n\r" + bytes(range(0x20, 0x7F)))
"""Bytes of text."""

_TEXT_FILE: Final = (
    "a text file; columns of text, such as t x y p of events, are read from a folder: put it into one of its own, as "
    "NPY where it has more than 64 MiB, and draft a dialect with `fedora-qa layout FOLDER --draft-dialect mine.toml`"
)

OPENING_VARIABLE: Final = "FEDORA_QA_OPENING_S"
"""Environment variable: seconds within which a file must open."""


def require_signature(path: Place) -> None:
    """Raise ``MisuseError`` where there is no such file, it may not be read, or it does not begin like HDF5."""
    if isinstance(path, RemoteFile):
        with closing(RemoteBytes(path, block_bytes=len(_SIGNATURE))) as remote:
            require_signature_in(path, remote)
        return
    if not path.exists():
        raise MisuseError(f"Expected an HDF5 file, got a path that does not exist: {path}")
    if not path.is_file():
        raise MisuseError(f"Expected one HDF5 file, got a folder or device: {path}")
    try:
        with path.open("rb") as file:
            require_signature_in(path, file)
    except OSError as error:
        raise MisuseError(f"Expected a readable file, got {error.strerror or error}: {path}") from error


def require_signature_in(path: Place, file: BinaryIO | RemoteBytes) -> None:
    """Look for the signature where HDF5 allows it: at 0, 512, 1024, 2048 ... bytes (a user block may come first)."""
    offset, start = 0, b""
    while offset <= _LARGEST_USER_BLOCK:
        file.seek(offset)
        first_bytes = file.read(len(_SIGNATURE))
        if first_bytes == _SIGNATURE:
            return
        start = start or first_bytes or b""
        if first_bytes is None or len(first_bytes) < len(_SIGNATURE):
            break
        # The signature lies at 0, 512 and each doubling (HDF5 File Format Specification, II.A).
        offset = 2 * offset or 512
    other, remedy = other_format(start)
    raise NotHdf5Error(f"Expected an HDF5 file, got {other} (no HDF5 signature): {path}{remedy}")


def other_format(start: bytes) -> tuple[str, str]:
    """Return what a file of another format is, by its first bytes, and a clause with what to do, which may be empty."""
    # JSON and markup are no tables.
    is_text = bool(start) and _TEXT.issuperset(start) and not start.lstrip().startswith((b"{", b"[", b"<"))
    otherwise = _TEXT_FILE if is_text else "something else"
    words = next((words for beginning, words in _OTHER_FORMATS if start.startswith(beginning)), otherwise)
    name, semicolon, remedy = words.partition("; ")
    return name, f"{semicolon}{remedy}"


def opening_limit_s(usual_s: float) -> float:
    """Return the seconds that the environment sets, or the usual ones.

    Raises
    ------
    MisuseError
        The environment sets a limit that is no number above 0.
    """
    given = os.environ.get(OPENING_VARIABLE)
    try:
        limit_s = usual_s if given is None else float(given)
    except ValueError:
        limit_s = 0.0
    if not 0.0 < limit_s < math.inf:
        raise MisuseError(f"Expected seconds in {OPENING_VARIABLE}, such as 60, got {given!r}")
    return limit_s
