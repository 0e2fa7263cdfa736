"""Test whether a file begins like HDF5, from its first bytes and without the HDF5 library."""

from contextlib import closing
from typing import BinaryIO, Final

from fedora_qa.errors import MisuseError, NotHdf5Error
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.remote_bytes import RemoteBytes

_SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
_LARGEST_USER_BLOCK: Final = 1 << 20


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
    offset = 0
    while offset <= _LARGEST_USER_BLOCK:
        file.seek(offset)
        first_bytes = file.read(len(_SIGNATURE))
        if first_bytes == _SIGNATURE:
            return
        if first_bytes is None or len(first_bytes) < len(_SIGNATURE):
            break
        # The signature lies at 0, 512 and each doubling (HDF5 File Format Specification, II.A).
        offset = 2 * offset or 512
    raise NotHdf5Error(f"Expected an HDF5 file, got something else (no HDF5 signature): {path}")
