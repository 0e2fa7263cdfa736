"""Tasks in processes of this machine, each with a pipe of its own, so that it is known which task killed which.

A process that dies takes the task it was doing with it and nothing else: the next task finds a new one.
"""

from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing import get_context
from queue import SimpleQueue
from threading import Lock
from types import TracebackType
from typing import Any, Self

from fedora_qa.engine.executors import Result, Task
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.worker import Done, Failed, Told, serve
from fedora_qa.errors import WorkerLostError


class ProcessExecutor:
    """Does as many tasks at once as it has processes, which are started when they are first needed.

    Parameters
    ----------
    jobs
        How many processes.
    threads
        How many threads each of them may use for images.
    """

    def __init__(self, jobs: int, threads: int = 1) -> None:
        self.capacity = jobs
        self.sharing = jobs
        self._threads = ThreadPoolExecutor(jobs, thread_name_prefix="worker")
        self._workers = tuple(_Worker(threads) for _ in range(jobs))
        self._idle = _queue_of(self._workers)

    def submit(self, task: Task[Result], progress: Progress) -> Future[Result]:
        """Give the task to the next process that is idle."""
        return self._threads.submit(self._do, task, progress)

    def require_workers(self) -> None:
        """Look for nobody: a process that died is replaced."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.close()
        self._threads.shutdown()

    def _do(self, task: Task[Result], progress: Progress) -> Result:
        worker = self._idle.get()
        try:
            return worker.do(task, progress)
        finally:
            self._idle.put(worker)


class _Worker:
    """A process that does one task after another, and is started again after it has died."""

    def __init__(self, threads: int) -> None:
        self._context = get_context("spawn")
        self._threads = threads
        self._changing = Lock()
        self._closed = False
        self._process: Any = None
        self._pipe: Any = None

    def do(self, task: Task[Result], progress: Progress) -> Result:
        """Do the task; raises ``WorkerLostError`` where the process dies over it."""
        self._start_if_needed()
        try:
            answer = self._answer(task, progress)
        except (EOFError, ConnectionError) as end:
            raise WorkerLostError(f"Expected a process to end its task, got its own end: {self._end()}") from end
        if isinstance(answer, Failed):
            raise answer.error
        return answer.result  # type: ignore[no-any-return]  # what comes through a pipe has no type

    def close(self) -> None:
        """End the process, and start no other."""
        self._closed = True
        self._end()

    def _answer(self, task: Task[Any], progress: Progress) -> Done | Failed:
        self._pipe.send(task)
        while isinstance(answer := self._pipe.recv(), Told):
            progress(answer.what, answer.done, answer.of)
        if not isinstance(answer, Done | Failed):
            raise TypeError(f"Expected an answer of a worker, got {type(answer).__name__}")
        return answer

    def _start_if_needed(self) -> None:
        with self._changing:
            if self._closed:
                raise WorkerLostError("Expected a process for the task, got an executor that has been closed")
            if self._process is None or not self._process.is_alive():
                self._pipe, theirs = self._context.Pipe()
                self._process = self._context.Process(target=serve, args=(theirs, self._threads), daemon=True)
                self._process.start()
                theirs.close()  # the process holds the only copy, so that its death is the end of the pipe

    def _end(self) -> str:
        """End the process, and say what has ended it."""
        with self._changing:
            if self._process is None:
                return "never started"
            self._process.kill()
            self._process.join()
            code = self._process.exitcode
            return f"signal {-code}" if code < 0 else f"exit code {code}"


def _queue_of(workers: Iterable[_Worker]) -> "SimpleQueue[_Worker]":
    idle: SimpleQueue[_Worker] = SimpleQueue()
    for worker in workers:
        idle.put(worker)
    return idle
