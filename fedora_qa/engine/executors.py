"""Where tasks are done: what all executors have in common, and the one that stays in this process."""

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from types import TracebackType
from typing import Final, Protocol, Self, TypeVar

from fedora_qa.engine.progress import Progress

Result = TypeVar("Result")

Task = Callable[[Progress], Result]
"""One step of one file with all that it needs: another process can do it, and it can be done again."""

DIED_TWICE: Final = "died twice over it (out of memory, a library crashed, or it did not end)"
ENDLESS: Final = "did not come to an end, and was ended"
"""How the processes that did a task ended, as a record states it."""


class Executor(Protocol):
    """Does tasks. Use as a context manager; leaving it ends the tasks that still run."""

    @property
    def capacity(self) -> int:
        """How many tasks are done at once."""
        ...

    @property
    def sharing(self) -> int:
        """How many tasks share the memory that one run may take."""
        ...

    @property
    def folder(self) -> Path | None:
        """Where tasks leave large values for each other; None where tasks may not share a file system."""
        ...

    @property
    def peak_memory_mib(self) -> int:
        """Largest known peak of memory of one of its processes, MiB; 0 where none is known."""
        ...

    def submit(self, task: Task[Result], progress: Progress, worker: int | None = None) -> Future[Result]:
        """Begin a task, on the worker of that number where the executor lets one be chosen.

        The future raises what the task raises, and ``WorkerLostError`` where the process that did it died. Progress
        may be reported from another thread, late, or not at all.
        """
        ...

    def require_workers(self) -> None:
        """Raise ``FedoraError`` where no worker is left for the submitted tasks."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...


class InProcess:
    """Does each task here and now, one after another."""

    capacity = 1
    sharing = 1
    peak_memory_mib = 0
    folder = None

    def submit(self, task: Task[Result], progress: Progress, worker: int | None = None) -> Future[Result]:
        """Do the task; the future that is returned is done."""
        future: Future[Result] = Future()
        try:
            future.set_result(task(progress))
        except Exception as error:  # noqa: BLE001 - raised where the result is requested
            future.set_exception(error)
        return future

    def require_workers(self) -> None:
        """Nobody else is needed."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        pass
