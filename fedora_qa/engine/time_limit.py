"""A limit of processor time that ends the process: for calls into libraries that nothing else can interrupt."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

ENDED_BY: Final = getattr(signal, "SIGPROF", None)
"""The signal that ends the process at the limit; None on systems without it (Windows)."""


@contextmanager
def time_limit(limit_s: float) -> Iterator[None]:
    """End this process by SIGPROF where the block takes more processor time than ``limit_s``.

    A handler in Python would not run during a call into C, so the default action of the signal ends the process. Only
    for processes whose end another one notices. Without effect in threads other than the main one, and on systems
    without such a timer (Windows).
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    handler = signal.signal(signal.SIGPROF, signal.SIG_DFL)
    # Counts processor time, user and system: waiting for a slow disk does not end the process.
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        yield
    finally:
        # The timer before the handler: no signal may reach the handler that is restored.
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, handler)
