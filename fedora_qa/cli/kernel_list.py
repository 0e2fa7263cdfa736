"""The list of compiled functions that checks call: ``python -m fedora_qa.cli.kernel_list FILE...`` writes it anew.

Functions are found by checking files, subject by subject. What the files do not need is not listed.
"""

import json
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from numba.core.dispatcher import Dispatcher

from fedora_qa.catalogue import all_checks
from fedora_qa.check_names import subject_of
from fedora_qa.engine.compilation.kernel_groups import KERNELS_PATH, KernelGroup
from fedora_qa.engine.compilation.kernels import kernel_of, text_of
from fedora_qa.engine.executors.executor import Task, Worker
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.atomic import write_text

Called = frozenset[tuple[str, str, str]]
"""Functions that were called: module, name, and types of arguments as JSON."""


def called_by(path: Path, select: tuple[str, ...], _: Worker) -> Called:
    """Check a file, and return the compiled functions of the package that Python called in this process."""
    check_file(path, CheckOptions(select=select))
    modules = {name: module for name, module in sys.modules.items() if name.startswith("fedora_qa.")}
    return frozenset(
        (module, name, json.dumps([text_of(stated) for stated in types]))
        for module, namespace in modules.items()
        for name, kernel in vars(namespace).items()
        if isinstance(kernel, Dispatcher) and kernel.py_func.__module__ == module
        for types in kernel.signatures
    )


def groups_of(called: Mapping[str, Iterable[Called]]) -> tuple[KernelGroup, ...]:
    """Return the groups of the functions that each subject called, the longest code first.

    Raises
    ------
    ValueError
        A function was called with several types. It would be compiled several times, and Numba's cache is not made for
        processes that add to a function at the same time.
    """
    subjects: dict[str, set[str]] = defaultdict(set)
    types_by_name: dict[str, dict[str, str]] = defaultdict(dict)
    for subject, calls in called.items():
        for module, name, types in sorted(frozenset[tuple[str, str, str]]().union(*calls)):
            subjects[module].add(subject)
            before = types_by_name[module].setdefault(name, types)
            if before != types:
                raise ValueError(f"Expected {module}.{name} to be called with {before} alone, got {types} too")
    groups = [
        KernelGroup(
            module, tuple(sorted(subjects[module])), {name: json.loads(types) for name, types in kernels.items()}
        )
        for module, kernels in types_by_name.items()
    ]

    def code_bytes(group: KernelGroup) -> int:
        # Compiling takes about as long as the code is.
        return sum(len(kernel_of(group.module, name).py_func.__code__.co_code) for name in group.argument_types)

    return tuple(sorted(groups, key=lambda group: (-code_bytes(group), group.module)))


def list_kernels(paths: Sequence[Path]) -> tuple[KernelGroup, ...]:
    """Return the groups of functions that the checks call on some files."""
    return groups_of(
        {
            subject: [_called_alone(path, subject) for path in paths]
            for subject in sorted({subject_of(check.name) for check in all_checks()})
        }
    )


def _called_alone(path: Path, subject: str) -> Called:
    """Return what a subject calls in a process of its own, which finds everything compiled.

    A function that another one calls is then no part of it: it is linked into its caller.
    """
    for _ in range(2):
        with ProcessExecutor(1) as executor:
            called: Called = executor.submit(Task(called_by, (path, (subject,))), quiet).result()
    return called


if __name__ == "__main__":
    listed = [asdict(group) for group in list_kernels([Path(argument) for argument in sys.argv[1:]])]
    write_text(KERNELS_PATH, json.dumps(listed, indent=1) + "\n")
