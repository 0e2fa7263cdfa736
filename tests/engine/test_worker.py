"""A worker keeps what it has at hand while there is work, and lets go of it when there is none."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from threading import Event
from typing import Any

import pytest

from fedora_qa.engine import worker
from fedora_qa.engine.open_file import OpenFile
from fedora_qa.engine.worker import ProgressReport, TaskResult
from tests.support import tasks


@pytest.fixture
def cleared(monkeypatch: pytest.MonkeyPatch) -> Event:
    """Set when a worker that runs in this process clears its open file."""
    told = Event()

    class Watched(OpenFile):
        def clear(self) -> None:
            super().clear()
            told.set()

    monkeypatch.setattr(worker, "OpenFile", Watched)
    monkeypatch.setattr("signal.signal", lambda *_: None)  # as this process is no worker
    return told


def _count(pipe: "Connection[Any, Any]") -> int:
    pipe.send(partial(tasks.count, 1))
    while isinstance(answer := pipe.recv(), ProgressReport):
        pass
    assert isinstance(answer, TaskResult)
    count, _ = answer.result
    return int(count)


def test_a_worker_that_waits_clears_its_open_file(cleared: Event, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a short while without a task the file is closed, and what comes then is done as ever."""
    monkeypatch.setattr(worker, "_PATIENCE_S", 0.01)

    def ask(pipe: "Connection[Any, Any]") -> tuple[bool, int]:
        with pipe:
            return cleared.wait(60), _count(pipe)

    here, there = Pipe()
    with ThreadPoolExecutor(1) as threads:
        asked = threads.submit(ask, here)
        worker.serve(there, 1)
        assert asked.result() == (True, 1)


def test_a_worker_at_work_keeps_its_open_file(cleared: Event, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between tasks that follow each other nothing is closed."""
    monkeypatch.setattr(worker, "_PATIENCE_S", 60)

    def ask(pipe: "Connection[Any, Any]") -> list[int]:
        with pipe:
            return [_count(pipe) for _ in range(3)]

    here, there = Pipe()
    with ThreadPoolExecutor(1) as threads:
        asked = threads.submit(ask, here)
        worker.serve(there, 1)
        assert asked.result() == [1, 1, 1]
    assert not cleared.is_set()
