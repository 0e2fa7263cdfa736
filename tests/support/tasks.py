"""Functions of tasks for executors, to be done in processes of their own."""

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

from fedora_qa.engine.executors.executor import Kept, Worker


def count(to: int, worker: Worker) -> tuple[int, int]:
    """Tell each number, and return the last with the process that counted."""
    for number in range(to):
        worker.progress("counting", number, to)
    return to, os.getpid()


def die(worker: Worker) -> None:
    """End the process as the system does when memory runs out."""
    os.kill(os.getpid(), signal.SIGKILL)


def leave(worker: Worker) -> None:
    """End the process from within."""
    os._exit(7)


def leave_quietly(worker: Worker) -> None:
    """End the process from within, as if all were well."""
    os._exit(0)


def burn(worker: Worker) -> None:
    """Never end."""
    while True:
        pass


def interrupt(worker: Worker) -> str:
    """Receive what a terminal sends to all of its processes at ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)
    return "done"


def divide(by: int, worker: Worker) -> float:
    """Raise what arithmetic raises."""
    return 1 / by


class StubbornError(Exception):
    """Can be pickled, and not unpickled."""

    def __init__(self, one: str, other: str) -> None:
        super().__init__(f"{one} and {other}")


def be_stubborn(worker: Worker) -> None:
    """Raise what does not travel."""
    raise StubbornError("this", "that")


def write_id_and_sleep(path: Path, worker: Worker) -> None:
    """Say which process this is, and never end."""
    path.with_suffix(".part").write_text(str(os.getpid()))
    path.with_suffix(".part").rename(path)
    time.sleep(3600)


def process_id(worker: Worker) -> int:
    """Say which process this is."""
    return os.getpid()


def loaded_modules(worker: Worker) -> tuple[set[str], int]:
    """Say what is loaded, and which process has started this one."""
    return set(sys.modules), os.getppid()


def sleep(seconds: float, worker: Worker) -> int:
    """Do nothing for a while, and say which process this is."""
    time.sleep(seconds)
    return os.getpid()


def load(kept: Kept, worker: Worker) -> Any:
    """Return what another task has left."""
    return kept.load()
