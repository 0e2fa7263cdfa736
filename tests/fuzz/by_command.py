"""What the command makes of a mutant that did not come to an end within a process of ours.

HDF5 follows some structures for ever. The command opens files in processes that it ends (docs/hostile-files.md).
"""

import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Final

from fedora_qa.cli.exit_codes import INCOMPLETE
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from fedora_qa.storage.signature import OPENING_VARIABLE

LONGEST_S: Final = 10
"""Seconds of processor after which something hangs."""

WAITS_S: Final = 600


def by_command(mutant: Path) -> str:
    """Return ``ended`` where the command, start included, ended within ``LONGEST_S`` and did not call it seen."""
    environment = {name: value for name, value in os.environ.items() if name != IN_PROCESS_VARIABLE}
    environment[OPENING_VARIABLE] = "5"
    spent_s = _children_s()
    command = [sys.executable, "-m", "fedora_qa", "check", str(mutant)]
    try:
        ran = subprocess.run(command, capture_output=True, env=environment, timeout=WAITS_S, check=False)
    except subprocess.TimeoutExpired:
        return "hang"
    return "ended" if ran.returncode == INCOMPLETE and _children_s() - spent_s < LONGEST_S else "hang"


def _children_s() -> float:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime
