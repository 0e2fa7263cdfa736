"""Whether a command line will need processes that measure, guessed before anything of it is understood."""

import os
from collections.abc import Sequence
from typing import Final

IN_PROCESS_VARIABLE: Final = "FEDORA_QA_IN_PROCESS"
"""Where set, a single job is done in the process of the command: for debuggers and profilers."""

_COMMANDS: Final = frozenset({"check", "gate"})

_WITHOUT: Final = frozenset({"-h", "--help", "--dask"})
"""Options with which these commands start none."""


def begin_to_load(arguments: Sequence[str]) -> None:
    """Begin to load what workers need, where they will most likely be needed.

    That takes longer than it takes this process to understand what is asked, so both are done at once. A wrong guess
    costs time alone.
    """
    options = {argument.split("=")[0] for argument in arguments}
    if arguments and arguments[0] in _COMMANDS and not options & _WITHOUT and IN_PROCESS_VARIABLE not in os.environ:
        from fedora_qa.engine.fork_server import begin_preloading  # noqa: PLC0415 - other commands need none of it

        begin_preloading()
