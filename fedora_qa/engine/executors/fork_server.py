"""Where worker processes come from: forks of one that has loaded what they need, so that memory holds it once.

Nothing that measures is imported here, so that the fork server starts before the command line is parsed.
"""

import multiprocessing
import os
import sys
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.context import BaseContext
from typing import Final

from fedora_qa.check_names import is_selected, module_of
from fedora_qa.checks.explanation import published_explanations

_LONGEST_FOLDER: Final = 70
"""Characters of a temporary folder in which a socket of the fork server can lie: its path may have 107, of which
``multiprocessing`` adds 32."""


def start_method() -> str:
    """Return how processes are started here: forked, on Linux, from one that has loaded what measures.

    Elsewhere libraries of the system may not survive a fork, and in a temporary folder too deep for a socket there can
    be no fork server: each process then loads everything by itself.
    """
    deep = len(os.fsencode(tempfile.gettempdir())) > _LONGEST_FOLDER
    return "forkserver" if sys.platform == "linux" and not deep else "spawn"


def worker_context(names: Iterable[str] = ()) -> BaseContext:
    """Return the context that starts worker processes, after beginning to load what they need, where they share it.

    Returns at once: the caller continues while the other process loads on another core.

    Parameters
    ----------
    names
        Of subjects and checks that will be needed; empty: all. A worker loads what else it needs by itself. They have
        no effect where the loading has begun before.
    """
    context = multiprocessing.get_context(start_method())
    if start_method() == "forkserver":
        context.set_forkserver_preload(preloaded_modules(names))
        forkserver.ensure_running()
    else:
        # Processes inherit it. OpenBLAS reads it when NumPy is loaded; a worker has one core and small matrices.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    return context


def begin_preloading(names: Iterable[str] = ()) -> None:
    """Begin to load what workers need, where they share it, before their tasks are known; ``worker_context`` says more.

    An error of the system is raised again where a worker is first needed.
    """
    with suppress(OSError):
        worker_context(names)


def preloaded_modules(names: Iterable[str]) -> list[str]:
    """Return the modules that are loaded before workers are forked: the engine, then the checks that are named."""
    checks = [each.check for each in published_explanations()]
    select = tuple(names)
    # Each process imports again what the module of the command imports: click.
    return [
        "fedora_qa.engine.preload",
        *(module_of(check) for check in checks if is_selected(check, select, ())),
        "click",
        "fedora_qa.engine.preloaded",
    ]
