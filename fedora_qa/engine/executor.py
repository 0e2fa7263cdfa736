"""Where tasks are done: a task, what all executors have in common, and the executor that stays in this process."""

import pickle
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import TracebackType
from typing import Any, Protocol, Self

from fedora_qa.engine.progress import Progress
from fedora_qa.engine.worker import OpenFile, Worker


@dataclass(frozen=True, slots=True)
class Task:
    """A function and its arguments: any process can do it, and it can be done again.

    Attributes
    ----------
    function
        Called with the arguments and the ``Worker`` that does it.
    keeps_result
        Whether the result stays where it was made, as it is large. The future then gives a ``Kept``, which is an
        argument of later tasks.
    limit_s
        Seconds within which the task ends; None: no limit. Only executors of processes keep to it.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    keeps_result: bool = False
    limit_s: float | None = None

    def do(self, worker: Worker, folder: Path | None = None) -> Any:
        """Do the task here; a result that is kept goes into a new file of a folder, where there is one."""
        result = self.function(*self.arguments, worker)
        return Kept.of(result, folder) if self.keeps_result else result


@dataclass(frozen=True, slots=True)
class Kept:
    """A large result of a task, which other tasks load: as bytes, or as a file."""

    pickled: bytes = b""
    path: Path | None = None

    @staticmethod
    def of(value: Any, folder: Path | None) -> "Kept":
        """Keep a value, in a new file where there is a folder for such."""
        if folder is None:
            return Kept(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))
        # Not deleted when closed: another process opens it by name, and ``discard`` removes it.
        with NamedTemporaryFile(dir=folder, delete=False) as file:
            pickle.dump(value, file, pickle.HIGHEST_PROTOCOL)
        return Kept(path=Path(file.name))

    def load(self) -> Any:
        """Return the value."""
        if self.path is None:
            return pickle.loads(self.pickled)
        with self.path.open("rb") as file:
            return pickle.load(file)

    def discard(self) -> None:
        """Remove the file, if there is one."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)


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
    def peak_memory_mib(self) -> int:
        """Largest known peak of memory of one of its processes, MiB; 0 where none is known."""
        ...

    def submit(self, task: Task, progress: Progress) -> Future[Any]:
        """Begin a task.

        The future raises what the task raises, ``WorkerLostError`` where the process that did it died, and
        ``EndlessError`` where it exceeded its limit of time. Progress may be reported from another thread, late, or
        not at all.
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

    def submit(self, task: Task, progress: Progress) -> Future[Any]:
        """Do the task; the future that is returned is done."""
        future: Future[Any] = Future()
        try:
            future.set_result(task.do(Worker(OpenFile(keeps=False), progress)))
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
