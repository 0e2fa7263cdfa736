"""Identify a file by the SHA-256 of its content, of a large one by that of evenly spread pieces.

A folder is identified by the SHA-256 of a list: of each file (``folder.list_files``), in the order of names, the digest
in hexadecimal, two spaces, the name and a line break, as ``sha256sum`` prints them.
"""

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO, Final, Literal

from fedora_qa.errors import MisuseError
from fedora_qa.storage.folder import Version, is_folder, list_files, local_version, root_of
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.remote_bytes import RemoteBytes
from fedora_qa.storage.server import NO_TRAFFIC, Traffic

_WHOLE_UP_TO_BYTES: Final = 1 << 30
_PIECE_BYTES: Final = 1 << 20
_PIECES: Final = 64
_FOLDER_PIECE_BYTES: Final = 1 << 14


@dataclass(frozen=True, slots=True)
class Digest:
    """A SHA-256, and whether it is of the whole file.

    ``version`` is that of the file that was read, ``traffic`` the requests to a server and the bytes that it sent.
    """

    sha256: str
    kind: Literal["full", "partial"]
    version: Version
    traffic: Traffic = NO_TRAFFIC


@contextmanager
def _opened(path: Path) -> Iterator[BufferedReader]:
    """Open a file; raises ``MisuseError`` where it cannot be read."""
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise MisuseError(f"Expected a readable file, got {error.strerror or error}: {path}") from error


def whole_digest(path: Path) -> str:
    """Return the SHA-256 of all of a file or folder, of any size; raises ``MisuseError`` where it is unreadable."""
    if is_folder(path):
        root = root_of(path)
        return _of_list((file.name, whole_digest(root / file.name)) for file in list_files(path))
    with _opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def file_digest(path: Place) -> Digest:
    """Return the file's digest.

    Files over 1 GiB get a partial digest: of their size, and of 64 evenly spread pieces of 1 MiB with the first and the
    last among them. It is the same wherever the file lies. A file behind a URL always gets a partial digest: where it
    is at most 1 GiB long, the pieces are together a 256th of it, so that the digest costs less than the quickest check.

    Of a folder whose files have over 1 GiB together, each file over 1 MiB gets a partial digest, of 64 pieces of
    16 KiB: images are mostly read whole, and a file of events costs no more than an image.
    """
    if isinstance(path, RemoteFile):
        # Blocks of one byte: no more is fetched than the pieces themselves.
        with closing(RemoteBytes(path, block_bytes=1)) as remote:
            size_bytes = remote.version.size
            piece_bytes = _PIECE_BYTES if size_bytes > _WHOLE_UP_TO_BYTES else -(-size_bytes // (256 * _PIECES))
            sha256 = _of_pieces(remote, size_bytes, piece_bytes)
            return Digest(sha256, "partial", remote.version, remote.traffic)
    version = local_version(path)
    if is_folder(path):
        if version.size <= _WHOLE_UP_TO_BYTES:
            return Digest(whole_digest(path), "full", version)
        root = root_of(path)
        listed = ((file.name, _in_large_folder(root / file.name, file.size)) for file in list_files(path))
        return Digest(_of_list(listed), "partial", version)
    if version.size <= _WHOLE_UP_TO_BYTES:
        return Digest(whole_digest(path), "full", version)
    with _opened(path) as file:
        return Digest(_of_pieces(file, version.size, _PIECE_BYTES), "partial", version)


def _in_large_folder(path: Path, size_bytes: int) -> str:
    if size_bytes <= _PIECES * _FOLDER_PIECE_BYTES:
        return whole_digest(path)
    with _opened(path) as file:
        return _of_pieces(file, size_bytes, _FOLDER_PIECE_BYTES)


def _of_list(digests: Iterable[tuple[str, str]]) -> str:
    listed = hashlib.sha256()
    for name, sha256 in digests:
        listed.update(f"{sha256}  {name}\n".encode())
    return listed.hexdigest()


def _of_pieces(file: BinaryIO | RemoteBytes, size_bytes: int, piece_bytes: int) -> str:
    # The size first: files of different lengths may agree in all pieces.
    digest = hashlib.sha256(str(size_bytes).encode())
    for number in range(_PIECES):
        # The first piece begins with the file, the last one ends with it.
        file.seek((size_bytes - piece_bytes) * number // (_PIECES - 1))
        digest.update(file.read(piece_bytes) or b"")
    return digest.hexdigest()
