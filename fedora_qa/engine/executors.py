"""Where tasks are done: what all executors have in common, and the one that stays in this process."""

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, TypeVar

from fedora_qa.engine.progress import Progress

Result = TypeVar("Result")

Task = Callable[[Progress], Result]
"""One step of one file, whole in itself: it can be sent to another process and done there, or done again."""


class Executor(Protocol):
    """Does tasks. Use as a context manager; to leave it ends what is still being done."""

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
        """Where tasks leave what is large for each other; None where they are not sure to find the same folder."""
        ...

    @property
    def peak_memory_mib(self) -> int:
        """The most memory that one of its processes is known to have held; 0 where none is known of."""
        ...

    def submit(self, task: Task[Result], progress: Progress, worker: int | None = None) -> Future[Result]:
        """Begin a task, where it can be chosen by the worker of that number.

        The future raises what the task raises, and ``WorkerLostError`` where the process that did it died. Progress
        may be told from another thread, late, or not at all.
        """
        ...

    def require_workers(self) -> None:
        """Raise ``FedoraError`` where nobody is left who could do what was submitted."""
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
        except Exception as error:  # noqa: BLE001 - whoever asks for the result gets it
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
