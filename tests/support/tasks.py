"""Tasks for executors, to be done in processes of their own. Nothing heavy is imported here."""

import os
import signal
import sys
import time
from pathlib import Path

from fedora_qa.engine.progress import Progress
from fedora_qa.engine.time_limit import time_limit


def count(to: int, progress: Progress) -> tuple[int, int]:
    """Tell each number, and return the last with the process that counted."""
    for number in range(to):
        progress("counting", number, to)
    return to, os.getpid()


def die(progress: Progress) -> None:
    """End the process as the system does when memory runs out."""
    os.kill(os.getpid(), signal.SIGKILL)


def leave(progress: Progress) -> None:
    """End the process from within."""
    os._exit(7)


def burn(progress: Progress) -> None:
    """Never end, with a limit of processor time."""
    with time_limit(0.05):
        while True:
            pass


def interrupt(progress: Progress) -> str:
    """Receive what a terminal sends to all of its processes at ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)
    return "done"


def divide(by: int, progress: Progress) -> float:
    """Raise what arithmetic raises."""
    return 1 / by


class StubbornError(Exception):
    """Can be pickled, and not unpickled."""

    def __init__(self, one: str, other: str) -> None:
        super().__init__(f"{one} and {other}")


def be_stubborn(progress: Progress) -> None:
    """Raise what does not travel."""
    raise StubbornError("this", "that")


def write_id_and_sleep(path: Path, progress: Progress) -> None:
    """Say which process this is, and never end."""
    path.with_suffix(".part").write_text(str(os.getpid()))
    path.with_suffix(".part").rename(path)
    time.sleep(3600)


def process_id(progress: Progress) -> int:
    """Say which process this is."""
    return os.getpid()


def loaded_modules(progress: Progress) -> tuple[set[str], int]:
    """Say what is loaded, and which process has started this one."""
    return set(sys.modules), os.getppid()
