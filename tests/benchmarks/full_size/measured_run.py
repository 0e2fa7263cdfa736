"""A command as a user starts it: how long, how much of the processors, how much memory over all its processes."""

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import psutil

_EVERY_S: Final = 0.5
"""Between two looks at all processes; what is held for less may be missed, and what a process spends after the last
look before it ends. A look at 1 GB takes 33 ms of a core."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a command.

    Attributes
    ----------
    code
        Exit code.
    wall_s, cpu_s
        Seconds that passed, and those of all processors over all its processes.
    peak_bytes
        Largest sum over its processes of their proportional set sizes: what several share counts once.
    """

    code: int
    wall_s: float
    cpu_s: float
    peak_bytes: int


def run_measured(command: Sequence[str], threads: int = 1) -> Run:
    """Run a command to its end, its libraries with so many threads; its output is thrown away.

    Python keeps the bytecode of what it imports, as it does unless told otherwise.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "NUMBA_NUM_THREADS": str(threads)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    began, began_cpu = time.perf_counter(), _cpu_of_children_s()
    # By process: workers end as children of a fork server, whose time is added to no ancestor's.
    spent_s: dict[int, float] = {}
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        peak = 0
        while process.returncode is None:
            processes = _processes(process.pid)
            peak = max(peak, sum(map(_proportional_bytes, processes)))
            for each in processes:
                spent_s[each.pid] = max(spent_s.get(each.pid, 0.0), _cpu_s(each))
            with suppress(subprocess.TimeoutExpired):  # it still runs
                process.wait(_EVERY_S)
    cpu_s = max(sum(spent_s.values()), _cpu_of_children_s() - began_cpu)
    return Run(process.returncode, time.perf_counter() - began, cpu_s, peak)


def fedora_qa(*arguments: str) -> list[str]:
    """Return the command line of the tool that this environment holds."""
    return [sys.executable, "-c", "from fedora_qa.cli.main import main; main()", *arguments]


def _processes(pid: int) -> list[psutil.Process]:
    """Return a process and all that descend from it; none once it has ended."""
    try:
        parent = psutil.Process(pid)
        return [parent, *parent.children(recursive=True)]
    except psutil.Error:
        return []


def _cpu_s(process: psutil.Process) -> float:
    try:
        times = process.cpu_times()
        return float(times.user + times.system)
    except psutil.Error:
        return 0.0  # it has just ended


def _proportional_bytes(process: psutil.Process) -> int:
    try:
        return int(process.memory_full_info().pss)
    except psutil.Error:
        return 0  # it has just ended


def _cpu_of_children_s() -> float:
    spent = os.times()
    return spent.children_user + spent.children_system
