"""A limit of processor time ends a process that is inside a library, and no other."""

import signal
import subprocess
import sys
import threading

import pytest

from fedora_qa.engine.time_limit import time_limit

ENDLESS = "sum(iter(int, 1))"
"""Never returns to the interpreter's loop."""


def test_a_process_inside_a_library_is_ended() -> None:
    program = f"from fedora_qa.engine.time_limit import time_limit\nwith time_limit(0.2):\n    {ENDLESS}"
    ended = subprocess.run([sys.executable, "-c", program], timeout=60, check=False)
    assert ended.returncode == -signal.SIGPROF


OPENS = f"""
from pathlib import Path
from fedora_qa.engine import open_file, steps, survey
from fedora_qa.engine.file_task import FileTask
from fedora_qa.engine.options import CheckOptions
survey.open_sequence = lambda *_, **__: {ENDLESS}
open_file.OPENING_S = 0.2
task = FileTask("TASK", Path("seq.h5"), ((), CheckOptions()))
steps.TASK(task, open_file.OpenFile(keeps=True), lambda *_: None)
"""


@pytest.mark.parametrize("task", ["survey_file", "check_whole"])
def test_a_worker_that_opens_a_file_for_ever_is_ended(task: str) -> None:
    """Whichever task opens it first."""
    program = OPENS.replace("TASK", task)
    ended = subprocess.run([sys.executable, "-c", program], timeout=60, check=False)
    assert ended.returncode == -signal.SIGPROF


def test_what_ends_in_time_goes_on_without_a_limit() -> None:
    before = signal.getsignal(signal.SIGPROF)
    with time_limit(30.0):
        assert signal.getitimer(signal.ITIMER_PROF)[0] > 0
    assert signal.getitimer(signal.ITIMER_PROF) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGPROF) == before


def test_threads_beside_the_main_one_have_none() -> None:
    seen: list[float] = []

    def work() -> None:
        with time_limit(30.0):
            seen.append(signal.getitimer(signal.ITIMER_PROF)[0])

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [0.0]
