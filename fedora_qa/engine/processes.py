"""Tasks in processes of this machine, each with a pipe of its own, so that it is known which task ended which process.

A process that dies takes the task it was doing with it and nothing else: the next task finds a new one.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Condition, Lock
from types import TracebackType
from typing import Any, Self

from fedora_qa.engine.executors import Result, Task
from fedora_qa.engine.fork_server import worker_context
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.time_limit import ENDED_BY
from fedora_qa.engine.worker import ProgressReport, TaskFailure, TaskResult, serve
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
        self.capacity = jobs
        self.sharing = jobs
        self._folder = TemporaryDirectory(prefix="fedora-qa-")
        self.folder = Path(self._folder.name)
        context = worker_context()
        # One thread for each process: it waits at the pipe for the answer.
        self._threads = ThreadPoolExecutor(jobs, thread_name_prefix="worker")
        self._workers = tuple(_Worker(context, threads) for _ in range(jobs))
        self._idle = list(range(jobs))
        self._changed = Condition()
        self._started = False

    @property
    def peak_memory_mib(self) -> int:
        """The most memory that one of the processes is known to have held."""
        return max(worker.peak_memory_mib for worker in self._workers)

    def submit(self, task: Task[Result], progress: Progress, worker: int | None = None) -> Future[Result]:
        """Give the task to a process, or to the next that is idle."""
        future = self._threads.submit(self._do, task, progress, worker)
        if not self._started:
            self._started = True
            # Later tasks mostly wait for the first one, so that the other processes can start meanwhile.
            for each in self._workers:
                self._threads.submit(each.start)
        return future

    def require_workers(self) -> None:
        """Raise nothing: a process that died is replaced."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        # Threads wait at pipes: only the end of the processes lets them end.
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.close()
        self._threads.shutdown()
        self._folder.cleanup()

    def _do(self, task: Task[Result], progress: Progress, wanted: int | None) -> Result:
        with self._changed:
            self._changed.wait_for(lambda: wanted in self._idle if wanted is not None else self._idle)
            # A numbered worker still has the file open, with the blocks that lie beside the next windows.
            number = self._idle[0] if wanted is None else wanted
            self._idle.remove(number)
        try:
            return self._workers[number].do(task, progress)
        finally:
            with self._changed:
                self._idle.append(number)
                self._changed.notify_all()


class _Worker:
    """A process that does one task after another, and is started again after it has died."""

    def __init__(self, context: Any, threads: int) -> None:
        self.peak_memory_mib = 0
        self._context = context
        self._threads = threads
        self._changing = Lock()
        self._closed = False
        self._process: Any = None
        self._pipe: Any = None

    def do(self, task: Task[Result], progress: Progress) -> Result:
        """Do the task; raises ``WorkerLostError`` where the process dies, ``EndlessError`` by its own time limit."""
        self.start()
        try:
            self._pipe.send(task)
            while isinstance(answer := self._pipe.recv(), ProgressReport):
                progress(answer.what, answer.done, answer.of)
        except (EOFError, ConnectionError) as end:
            # A negative exit code is the number of the signal (multiprocessing).
            code = self._end()
            by = "never started" if code is None else f"signal {-code}" if code < 0 else f"exit code {code}"
            lost = EndlessError if ENDED_BY is not None and code == -ENDED_BY else WorkerLostError
            raise lost(f"Expected a process to end its task, got its own end: {by}") from end
        if isinstance(answer, TaskFailure):
            raise answer.error
        if not isinstance(answer, TaskResult):
            raise TypeError(f"Expected an answer of a worker, got {type(answer).__name__}")
        self.peak_memory_mib = max(self.peak_memory_mib, answer.peak_memory_mib)
        return answer.result  # type: ignore[no-any-return]  # what comes through a pipe has no type

    def start(self) -> None:
        """Start the process where there is none, or it has died."""
        with self._changing:
            if self._closed:
                raise WorkerLostError("Expected a process for the task, got an executor that has been closed")
            if self._process is None or not self._process.is_alive():
                self._pipe, theirs = self._context.Pipe()
                self._process = self._context.Process(target=serve, args=(theirs, self._threads), daemon=True)
                self._process.start()
                # The process then holds the only copy, so that its death ends the pipe and ``recv`` raises.
                theirs.close()

    def close(self) -> None:
        """End the process, and start no other."""
        self._closed = True
        self._end()

    def _end(self) -> int | None:
        """End the process, and return its exit code, negative for a signal; None where none was started."""
        with self._changing:
            if self._process is None:
                return None
            self._process.kill()
            self._process.join()
            code: int = self._process.exitcode
            return code
