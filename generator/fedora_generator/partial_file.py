"""A file beside the target, under a hidden name, that replaces the target only when it is complete.

A run that was killed leaves its file as ``.NAME.partial``; the next run to the same target uses it again. Two runs
cannot write the same target at once: a run holds a lock, which ends with its process.
"""

import errno
import fcntl
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType, TracebackType
from typing import Final, Self

from fedora_generator.errors import OutputError
from fedora_qa.layout.create import DeferredErrorFile

_DEFERRED: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_DISK_FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class DeferredInterrupts:
    """A block in which SIGINT, SIGTERM and SIGHUP wait for ``deliver``, or for its end; a second one does not wait.

    HDF5 writes through Python, so that an interrupt could be raised inside HDF5. It would leave the file half closed,
    and the interpreter would crash over it at its end. Only the main thread is interrupted; elsewhere the block does
    nothing.
    """

    def __init__(self) -> None:
        self._waiting: int | None = None
        self._former: dict[int, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._former = {number: signal.signal(number, self._defer) for number in _DEFERRED}
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._restore()
        self.deliver()

    def deliver(self) -> None:
        """Raise the interrupt that waits, if any."""
        if self._waiting is not None:
            number, self._waiting = self._waiting, None
            self._restore()
            signal.raise_signal(number)

    def _defer(self, number: int, frame: FrameType | None) -> None:
        if self._waiting is not None:
            self.deliver()
        self._waiting = number

    def _restore(self) -> None:
        while self._former:
            number, handler = self._former.popitem()
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


class PartialFile(DeferredErrorFile):
    """The bytes of a file that is not complete yet; ``raise_pending`` raises the error of a write that has failed."""

    def __init__(self, path: Path, interrupts: DeferredInterrupts) -> None:
        self.path = path
        self._interrupts = interrupts
        # Not emptied before it is locked: another run may be writing it.
        super().__init__(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666), str(path), "r+")

    def raise_pending(self) -> None:
        """Raise the error of a write that failed, or an interrupt that has come since."""
        self._interrupts.deliver()
        if self.failure is not None:
            raise self.failure

    def move_to(self, target: Path) -> None:
        """Replace ``target``, with every byte on the disk; only now may the disk report that it is full."""
        with self.deferred():
            os.fsync(self.fileno())
        self.raise_pending()
        with self.deferred():
            self.path.replace(target)
        self.raise_pending()


@contextmanager
def partial_file(target: Path, *, overwrite: bool) -> Iterator[PartialFile]:
    """Open an empty file that becomes ``target`` when the block ends; on any error or interrupt nothing is left.

    A link is followed: the file that it leads to is replaced. Inside the block an interrupt waits
    for ``raise_pending``.

    Raises
    ------
    OutputError
        As ``require_writable`` does; or the disk is full, or another run writes the same target.
    """
    require_writable(target, overwrite=overwrite)
    final = target.resolve()
    with DeferredInterrupts() as interrupts:
        file = _open_locked(final.with_name(f".{final.name}.partial"), target, interrupts)
        try:
            yield file
            file.move_to(final)
        except BaseException as error:
            file.path.unlink(missing_ok=True)
            failure = file.failure
            if failure is None:
                raise
            if failure.errno in _DISK_FULL:
                raise OutputError(
                    f"Expected room for {target}, got a full disk ({failure.strerror}); make room or ask for less"
                ) from error
            reason = failure.strerror or failure
            raise OutputError(f"Expected to be able to write {target}, got: {reason}") from error
        finally:
            file.close()


def require_writable(target: Path, *, overwrite: bool) -> None:
    """Raise OutputError where ``target`` could not be written as a new file.

    It is a folder or a device, or exists and ``overwrite`` is false; its folder is missing or cannot be written.
    """
    refusal = ""
    try:
        folder = target.resolve().parent
        if target.is_dir():
            refusal = f"Expected the path of a file to write, got the folder {target}"
        elif target.exists() and not target.is_file():
            refusal = f"Expected the path of a file to write, got {target}, which is a device or a pipe"
        elif target.exists() and not overwrite:
            refusal = f"Expected a new file, got {target}, which exists; choose another name or use --force"
        elif not folder.is_dir():
            refusal = f"Expected an existing folder to write into, got {folder}; create it first"
        elif not os.access(folder, os.W_OK | os.X_OK):
            refusal = f"Expected a folder that can be written, got {folder}; choose another or change its rights"
    except OSError as error:  # a name too long, a folder that cannot be searched
        refusal = f"Expected a path that can be written, got {target}: {error.strerror}"
    if refusal:
        raise OutputError(refusal)


def _open_locked(path: Path, target: Path, interrupts: DeferredInterrupts) -> PartialFile:
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
            pass  # some network disks have no locks; there the user must not write one target twice
        # The run that held the lock may just have moved or removed its file: then this one is no longer at the path.
        try:
            is_at_path = os.path.samestat(path.stat(), os.fstat(file.fileno()))
        except FileNotFoundError:
            is_at_path = False
        if is_at_path:
            file.truncate(0)
            return file
        file.close()
