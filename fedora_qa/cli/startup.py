"""What happens before a command runs: the start is noted, workers begin to load, modules load without collections."""

import gc
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import Final

# Monotonic time in s: a correction of the wall clock must not shorten or lengthen a budget.
START_TIME: Final = "fedora_qa.began"
"""Key of the start of the command (``time.monotonic``) in ``click.Context.meta``, for a budget of time."""

IN_PROCESS_VARIABLE: Final = "FEDORA_QA_IN_PROCESS"
"""If set, a single job runs in the process of the command: for debuggers and profilers."""

_COMMANDS: Final = frozenset({"check", "gate"})

_WITHOUT: Final = frozenset({"-h", "--help", "--dask"})
"""Options with which these commands start no workers."""


def preload_workers(arguments: Sequence[str]) -> None:
    """Begin to load what workers need, if the command will probably start some.

    Loading takes longer than parsing the command line, so both are done at once. A wrong guess costs only time.
    """
    # Both `--dask ADDRESS` and `--dask=ADDRESS` are legal.
    options = {argument.split("=")[0] for argument in arguments}
    if arguments and arguments[0] in _COMMANDS and not options & _WITHOUT and IN_PROCESS_VARIABLE not in os.environ:
        from fedora_qa.engine.fork_server import begin_preloading  # noqa: PLC0415 - other commands need none of it

        begin_preloading(_selected(arguments))


def _selected(arguments: Sequence[str]) -> list[str]:
    """Return what follows each ``--select``: names of checks and subjects, if the command line is right."""
    joined = [argument.partition("=")[2] for argument in arguments if argument.startswith("--select=")]
    return joined + [name for option, name in pairwise(arguments) if option == "--select"]


@contextmanager
def loading_modules() -> Iterator[None]:
    """Import modules without collecting garbage.

    Modules stay loaded. Scanning them while more are loaded, and again at the end, takes a fifth of the time of loading
    (3.1 and 2.4 s, medians of three imports of everything that ``check`` needs, with and without).
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
