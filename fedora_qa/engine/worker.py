"""The loop of a worker process: it receives tasks, reports their progress, and answers with their results.

It imports no large library: where they were not loaded before the fork, unpickling a task loads them, after the number
of their threads has been set.
"""

import os
import pickle
import resource
import signal
import sys
import traceback
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, Final

from fedora_qa.engine.file_task import FileTask
from fedora_qa.engine.memory_budget import keep_unused_memory, return_unused_memory
from fedora_qa.engine.open_file import OpenFile

_PATIENCE_S: Final = 0.25
"""Seconds for which a process without a task keeps its file open: the next task mostly comes within milliseconds, and
an idle process shall not hold memory that working ones need."""

_OPENCV_THREADS: Final = "OPENCV_FOR_THREADS_NUM"
"""Read by OpenCV when it is loaded. Its images do not depend on it."""

_BLAS_THREADS: Final = "OPENBLAS_NUM_THREADS"
"""Read by NumPy and SciPy when they are loaded."""


@dataclass(frozen=True, slots=True)
class ProgressReport:
    """Progress of a task."""

    what: str
    done: int
    of: int


@dataclass(frozen=True, slots=True)
class TaskResult:
    """The result of a task, and the peak of memory of the process so far, MiB."""

    result: Any
    peak_memory_mib: int


@dataclass(frozen=True, slots=True)
class TaskFailure:
    """The error that a task raised, with its traceback as a note."""

    error: Exception


def serve(pipe: "Connection[Any, Any]", threads: int) -> None:
    """Do tasks until the other end of the pipe is closed, or gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the interrupt is the parent's to handle
    use_one_thread_of_blas()
    os.environ.setdefault(_OPENCV_THREADS, str(threads))
    # OpenCV that was loaded before the fork has read the variable already.
    if opencv := sys.modules.get("cv2"):
        opencv.setNumThreads(int(os.environ[_OPENCV_THREADS]))
    keep_unused_memory()
    open_file = OpenFile(keeps=True)
    while True:
        try:
            if not pipe.poll(_PATIENCE_S):
                open_file.clear()
                return_unused_memory()
            # Bytes, unpickled within ``_answer``: an error of pickling then becomes an answer, and the process stays.
            pickled = pipe.recv_bytes()
            pipe.send_bytes(_answer(pickled, pipe, open_file))
        except (EOFError, ConnectionError):
            return


def use_one_thread_of_blas() -> None:
    """Limit BLAS to the thread that calls it, unless the environment sets another number; before NumPy is loaded.

    A worker has one core, and its matrices are small: further threads would mostly wait in a busy loop on the
    cores of other workers.
    """
    os.environ.setdefault(_BLAS_THREADS, "1")


def _answer(pickled: bytes, pipe: "Connection[Any, Any]", open_file: OpenFile) -> bytes:
    def tell(what: str, done: int, of: int) -> None:
        pipe.send(ProgressReport(what, done, of))

    try:
        task = pickle.loads(pickled)
        result = task(tell, open_file) if isinstance(task, FileTask) else task(tell)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        peak_mib = peak >> 20 if sys.platform == "darwin" else peak >> 10  # bytes there, KiB elsewhere
        return pickle.dumps(TaskResult(result, peak_mib), pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # noqa: BLE001 - raised where the result is requested
        error.add_note("".join(traceback.format_exception(error)))
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # noqa: BLE001 - whatever it is that cannot be done: its text alone then
            return pickle.dumps(TaskFailure(RuntimeError(f"{type(error).__name__}: {error}")))
        return pickle.dumps(TaskFailure(error))
