"""Read a file in another process, as ``check`` does: HDF5 may die over it, or never end."""

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
    """Do a task that reads a file, in a process of its own, and return what it returns.

    Parameters
    ----------
    task
        Something that can be pickled; it ends its process by a fuse where HDF5 might never end.

    Raises
    ------
    MisuseError
        The process has died over it.
    FedoraError
        As the task does.
    """
    if os.environ.get(IN_PROCESS_VARIABLE):
        return task(progress)
    with ProcessExecutor(1, threads=usable_cores()) as processes:
        try:
            return processes.submit(task, progress).result()
        except WorkerLostError:
            raise _lost(path) from None


def lightly_apart(task: Task[Result], path: Place) -> Result:
    """Do the same in a process that loads nothing but what the task needs, and tells no progress."""
    if os.environ.get(IN_PROCESS_VARIABLE):
        return task(quiet)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as processes:
        try:
            return processes.submit(task, quiet).result()
        except BrokenProcessPool:
            raise _lost(path) from None


def _lost(path: Place) -> MisuseError:
    return MisuseError(f"Expected a file that HDF5 can read, got {path}, over which the process that read it has ended")
