"""A limit of processor time ends a process that is inside a library, and no other."""

import signal
import subprocess
import sys
import threading

from fedora_qa.engine.fuse import fuse

ENDLESS = "sum(iter(int, 1))"
"""Never returns to the interpreter's loop."""


def test_a_process_inside_a_library_is_ended() -> None:
    program = f"from fedora_qa.engine.fuse import fuse\nwith fuse(0.2):\n    {ENDLESS}"
    ended = subprocess.run([sys.executable, "-c", program], timeout=60, check=False)
    assert ended.returncode == -signal.SIGPROF


def test_what_ends_in_time_goes_on_without_a_limit() -> None:
    before = signal.getsignal(signal.SIGPROF)
    with fuse(30.0):
        assert signal.getitimer(signal.ITIMER_PROF)[0] > 0
    assert signal.getitimer(signal.ITIMER_PROF) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGPROF) == before


def test_threads_beside_the_main_one_have_none() -> None:
    seen: list[float] = []

    def work() -> None:
        with fuse(30.0):
            seen.append(signal.getitimer(signal.ITIMER_PROF)[0])

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [0.0]
