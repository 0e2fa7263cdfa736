"""Executors that stay in the process and do to tasks what others may do to them."""

import pickle
from concurrent.futures import Future
from typing import Any

from fedora_qa.engine.executors.executor import InProcess, Kept, OpenFile, Task, Worker
from fedora_qa.engine.file_work import PackedSurvey
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import WorkerLostError


class Travels(InProcess):
    """Sends every task and every result through pickle, as several workers would get and give them."""

    capacity = 3
    sharing = 3

    def submit(self, task: Task, progress: Progress) -> Future[Any]:
        arrived: Task = pickle.loads(pickle.dumps(task))
        future: Future[Any] = Future()
        future.set_result(pickle.loads(pickle.dumps(arrived.do(Worker(OpenFile(keeps=False), progress)))))
        return future


class Loses(Travels):
    """Loses the process of every task whose description holds one of the words, so often.

    A task is described by its function, its file and the windows that it is to measure: ``measure_windows a.h5 [2]``.
    """

    def __init__(self, *words: str, times: int = 1) -> None:
        self._left = dict.fromkeys(words, times)
        self.done: list[str] = []

    def submit(self, task: Task, progress: Progress) -> Future[Any]:
        described = describe(task)
        for word in self._left:
            if word in described and self._left[word]:
                self._left[word] -= 1
                future: Future[Any] = Future()
                future.set_exception(WorkerLostError("lost"))
                return future
        self.done.append(described)
        return super().submit(task, progress)


def describe(task: Task) -> str:
    """Return the task's function, the name of its file, and its windows."""
    subject, name = task.arguments[0], task.function.name
    subject = subject.load() if isinstance(subject, Kept) else subject
    place = subject.path if isinstance(subject, PackedSurvey) else subject
    return f"{name} {place.name} {list(task.arguments[1]) if name == 'measure_windows' else ''}".strip()
