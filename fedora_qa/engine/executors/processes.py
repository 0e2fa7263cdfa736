"""Tasks in processes of this machine. A process that dies takes the task it was doing with it and nothing else.

Each process is a pool of its own (pebble), which is made anew after its process has died or was ended: locks and
pipes of a pool are not safe after a death. Tasks and results travel as files, so that no message is longer than what a
pipe takes at once.
"""

import multiprocessing
import os
import pickle
import signal
import traceback
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from pathlib import Path
from queue import LifoQueue
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Final, Self
from uuid import uuid4

from pebble import ProcessExpired, ProcessPool

from fedora_qa.engine.executors.executor import OpenFile, Task, Worker, end_process_after, peak_memory_mib
from fedora_qa.engine.executors.fork_server import worker_context
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import EndlessError, WorkerLostError

_SILENCE_S: Final = 0.1
"""Seconds without a report after which a process is looked after."""


class ProcessExecutor:
    """Does as many tasks at once as it has processes."""

    def __init__(self, jobs: int, threads: int = 1) -> None:
        self.capacity = self.sharing = jobs
        self._folder = TemporaryDirectory(prefix="fedora-qa-")
        context = worker_context()
        self._processes = [_WorkerProcess(context, threads, Path(self._folder.name)) for _ in range(jobs)]
        # The process that ended a task last is the first to get another: it has the file of that task open.
        self._idle: LifoQueue[_WorkerProcess] = LifoQueue()
        for process in reversed(self._processes):
            self._idle.put(process)
        # One thread for each process: it waits for the end of the task.
        self._threads = ThreadPoolExecutor(jobs, thread_name_prefix="worker")

    @property
    def peak_memory_mib(self) -> int:
        """The most memory that one of the processes is known to have held."""
        return max(process.peak_memory_mib for process in self._processes)

    def submit(self, task: Task, progress: Progress) -> Future[Any]:
        """Give the task to the next process that is idle."""
        return self._threads.submit(self._do, task, progress)

    def require_workers(self) -> None:
        """Raise nothing: a process that died is replaced."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            self._threads.shutdown(wait=False, cancel_futures=True)
            # Each takes up to 0.1 s to stop: all begin before the first is waited for.
            for process in self._processes:
                process.stop()
            for process in self._processes:
                process.close()
            self._threads.shutdown()
        finally:
            self._folder.cleanup()

    def _do(self, task: Task, progress: Progress) -> Any:
        process = self._idle.get()
        try:
            return process.do(task, progress)
        finally:
            self._idle.put(process)


class _WorkerProcess:
    """A process that does one task after another, and is started with its first task."""

    def __init__(self, context: BaseContext, threads: int, folder: Path) -> None:
        self.peak_memory_mib = 0
        self._context = context
        self._threads = threads
        self._folder = folder
        self._closed = False
        self._pool: ProcessPool | None = None
        self._reports: Connection[Any, Any] | None = None

    def do(self, task: Task, progress: Progress) -> Any:
        """Do the task; raises what it raises, and ``WorkerLostError`` or ``EndlessError`` where its process ends."""
        files = _TaskFiles(self._folder / uuid4().hex)
        files.task.write_bytes(pickle.dumps(task, pickle.HIGHEST_PROTOCOL))
        try:
            peak_memory_mib = self._wait(files, task.limit_s, progress)
            outcome = pickle.loads(files.outcome.read_bytes())
        except BaseException as end:
            files.remove()
            # Whatever the process is doing now, its next task must not wait for it.
            self._end()
            if isinstance(end, ProcessExpired):
                # A negative exit code is the number of the signal (multiprocessing).
                by = f"signal {-end.exitcode}" if end.exitcode < 0 else f"exit code {end.exitcode}"
                raise WorkerLostError(f"Expected a process to end its task, got its own end: {by}") from end
            if isinstance(end, TimeoutError) and task.limit_s:
                raise EndlessError(f"Expected a task to end within {task.limit_s:g} s, got no end") from end
            if isinstance(end, CancelledError | BrokenProcessPool):
                raise WorkerLostError("Expected a process for the task, got none") from end
            raise
        files.remove()
        self.peak_memory_mib = max(self.peak_memory_mib, peak_memory_mib)
        if isinstance(outcome, _Failure):
            raise outcome.error
        return outcome

    def stop(self) -> None:
        """Begin to end the process, and start no other."""
        self._closed = True
        pool = self._pool
        if pool is not None:
            pool.stop()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """End the process, and start no other."""
        self.stop()
        self._end()

    def _wait(self, files: "_TaskFiles", limit_s: float | None, progress: Progress) -> int:
        """Return the peak of memory of the process, MiB, once it has done the task."""
        if self._closed:
            raise CancelledError
        if self._pool is None or self._reports is None or not self._pool.active:
            self._end()
            self._reports, reporting = self._context.Pipe(duplex=False)
            arguments = (reporting, self._threads)
            self._pool = ProcessPool(1, initializer=_begin_worker, initargs=arguments, context=self._context)
        reports, process_id = self._reports, 0
        pooled = self._pool.schedule(_do, args=(files, limit_s), timeout=limit_s)
        # A short task ends before its first report is read.
        while not pooled.done() or reports.poll():
            if reports.poll(_SILENCE_S):
                report = reports.recv()
                if report is None:
                    break
                if isinstance(report, int):
                    process_id = report
                else:
                    progress(*report)
            elif self._closed:
                raise CancelledError
            # To the pool a process that exits with code 0 in the middle of a task is no death.
            elif (
                process_id
                and process_id not in {child.pid for child in multiprocessing.active_children()}
                and not wait([pooled], timeout=10 * _SILENCE_S).done
            ):
                raise ProcessExpired("gone", 0)  # type: ignore[no-untyped-call]
        peak: int = pooled.result()
        return peak

    def _end(self) -> None:
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.stop()  # type: ignore[no-untyped-call]
            pool.join()


@dataclass(frozen=True, slots=True)
class _TaskFiles:
    """Where a task and its outcome lie: ``stem`` is their common path without the endings."""

    stem: Path

    @property
    def task(self) -> Path:
        return self.stem.with_suffix(".task")

    @property
    def outcome(self) -> Path:
        return self.stem.with_suffix(".outcome")

    def remove(self) -> None:
        for path in (self.task, self.outcome):
            path.unlink(missing_ok=True)


@dataclass(frozen=True, slots=True)
class _Failure:
    """Stands for the result of a task that raised an error, which has its traceback as a note."""

    error: Exception


@dataclass(slots=True)
class _Process:
    """What a worker process keeps between tasks."""

    reporting: "Connection[Any, Any] | None" = None
    open_file: OpenFile = field(default_factory=lambda: OpenFile(keeps=True))

    def report(self, what: str, done: int, of: int) -> None:
        """Report the progress of a task."""
        if self.reporting:
            self.reporting.send((what, done, of))


_here: Final = _Process()
"""Of this process; unused where it is no worker."""


def _begin_worker(reporting: "Connection[Any, Any]", threads: int) -> None:
    """Note where to report progress, and limit the threads of OpenCV, whose images do not depend on them."""
    _here.reporting = reporting
    import cv2  # noqa: PLC0415 - the process of the command computes no image

    cv2.setNumThreads(threads)


def _do(files: _TaskFiles, limit_s: float | None) -> int:
    """Do a task in a worker, write its outcome, and return the peak of memory of the process so far, MiB."""
    reporting = _here.reporting
    if reporting:
        reporting.send(os.getpid())
    if limit_s:
        end_process_after(limit_s)
    try:
        task: Task = pickle.loads(files.task.read_bytes())
        outcome = pickle.dumps(
            task.do(Worker(_here.open_file, _here.report), files.stem.parent), pickle.HIGHEST_PROTOCOL
        )
    except Exception as error:  # noqa: BLE001 - raised where the result is requested
        error.add_note("".join(traceback.format_exception(error)))
        try:
            outcome = pickle.dumps(_Failure(error))
            pickle.loads(outcome)
        except Exception:  # noqa: BLE001 - whatever it is that cannot be done: its text alone then
            outcome = pickle.dumps(_Failure(RuntimeError(f"{type(error).__name__}: {error}")))
    finally:
        if hasattr(signal, "alarm"):
            signal.alarm(0)
    files.outcome.write_bytes(outcome)
    if reporting:
        reporting.send(None)
    return peak_memory_mib()
