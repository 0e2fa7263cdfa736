"""Tasks in processes of this machine. A process that dies takes the task it was doing with it and nothing else."""

import os
import pickle
import resource
import sys
from concurrent.futures import CancelledError, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from types import TracebackType
from typing import Any, Final, Self

import cv2
from pebble import ProcessExpired, ProcessPool

from fedora_qa.engine.executor import Task
from fedora_qa.engine.fork_server import worker_context
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.engine.worker import OpenFile, Worker
from fedora_qa.errors import EndlessError, WorkerLostError


class ProcessExecutor:
    """Does as many tasks at once as it has processes, all of which are started with the first task.

    Parameters
    ----------
    jobs
        How many processes.
    threads
        How many threads each of them may use for images.
    """

    def __init__(self, jobs: int, threads: int = 1) -> None:
        self.capacity = self.sharing = jobs
        self.peak_memory_mib = 0
        self._folder = TemporaryDirectory(prefix="fedora-qa-")
        context = worker_context()
        self._reports, self._reporting = context.Pipe(duplex=False)
        self._pool = ProcessPool(jobs, initializer=_begin_worker, initargs=(self._reporting, threads), context=context)
        self._numbers = count()
        self._progress: dict[int, Progress] = {}
        self._listener = Thread(target=self._listen, name="progress", daemon=True)
        self._listener.start()

    def submit(self, task: Task, progress: Progress) -> Future[Any]:
        """Give the task to the next process that is idle.

        While there are no more tasks than processes, one that has just ended a task gets the next.
        """
        number = next(self._numbers)
        self._progress[number] = progress
        future: Future[Any] = Future()
        # As bytes both ways: what cannot be pickled fails by itself, and not with the channel to all processes.
        arguments = (number, pickle.dumps(task, pickle.HIGHEST_PROTOCOL), Path(self._folder.name))
        pooled = self._pool.schedule(_do, args=arguments, timeout=task.limit_s)
        pooled.add_done_callback(lambda done: self._settle(number, task, future, done))
        return future

    def require_workers(self) -> None:
        """Raise nothing: a process that died is replaced."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._pool.stop()  # type: ignore[no-untyped-call]
        self._pool.join()
        # No process is left that could write: the last copy of this end ends the listener.
        self._reporting.close()
        self._listener.join()
        self._folder.cleanup()

    def _settle(self, number: int, task: Task, future: Future[Any], pooled: Future[Any]) -> None:
        del self._progress[number]
        try:
            pickled, peak_memory_mib = pooled.result()
            result = pickle.loads(pickled)
        except ProcessExpired as end:
            # A negative exit code is the number of the signal (multiprocessing).
            by = f"signal {-end.exitcode}" if end.exitcode < 0 else f"exit code {end.exitcode}"
            future.set_exception(WorkerLostError(f"Expected a process to end its task, got its own end: {by}"))
        except (CancelledError, BrokenProcessPool) as end:
            future.set_exception(WorkerLostError(f"Expected a process for the task, got none: {end or 'cancelled'}"))
        except TimeoutError as error:
            # Without a limit it is an error of the task itself.
            limit_s = task.limit_s
            endless = EndlessError(f"Expected a task to end within {limit_s:g} s, got no end") if limit_s else error
            future.set_exception(endless)
        except Exception as error:  # noqa: BLE001 - raised where the result is requested
            future.set_exception(error)
        else:
            self.peak_memory_mib = max(self.peak_memory_mib, peak_memory_mib)
            future.set_result(result)

    def _listen(self) -> None:
        with suppress(EOFError, OSError):
            while True:
                number, what, done, of = self._reports.recv()
                progress = self._progress.get(number, quiet)
                # An error where progress is shown must not end this loop: processes would wait for a full pipe.
                with suppress(Exception):
                    progress(what, done, of)


@dataclass(slots=True)
class _Process:
    """What a worker process keeps between tasks."""

    reporting: "Connection[Any, Any] | None" = None
    open_file: OpenFile = field(default_factory=lambda: OpenFile(keeps=True))

    def report(self, number: int, what: str, done: int, of: int) -> None:
        """Report the progress of a task by its number."""
        if self.reporting:
            # A short message is written at once, so that those of several processes do not mix.
            self.reporting.send((number, what, done, of))


_here: Final = _Process()
"""Of this process; unused where it is no worker."""


def _begin_worker(reporting: "Connection[Any, Any]", threads: int) -> None:
    """Note where to report progress, and limit the threads of OpenCV, whose images do not depend on them."""
    _here.reporting = reporting
    cv2.setNumThreads(int(os.environ.get("OPENCV_FOR_THREADS_NUM", threads)))


def _do(number: int, pickled: bytes, folder: Path) -> tuple[bytes, int]:
    """Do a task in a worker; return its result, pickled, and the peak of memory of the process so far, MiB."""
    try:
        task: Task = pickle.loads(pickled)
        result = pickle.dumps(task.do(Worker(_here.open_file, partial(_here.report, number)), folder))
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # noqa: BLE001 - whatever it is that cannot be done: its text alone then
            raise RuntimeError(f"{type(error).__name__}: {error}") from None
        raise
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return result, peak >> 20 if sys.platform == "darwin" else peak >> 10  # bytes there, KiB elsewhere
