"""What runs in a worker process: it receives tasks, tells their progress, and answers with what they give.

It imports nothing heavy: what it was not forked with, a task brings, after the threads of the libraries have been set.
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
"""How long a process without a task keeps its file open: the next one mostly comes within milliseconds, and what waits
shall not hold the memory of those that work."""

_OPENCV_THREADS: Final = "OPENCV_FOR_THREADS_NUM"
"""Read by OpenCV when it is loaded. Its images do not depend on it."""

_BLAS_THREADS: Final = "OPENBLAS_NUM_THREADS"
"""Read by NumPy and SciPy when they are loaded."""


@dataclass(frozen=True, slots=True)
class ProgressReport:
    """A task tells how far it has come."""

    what: str
    done: int
    of: int


@dataclass(frozen=True, slots=True)
class TaskResult:
    """What a task gave, and the most memory that the process has held so far."""

    result: Any
    peak_memory_mib: int


@dataclass(frozen=True, slots=True)
class TaskFailure:
    """What a task raised, with its traceback as a note."""

    error: Exception


def serve(pipe: "Connection[Any, Any]", threads: int) -> None:
    """Do tasks until the other end of the pipe is closed, or gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the interrupt is the parent's to handle
    use_one_thread_of_blas()
    os.environ.setdefault(_OPENCV_THREADS, str(threads))
    if opencv := sys.modules.get("cv2"):
        opencv.setNumThreads(int(os.environ[_OPENCV_THREADS]))
    keep_unused_memory()
    open_file = OpenFile(keeps=True)
    while True:
        try:
            if not pipe.poll(_PATIENCE_S):
                open_file.clear()
                return_unused_memory()
            pickled = pipe.recv_bytes()
            pipe.send_bytes(_answer(pickled, pipe, open_file))
        except (EOFError, ConnectionError):
            return


def use_one_thread_of_blas() -> None:
    """Keep BLAS to the thread that calls it, where nobody has said otherwise; before NumPy is loaded.

    A worker has one core, and its matrices are small: further threads would spend their time waiting for them, awake,
    on the cores of other workers.
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
    except Exception as error:  # noqa: BLE001 - whoever asked for the result gets it
        return pickle.dumps(TaskFailure(_that_travels(error)))


def _that_travels(error: Exception) -> Exception:
    """Return the error with its traceback as a note; one that cannot be pickled and unpickled, as what it said."""
    error.add_note("".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - whatever it is that cannot be done
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
