"""Read a file in a process of its own, as ``check`` does: on a damaged file HDF5 may crash or never return."""

import os
from typing import Any

from fedora_qa.cli.host import usable_cores
from fedora_qa.cli.isolated_light import process_ended
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from fedora_qa.engine.executor import Executor, InProcess, Task
from fedora_qa.engine.processes import ProcessExecutor
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.errors import WorkerLostError
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
            raise process_ended(path) from None
