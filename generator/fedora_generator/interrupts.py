"""Interrupts that wait until they can do no harm.

HDF5 writes through Python, so an interrupt could be raised inside HDF5. It would leave the file half closed, and the
interpreter would crash over it at its end.
"""

import signal
import threading
from types import FrameType, TracebackType
from typing import Final, Self

_HELD: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class HeldInterrupts:
    """A block in which SIGINT, SIGTERM and SIGHUP wait for ``deliver``, or for its end; a second one does not wait.

    Only the main thread is interrupted, so elsewhere it does nothing.
    """

    def __init__(self) -> None:
        self._waiting: int | None = None
        self._former: dict[int, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._former = {number: signal.signal(number, self._hold) for number in _HELD}
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._restore()
        self.deliver()

    def deliver(self) -> None:
        """Let what waits happen here."""
        if self._waiting is not None:
            number, self._waiting = self._waiting, None
            self._restore()
            signal.raise_signal(number)

    def _hold(self, number: int, frame: FrameType | None) -> None:
        if self._waiting is not None:
            self.deliver()
        self._waiting = number

    def _restore(self) -> None:
        while self._former:
            number, handler = self._former.popitem()
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
