"""An HDF5 file whose failed writes are reported after HDF5 has closed it."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fedora_qa.errors import MisuseError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class DeferredErrorFile(io.FileIO):
    """An empty file, open to read and write, that stores the error of a failed write.

    HDF5 cannot close a file that it could not write, and crashes when the interpreter ends. Therefore a failed write
    reports success to HDF5, all later writes are dropped, and ``raise_failure`` raises the error.

    Attributes
    ----------
    what
        What the file is, for the message of the error.
    failure
        The first error of a write, if any.
    """

    def __init__(self, path: Path, what: str) -> None:
        self.what = what
        self.failure: OSError | None = None
        super().__init__(path, "w+")

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write all of ``data``."""
        view = memoryview(data).cast("B")
        with self._deferred():
            written = 0
            while self.failure is None and written < len(view):
                # A raw write may take fewer bytes than given, for example on a disk that is nearly full.
                written += super().write(view[written:]) or 0
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Cut or lengthen the file."""
        size = self.tell() if size is None else size
        with self._deferred():
            if self.failure is None:
                super().truncate(size)
        return size

    def raise_failure(self) -> None:
        """Raise ``MisuseError`` where a write has failed."""
        if self.failure is not None:
            raise MisuseError(
                f"Expected to be able to write {self.what}, got: {self.failure.strerror}; nothing is written"
            )

    @contextmanager
    def _deferred(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            # The first failure is the cause; those after it are its consequences.
            self.failure = self.failure or error
