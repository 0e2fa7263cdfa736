"""A limit of processor time that ends the process: for calls into libraries that nothing else can interrupt."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

ENDED_BY: Final = getattr(signal, "SIGPROF", None)
"""The signal that ends a process so; None where there is none (Windows)."""


@contextmanager
def time_limit(limit_s: float) -> Iterator[None]:
    """End this process by SIGPROF where the block takes more seconds of processor than that.

    A call into C holds the interpreter, so that no handler of ours would run: the signal's own effect is to end the
    process. Only for processes whose end somebody else notices. Without effect in threads beside the main one, and
    where there is no such timer (Windows).
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    handler = signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, handler)
