"""Read a file in another process, as ``check`` does: on a damaged file HDF5 may crash or never return."""

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from fedora_qa.cli.host import usable_cores
from fedora_qa.cli.workers import IN_PROCESS_VARIABLE
from fedora_qa.engine.executors import Task
from fedora_qa.engine.processes import ProcessExecutor
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.errors import MisuseError, WorkerLostError
from fedora_qa.storage.place import Place

Result = TypeVar("Result")


def apart(task: Task[Result], path: Place, progress: Progress = quiet) -> Result:
    """Run a task that reads a file in a process of its own, and return its result.

    Parameters
    ----------
    task
        Can be pickled. It limits its own processor time where HDF5 might never return (``time_limit``).

    Raises
    ------
    MisuseError
        The process ended before it returned a result.
    FedoraError
        As the task does.
    """
    if os.environ.get(IN_PROCESS_VARIABLE):
        # A debugger cannot follow a task into another process.
        return task(progress)
    # One process at work: its numerical libraries may use all cores.
    with ProcessExecutor(1, threads=usable_cores()) as processes:
        try:
            return processes.submit(task, progress).result()
        except WorkerLostError:
            raise _lost(path) from None


def lightly_apart(task: Task[Result], path: Place) -> Result:
    """Do the same without progress, in a process that loads only what the task needs: it starts sooner."""
    if os.environ.get(IN_PROCESS_VARIABLE):
        return task(quiet)
    # `spawn`, not `fork`: the new process then holds no HDF5 state and no threads of this one.
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as processes:
        try:
            return processes.submit(task, quiet).result()
        except BrokenProcessPool:
            raise _lost(path) from None


def _lost(path: Place) -> MisuseError:
    return MisuseError(f"Expected a file that HDF5 can read, got {path}, over which the process that read it has ended")
