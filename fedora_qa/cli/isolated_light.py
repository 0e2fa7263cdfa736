"""Read a file in a process of its own that loads only what the reading needs: it starts sooner than a worker."""

import math
import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Final

from pebble import ProcessExpired, ProcessPool

from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from fedora_qa.errors import MisuseError
from fedora_qa.storage.place import Place

_GRACE_S: Final = 10
"""Seconds after its limit at which the process ends itself, where nobody has ended it: its command has died."""


def run_isolated_light(function: Callable[..., Any], arguments: tuple[Any, ...], path: Place, limit_s: float) -> Any:
    """Call a function in a process that loads only what the function needs: it starts sooner.

    Raises
    ------
    MisuseError
        The process ended before it returned a result, or exceeded the limit of time.
    FedoraError
        As the function does.
    """
    if os.environ.get(IN_PROCESS_VARIABLE):
        return function(*arguments)
    # `spawn`, not `fork`: the new process then holds no HDF5 state and no threads of this one.
    processes = ProcessPool(1, context=multiprocessing.get_context("spawn"))
    try:
        return processes.schedule(_call, args=(function, arguments, limit_s), timeout=limit_s).result()
    except (ProcessExpired, TimeoutError, BrokenProcessPool):
        raise process_ended(path) from None
    finally:
        processes.stop()  # type: ignore[no-untyped-call]
        processes.join()


def process_ended(path: Place | str) -> MisuseError:
    """Return the error of a file over which the process that read it has ended."""
    return MisuseError(f"Expected a file that HDF5 can read, got {path}, over which the process that read it has ended")


def _call(function: Callable[..., Any], arguments: tuple[Any, ...], limit_s: float) -> Any:
    if hasattr(signal, "alarm"):
        # The default action of the signal ends the process, also within a call into C.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(math.ceil(limit_s) + _GRACE_S)
    return function(*arguments)
