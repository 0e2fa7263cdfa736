"""A file beside the target, under a hidden name, that takes the target's place only when it is whole.

A run that was killed leaves its file as ``.NAME.partial``; the next run to the same target uses it again. Two runs to
the same target do not meet: whoever writes holds a lock, which ends with the process.
"""

import errno
import fcntl
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fedora_generator.errors import OutputError
from fedora_generator.interrupts import HeldInterrupts

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class PartialFile(io.FileIO):
    """The bytes of a file that is not whole yet, open to read and write; HDF5 writes through it.

    A write that fails seems to succeed, and all after it are dropped: HDF5 cannot close what it could not write, and
    crashes over it when the interpreter ends. ``go_on`` says so.
    """

    def __init__(self, path: Path, interrupts: HeldInterrupts) -> None:
        self.path = path
        self.failure: OSError | None = None
        self._interrupts = interrupts
        super().__init__(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666), "r+")

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write all of ``data``."""
        view = memoryview(data).cast("B")
        with self._remembering():
            written = 0
            while self.failure is None and written < len(view):
                written += super().write(view[written:]) or 0
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Cut or lengthen the file."""
        size = self.tell() if size is None else size
        with self._remembering():
            if self.failure is None:
                super().truncate(size)
        return size

    def go_on(self) -> None:
        """Raise what made a write fail, or an interrupt that has come meanwhile."""
        self._interrupts.deliver()
        if self.failure is not None:
            raise self.failure

    def become(self, target: Path) -> None:
        """Take the place of ``target`` with every byte on the disk, which may say only now that it is full."""
        with self._remembering():
            os.fsync(self.fileno())
        self.go_on()
        with self._remembering():
            self.path.replace(target)
        self.go_on()

    @contextmanager
    def _remembering(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.failure = self.failure or error


@contextmanager
def partial_file(target: Path, *, overwrite: bool) -> Iterator[PartialFile]:
    """Open an empty file that becomes ``target`` when the block ends; on any error or interrupt nothing is left.

    A link is followed: the file that it leads to is replaced. Inside the block an interrupt waits for ``go_on``.

    Raises
    ------
    OutputError
        As ``require_writable`` says; or the disk is full, or another run writes the same target.
    """
    require_writable(target, overwrite=overwrite)
    final = target.resolve()
    with HeldInterrupts() as interrupts:
        file = _open_alone(final.with_name(f".{final.name}.partial"), target, interrupts)
        try:
            yield file
            file.become(final)
        except BaseException as error:
            file.path.unlink(missing_ok=True)
            if file.failure is not None:
                raise _explained(file.failure, target) from error
            raise
        finally:
            file.close()


def require_writable(target: Path, *, overwrite: bool) -> None:
    """Raise OutputError where ``target`` could not be written as a new file.

    It is a folder or a device, or exists and ``overwrite`` is false; its folder is missing or cannot be written.
    """
    try:
        refusal = _refusal(target, overwrite=overwrite)
    except OSError as error:  # a name too long, a folder that cannot be searched
        refusal = f"Expected a path that can be written, got {target}: {error.strerror}"
    if refusal:
        raise OutputError(refusal)


def _refusal(target: Path, *, overwrite: bool) -> str:
    if target.is_dir():
        return f"Expected the path of a file to write, got the folder {target}"
    if target.exists() and not target.is_file():
        return f"Expected the path of a file to write, got {target}, which is a device or a pipe"
    if target.exists() and not overwrite:
        return f"Expected a new file, got {target}, which exists; choose another name or use --force"
    folder = target.resolve().parent
    if not folder.is_dir():
        return f"Expected an existing folder to write into, got {folder}; create it first"
    if not os.access(folder, os.W_OK | os.X_OK):
        return f"Expected a folder that can be written, got {folder}; choose another or change its rights"
    return ""


def _open_alone(path: Path, target: Path, interrupts: HeldInterrupts) -> PartialFile:
    """Open the partial file of ``target``, emptied, with a lock that no other run can get."""
    while True:
        try:
            file = PartialFile(path, interrupts)
        except OSError as error:
            raise OutputError(f"Expected to be able to write into {path.parent}, got: {error.strerror}") from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.close()
            raise OutputError(f"Expected to be the only run that writes {target}, got another at it") from error
        except OSError:
            pass  # some network disks know no locks; there, it is the user who must not write one target twice
        if _is_at(path, file):
            file.truncate(0)
            return file
        file.close()  # the run that held the lock has just moved or removed its file


def _is_at(path: Path, file: PartialFile) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def _explained(error: OSError, target: Path) -> OutputError:
    if error.errno in _NO_ROOM:
        return OutputError(f"Expected room for {target}, got a full disk ({error.strerror}); make room or ask for less")
    return OutputError(f"Expected to be able to write {target}, got: {error.strerror or error}")
