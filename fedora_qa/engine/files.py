"""Check several files at once, and the windows of each, with whatever executor does the tasks."""

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from fedora_qa.engine.executors.executor import SILENCE_S, Executor
from fedora_qa.engine.file_work import FileWork, WorkStep
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import ProgressTally, Report
from fedora_qa.errors import EndlessError, WorkerLostError
from fedora_qa.storage.place import Place
from fedora_qa.storage.server import version_of

if TYPE_CHECKING:  # loads what measures
    from fedora_qa.checks.protocol import Check

_LIBRARIES_BYTES: Final = 320_000_000
"""Bytes that all processes of a run share, as they are forked from one, and bytes of the process of the command.

Measured before the first window (/proc/PID/smaps_rollup), private bytes: the command 104 MB; the process that watches
its children 6 MB; the process that others are forked from 95 MB; and 110 MB of library files, which all share.
"""

_COPIED_BYTES: Final = 20_000_000
"""Bytes of those pages that each process copies as it writes into them, 17 MB after some windows, which
its share of the memory does not hold; and bytes of its page tables."""

_LEAST_SHARE: Final = 0.25
"""Least share of the memory for the tasks, where libraries would leave less."""


def check_files(
    paths: Sequence[Place],
    options: CheckOptions,
    executor: Executor,
    report: Report,
    began: float | None = None,
    *,
    checks: "tuple[Check[Any], ...] | None" = None,
) -> Iterator[tuple[Place, FileRun]]:
    """Check files, and yield each as soon as it is done. The result does not depend on which worker measures.

    Parameters
    ----------
    options
        Their memory is that of the whole run, and each task gets its share. Their budget of time is that of the whole
        run as well: a file gets a part of what is left in proportion to its bytes; what it does not use is left to the
        files after it.
    began
        Since when (``time.monotonic``) the budget of time counts; now where None.
    checks
        In place of those that the options select.

    Raises
    ------
    MisuseError
        The options name an unknown check, or a path is no HDF5 file.
    FedoraError
        A file was changed while it was checked, or no worker is left for the tasks.
    """
    # Bytes that belong to no task: libraries once, copied pages for each process.
    beside = _LIBRARIES_BYTES + executor.sharing * _COPIED_BYTES
    for_tasks = max(options.memory_bytes - beside, int(_LEAST_SHARE * options.memory_bytes))
    options = replace(options, memory_bytes=for_tasks // executor.sharing)
    if options.budget_s is not None:
        from fedora_qa.engine.budget import check_within_budget  # noqa: PLC0415 - loads HDF5

        yield from check_within_budget(paths, checks, options, executor, report, began)
        return

    def tell(doing: str) -> None:
        # ``works`` is assigned below: nothing is reported before the first step runs.
        report(
            ProgressTally(
                doing=doing,
                files_done=sum(work.is_done for work in works),
                files=len(works),
                windows_done=sum(work.windows_done for work in works),
                windows=sum(work.windows for work in works),
                bytes_done=int(sum(work.share_done * work.bytes for work in works)),
                bytes=sum(work.bytes for work in works),
            )
        )

    works = [FileWork(path, version_of(path).size, checks, options, executor.capacity, tell) for path in paths]
    running: dict[Future[Any], tuple[WorkStep, int]] = {}
    waiting = list(works)
    while waiting:
        # Keep the executor busy. Earlier files come first, so that few are open at a time and each is soon done. There
        # are no more tasks than workers: the one that has just ended a task gets the next, of its own neighbourhood.
        busy = {worker for _, worker in running.values()}
        idle = deque(worker for worker in range(executor.capacity) if worker not in busy)
        for work in waiting:
            while idle and (step := work.take(idle[0])):
                worker = idle.popleft()
                running[executor.submit(step.task, step.progress)] = step, worker
        done, _ = wait(running, timeout=SILENCE_S, return_when=FIRST_COMPLETED)
        if not done:
            executor.require_workers()
        for future in done:
            step, _ = running.pop(future)
            try:
                # Also what follows may need a worker, that keeps the result.
                step.then(future.result())
            except EndlessError:
                (step.when_endless or step.when_lost)()
            except WorkerLostError:
                step.when_lost()
        # A copy, as files that are done leave the list.
        for work in tuple(waiting):
            if work.is_done:
                waiting.remove(work)
                tell(f"{work.path.name}: done")
                yield work.path, work.hand_over()
