"""The bytes of a file behind a URL, as HDF5 reads them: the structure in small blocks, data in whole chunks."""

import io
from collections import OrderedDict
from itertools import groupby
from typing import Any, Final

from fedora_qa.errors import StorageError
from fedora_qa.storage.folder import Version
from fedora_qa.storage.place import RemoteFile
from fedora_qa.storage.server import Server, Traffic, changed_error

BLOCK_BYTES: Final = 1 << 18
"""For HDF5 files: large against its structure, small against images (docs/remote.md states how it was chosen)."""

_BLOCKS: Final = 256
"""Largest number of blocks that are kept: those that were read last."""


class RemoteBytes(io.RawIOBase):
    """The bytes of a file behind a URL, read-only. Not for several threads at once.

    Parameters
    ----------
    block_bytes
        Least length of a request. A read of this length or more is fetched as it is, and not kept.

    Attributes
    ----------
    failure
        The error that ended the reading; every later read raises it again. HDF5 reports a read that failed as damage of
        the file, so that a caller that gets an error of damage must look here first.
    """

    def __init__(self, place: RemoteFile, block_bytes: int) -> None:
        super().__init__()
        self.place = place
        self.failure: StorageError | None = None
        self._server = Server(place)
        self._block_bytes = block_bytes
        self._blocks: OrderedDict[int, bytes] = OrderedDict()
        self._at = 0

    @property
    def version(self) -> Version:
        """The version that is read."""
        return self._server.version

    @property
    def traffic(self) -> Traffic:
        """Requests and bytes so far."""
        return self._server.traffic

    def require_sound(self) -> None:
        """Raise ``StorageError`` where anything could not be read."""
        if self.failure is not None:
            raise StorageError(*self.failure.args) from None

    def require_unchanged(self) -> None:
        """Raise ``StorageError`` where anything could not be read, or the file was changed."""
        self.require_sound()
        if self._server.ask_version() != self.version:
            raise changed_error(self.place)

    def readable(self) -> bool:
        """Return True: the file can be read."""
        return True

    def seekable(self) -> bool:
        """Return True: every place of the file can be read."""
        return True

    def tell(self) -> int:
        """Return the place of the next byte."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Go to a place."""
        origin = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self.version.size}[whence]
        self._at = origin + offset
        return self._at

    def readinto(self, buffer: Any, /) -> int:
        """Fill a buffer as far as the file reaches; raises ``StorageError``."""
        target = memoryview(buffer).cast("B")
        start, stop = self._at, min(self._at + len(target), self.version.size)
        if stop <= start:
            return 0
        self.require_sound()
        try:
            # Long reads are chunks, needed once: among the blocks they would evict the structure, which is read again.
            if stop - start >= self._block_bytes:
                target[: stop - start] = self._server.fetch(start, stop)
            else:
                target[: stop - start] = self._through_blocks(start, stop)
        except StorageError as failure:
            # HDF5 turns the exception into an error that looks like damage; ``require_sound`` raises the reason.
            # Without traceback: its frames hold the property list by which HDF5 holds this object, where no garbage
            # collector looks. HDF5 would free both after the interpreter has ended, and crash.
            self.failure = StorageError(*failure.args)
            raise
        self._at = stop
        return stop - start

    def close(self) -> None:
        """Close the file at the server."""
        # The interpreter also closes a file that could not be opened, which has no server.
        if not self.closed and hasattr(self, "_server"):
            self._server.close()
            self._blocks.clear()
        super().close()

    def _through_blocks(self, start: int, stop: int) -> bytes:
        wanted = range(start // self._block_bytes, (stop - 1) // self._block_bytes + 1)
        missing = [number for number in wanted if number not in self._blocks]
        # Consecutive numbers have the same difference to their position, so that a run costs one request.
        for _, run in groupby(missing, key=lambda number: number - missing.index(number)):
            numbers, size = list(run), self._block_bytes
            first = numbers[0] * size
            fetched = self._server.fetch(first, min((numbers[-1] + 1) * size, self.version.size))
            for place, number in enumerate(numbers):
                self._blocks[number] = fetched[place * size : (place + 1) * size]
        for number in wanted:
            # Most recently used last: the block unused for longest is evicted first.
            self._blocks.move_to_end(number)
        joined = b"".join(self._blocks[number] for number in wanted)
        while len(self._blocks) > _BLOCKS:
            self._blocks.popitem(last=False)
        ahead = start - wanted[0] * self._block_bytes
        return joined[ahead : ahead + stop - start]
