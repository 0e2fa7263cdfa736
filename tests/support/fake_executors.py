"""Executors that stay in the process and do to tasks what others may do to them."""

import pickle
from concurrent.futures import Future
from typing import Any

from fedora_qa.engine.executors import InProcess, Task
from fedora_qa.engine.file_task import FileTask, Surveyed
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import WorkerLostError


class Travels(InProcess):
    """Sends every task and every result through pickle, as several workers would get and give them."""

    capacity = 3
    sharing = 3

    def submit(self, task: Task[Any], progress: Progress, worker: int | None = None) -> Future[Any]:
        arrived = pickle.loads(pickle.dumps(task))
        future: Future[Any] = Future()
        future.set_result(pickle.loads(pickle.dumps(arrived(progress))))
        return future


class Loses(Travels):
    """Loses the process of every task whose description holds one of the words, so often.

    A task is described by its function, its file and the windows that it is to measure: ``measure_windows a.h5 [2]``.
    """

    def __init__(self, *words: str, times: int = 1) -> None:
        self._left = dict.fromkeys(words, times)
        self.done: list[str] = []

    def submit(self, task: Task[Any], progress: Progress, worker: int | None = None) -> Future[Any]:
        described = describe(task)
        for word in self._left:
            if word in described and self._left[word]:
                self._left[word] -= 1
                future: Future[Any] = Future()
                future.set_exception(WorkerLostError("lost"))
                return future
        self.done.append(described)
        return super().submit(task, progress, worker)


def describe(task: Any) -> str:
    """Return the task's function, the name of its file, and its windows."""
    if isinstance(task, FileTask):
        place = task.subject.path if isinstance(task.subject, Surveyed) else task.subject
        return f"{task.function} {place.name} {list(task.windows) or ''}".strip()
    path = task.args[0].path
    windows = list(task.args[1]) if task.func.__name__ == "measure_sampled" else ""
    return f"{task.func.__name__} {path.name} {windows}".strip()
