"""Where worker processes come from: forks of one that has loaded everything, so that memory holds it once.

Only on Linux. Elsewhere libraries of the system may not survive a fork, and each process loads everything itself.
"""

import multiprocessing
import os
import signal
import sys
import tempfile
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.context import BaseContext
from typing import Final

_PRELOADED: Final = ["fedora_qa.engine.preloaded", "click"]
"""What a worker needs, and what the command's own module imports, which each process imports again."""


_LONGEST_FOLDER: Final = 70
"""Characters of a temporary folder in which a socket of the fork server can lie: its path may have 107, of which
``multiprocessing`` adds 32."""


def start_method() -> str:
    """Return how processes are started here: spawned, too, where the temporary folder is too deep for a socket."""
    deep = len(os.fsencode(tempfile.gettempdir())) > _LONGEST_FOLDER
    return "forkserver" if sys.platform == "linux" and not deep else "spawn"


def worker_context() -> BaseContext:
    """Return the context that starts worker processes, after beginning to load what they need, where they share it.

    Returns at once: the caller continues while the other process loads on another core.
    """
    context = multiprocessing.get_context(start_method())
    if start_method() == "forkserver":
        context.set_forkserver_preload(_PRELOADED)
        # The fork server is a new interpreter, which finds modules by PYTHONPATH and not by ``sys.path`` of this one.
        # An empty entry of ``sys.path`` is the working directory, which is written out here.
        before = os.environ.get("PYTHONPATH")
        os.environ["PYTHONPATH"] = os.pathsep.join(dict.fromkeys(path or "." for path in sys.path))
        try:
            forkserver.ensure_running()
        finally:
            if before is None:
                del os.environ["PYTHONPATH"]
            else:
                os.environ["PYTHONPATH"] = before
    return context


def begin_preloading() -> None:
    """Begin to load what workers need, where they share it, before their tasks are known.

    An error of the system is raised again where a worker is first needed.
    """
    with suppress(OSError):
        worker_context()


def end_fork_server() -> None:
    """End the process that workers were forked from, and wait for it, so that a command leaves nothing behind.

    Only for the end of a program: other code in it that forks from that process would lose it. It ends by itself soon
    after the program in any case. It is killed, as it holds nothing that would have to be written or closed, and to
    unload all its modules takes time.
    """
    server = forkserver._forkserver
    stop, process_id = (getattr(server, name, None) for name in ("_stop", "_forkserver_pid"))
    if stop is not None and process_id is not None:
        with suppress(ProcessLookupError):
            os.kill(process_id, signal.SIGKILL)
        # ``_stop`` of multiprocessing waits for the process, and removes its socket.
        stop()
