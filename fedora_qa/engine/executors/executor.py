"""A task, the functions that tasks name, the worker that does one, and the executor that stays in this process.

Nothing that measures is imported here: the process that deals out tasks names their functions.
"""

import math
import pickle
import resource
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Protocol, Self

from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.server import version_of
from fedora_qa.storage.signature import opening_limit_s

if TYPE_CHECKING:  # loads HDF5
    from fedora_qa.engine.survey import OpenSurvey, Survey
    from fedora_qa.layout.dialect import DialectChoice

_TASKS: Final = "fedora_qa.engine.tasks"
_KERNELS: Final = "fedora_qa.engine.compilation.kernels"

_GRACE_S: Final = 10
"""Seconds after its limit at which a process ends itself, where nobody has ended it: its command has died."""

SILENCE_S: Final = 2.0
"""Seconds without a result after which an executor is asked whether any worker is left."""

_OPENING_S: Final = 60.0
"""A file opens in hundredths of a second, over a slow network in some seconds."""


class OpenFile:
    """Holds one open file at most, so that neighbouring batches of windows share the rows between them.

    Parameters
    ----------
    keeps
        Whether the process is a worker of this package, in which a file stays open after a task; elsewhere each task
        opens it anew. A file behind a URL never stays open, as each task reports its own traffic.
    """

    def __init__(self, *, keeps: bool) -> None:
        self._keeps = keeps
        self._token = ""
        self._file: OpenSurvey | None = None
        self._opened = ExitStack()

    @contextmanager
    def opened(self, survey: "Survey") -> "Iterator[OpenSurvey]":
        """Open a surveyed file, or go on with it; raises ``FedoraError`` where it has been changed since."""
        # The process of the command imports this module as well, and measures nothing.
        from fedora_qa.engine.survey import open_survey_of, opened, require_same  # noqa: PLC0415 - loads what measures

        if self._file is not None and self._token == survey.token:
            require_same(survey, version_of(survey.path))
            # The same survey may come with another plan.
            file = open_survey_of(survey, self._file.sequence, self._file.ready)
        else:
            self.close()
            file = self._file = self._opened.enter_context(opened(survey))
            self._token = survey.token
        try:
            yield file
        except BaseException:
            self._file = None
            # With the error, so that the file is closed without the test for a change, which would raise another one.
            self._opened.__exit__(*sys.exc_info())
            raise
        if not self._keeps or isinstance(survey.path, RemoteFile):
            self.close()

    def close(self) -> None:
        """Close the file, and drop its decoded rows."""
        self._file = None
        self._opened.close()


@dataclass(frozen=True, slots=True)
class Worker:
    """What a task gets beside its arguments."""

    open_file: OpenFile
    progress: Progress = quiet


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


def end_process_after(limit_s: float) -> None:
    """Have the system end this process some seconds after a limit of time, unless ``signal.alarm(0)`` is called."""
    if hasattr(signal, "alarm"):
        # The default action of the signal ends the process, also within a call into C.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(math.ceil(limit_s) + _GRACE_S)


def peak_memory_mib() -> int:
    """Return the peak resident memory of this process so far, MiB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak >> 20 if sys.platform == "darwin" else peak >> 10  # bytes there, KiB elsewhere


@dataclass(frozen=True, slots=True)
class NamedFunction:
    """A function of a module, which is imported where the function is called.

    Attributes
    ----------
    module, name
        Where it is, and what it is called there.
    """

    module: str
    name: str

    def __call__(self, *arguments: Any) -> Any:
        """Import the function and call it."""
        return getattr(import_module(self.module), self.name)(*arguments)


OPEN_AND_CLOSE: Final = NamedFunction(_TASKS, "open_and_close")
CHECK_WHOLE: Final = NamedFunction(_TASKS, "check_whole")
SURVEY_FILE: Final = NamedFunction(_TASKS, "survey_file")
MEASURE_WINDOWS: Final = NamedFunction(_TASKS, "measure_windows")
FINISH_FILE: Final = NamedFunction(_TASKS, "finish_file")
TRAFFIC_OF: Final = NamedFunction(_TASKS, "traffic_of")
UNCOMPILED: Final = NamedFunction(_KERNELS, "uncompiled")
COMPILE_GROUP: Final = NamedFunction(_KERNELS, "compile_group")


def opening_test(path: Place, dialect: "DialectChoice" = None, allow_external: Iterable[Path] = ()) -> Task | None:
    """Return the task that tests whether a file opens within a limit of time; None for a file behind a URL.

    Raises
    ------
    MisuseError
        The environment sets a limit that is no number above 0.
    """
    if isinstance(path, RemoteFile):
        return None
    return Task(OPEN_AND_CLOSE, (path, dialect, tuple(allow_external)), limit_s=opening_limit_s(_OPENING_S))
