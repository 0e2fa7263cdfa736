"""Identify a file by the SHA-256 of its content, of a large one by that of evenly spread pieces."""

import hashlib
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, Literal

from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.remote_bytes import RemoteBytes
from fedora_qa.storage.traffic import NO_TRAFFIC, Traffic
from fedora_qa.storage.version import Version, local_version

_WHOLE_UP_TO: Final = 1 << 30
_PIECE: Final = 1 << 20
_PIECES: Final = 64


@dataclass(frozen=True, slots=True)
class Digest:
    """A SHA-256, and whether it is of the whole file.

    ``version`` is that of the file that was read, ``traffic`` the requests to a server and the bytes that it sent.
    """

    sha256: str
    kind: Literal["full", "partial"]
    version: Version
    traffic: Traffic = NO_TRAFFIC


def whole_digest(path: Path) -> str:
    """Return the SHA-256 of all of a file, whatever its size."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def file_digest(path: Place) -> Digest:
    """Return the file's digest.

    Files over 1 GiB get a partial digest: of their size, and of 64 evenly spread pieces of 1 MiB with the first and the
    last among them. It is the same wherever the file lies. A file behind a URL always gets a partial digest: where it
    is at most 1 GiB long, the pieces are together a 256th of it, so that the digest costs less than the quickest check.
    """
    if isinstance(path, RemoteFile):
        # Blocks of one byte: no more is fetched than the pieces themselves.
        with closing(RemoteBytes(path, block_bytes=1)) as remote:
            size = remote.version.size
            piece_bytes = _PIECE if size > _WHOLE_UP_TO else -(-size // (256 * _PIECES))
            sha256 = _of_pieces(remote, size, piece_bytes)
            return Digest(sha256, "partial", remote.version, remote.traffic)
    version = local_version(path)
    if version.size <= _WHOLE_UP_TO:
        return Digest(whole_digest(path), "full", version)
    with path.open("rb") as file:
        return Digest(_of_pieces(file, version.size, _PIECE), "partial", version)


def _of_pieces(file: BinaryIO | RemoteBytes, size: int, piece: int) -> str:
    # The size first: files of different lengths may agree in all pieces.
    digest = hashlib.sha256(str(size).encode())
    for number in range(_PIECES):
        # The first piece begins with the file, the last one ends with it.
        file.seek((size - piece) * number // (_PIECES - 1))
        digest.update(file.read(piece) or b"")
    return digest.hexdigest()
