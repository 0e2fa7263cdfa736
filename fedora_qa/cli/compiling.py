"""Compile for this machine what the selected checks call, once, on all cores."""

from collections.abc import Iterable, Sequence
from concurrent.futures import Future, as_completed
from contextlib import suppress
from typing import Any, Final

import click

from fedora_qa.cli.host import usable_cores
from fedora_qa.cli.progress import progress_bar
from fedora_qa.engine.executor import Executor, Task
from fedora_qa.engine.kernel_groups import KernelGroup, listed_groups
from fedora_qa.engine.processes import ProcessExecutor
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.task_functions import COMPILE_GROUP, UNCOMPILED
from fedora_qa.errors import FedoraError

TITLE: Final = "compiling for this machine, once"


def compile_for(
    subjects: frozenset[str],
    executor: Executor,
    tests: Iterable[Task | None],
    groups: Sequence[KernelGroup] | None = None,
) -> Sequence[KernelGroup]:
    """Compile what checks of some subjects call and this machine has not compiled yet; return those groups.

    Parameters
    ----------
    executor
        Does the checks. Only processes of this machine find later what is compiled here; others compile as they call.
    tests
        Whether each file opens (``opening_test``): where none does, nothing is compiled.
    groups
        In place of those that the package lists.
    """
    if not isinstance(executor, ProcessExecutor):
        return ()
    listed = listed_groups() if groups is None else groups
    try:
        # In a worker: the process of the command loads no measuring code.
        missing: Sequence[KernelGroup] = executor.submit(Task(UNCOMPILED, (subjects, listed)), quiet).result()
    except FedoraError:
        return ()
    if not missing or not any(_opens(test, executor) for test in tests):
        return ()
    click.echo(f"fedora-qa: {TITLE}", err=True)
    with ProcessExecutor(usable_cores()) as compilers, progress_bar(TITLE) as report:
        futures: list[Future[Any]] = [compilers.submit(Task(COMPILE_GROUP, (group,)), quiet) for group in missing]
        for done, future in enumerate(as_completed(futures), start=1):
            # A process that died leaves its group to the check that needs it.
            with suppress(FedoraError):
                future.result()
            report("", done, len(futures))
    return missing


def _opens(test: Task | None, executor: Executor) -> bool:
    """Return whether a file opens; a file without a test, behind a URL, counts as one that does."""
    if test is None:
        return True
    try:
        return bool(executor.submit(test, quiet).result())
    except (FedoraError, OSError):
        return False
