"""Read a file in a process of its own: on a damaged file HDF5 may crash or never return.

A worker does a task as in ``check``. A light process loads only what a function needs, and starts sooner.
"""

import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from pebble import ProcessExpired, ProcessPool

from fedora_qa.cli.host import usable_cores
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from fedora_qa.engine.executors.executor import Executor, InProcess, Task, end_process_after
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.errors import MisuseError, WorkerLostError
from fedora_qa.storage.place import Place


def run_isolated(
    task: Task, path: Place | str, opening: Task | None, progress: Progress = quiet, *, in_process: bool = False
) -> Any:
    """Do a task that reads a file in a process of its own, and return its result.

    Parameters
    ----------
    path
        The file, or the names of several, for messages.
    opening
        Tests first whether the file opens at all (``opening_test``).
    in_process
        Whether to do it in this process after all: for a caller that trusts its files.

    Raises
    ------
    MisuseError
        The process ended before it returned a result.
    FedoraError
        As the task does.
    """
    # A debugger cannot follow a task into another process. One process at work may use all cores for images.
    is_here = in_process or bool(os.environ.get(IN_PROCESS_VARIABLE))
    executor: Executor = InProcess() if is_here else ProcessExecutor(1, threads=usable_cores())
    with executor:
        try:
            if opening:
                executor.submit(opening, quiet).result()
            return executor.submit(task, progress).result()
        except WorkerLostError:
            raise _process_ended(path) from None


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
        raise _process_ended(path) from None
    finally:
        processes.stop()  # type: ignore[no-untyped-call]
        processes.join()


def _call(function: Callable[..., Any], arguments: tuple[Any, ...], limit_s: float) -> Any:
    end_process_after(limit_s)
    return function(*arguments)


def _process_ended(path: Place | str) -> MisuseError:
    """Return the error of a file over which the process that read it has ended."""
    return MisuseError(f"Expected a file that HDF5 can read, got {path}, over which the process that read it has ended")
