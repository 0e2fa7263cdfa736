"""Compile the loops of checks in several processes at once, before they are needed.

Numba compiles a function when it is first called, and keeps the result on disk. In one process that takes a minute for
all checks. What ``kernel_groups`` does not list is compiled when it is called. ``python -m fedora_qa.cli.kernel_list``
writes the list.
"""

import hashlib
import importlib
import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import registry, types
from numba.core.dispatcher import Dispatcher
from numba.core.sigutils import normalize_signature

from fedora_qa.engine.compilation.kernel_groups import KernelGroup, TypeText
from fedora_qa.engine.executors.executor import Worker
from fedora_qa.record.atomic import write_text


def uncompiled(subjects: Iterable[str], groups: Sequence[KernelGroup], _: Worker) -> list[KernelGroup]:
    """Return those groups of some subjects that this machine has not compiled as they are now."""
    wanted = frozenset(subjects)
    return [group for group in groups if wanted.intersection(group.subjects) and not _is_compiled(group)]


def compile_group(group: KernelGroup, _: Worker) -> None:
    """Compile a group into Numba's cache, and note there that it is done.

    Raises nothing: a function that cannot be compiled raises where a check calls it, and a cache that cannot be written
    to only costs time.
    """
    for name, texts in group.argument_types.items():
        # Whatever goes wrong here is not a finding: the check that needs the function reports it.
        with suppress(Exception):
            kernel_of(group.module, name).compile(tuple(type_of(text) for text in texts))
    with suppress(OSError):
        note = _note_path(group)
        if note:
            write_text(note, _note_text(group))


def kernel_of(module: str, name: str) -> Dispatcher:
    """Return a compiled function; raises ``ImportError``, ``AttributeError`` or ``TypeError`` where it is none."""
    kernel: Any = getattr(importlib.import_module(module), name)
    if not isinstance(kernel, Dispatcher):
        raise TypeError(f"Expected {module}.{name} to be a function that Numba compiles, got {type(kernel).__name__}")
    return kernel


def type_of(text: TypeText) -> Any:
    """Return the type that a text states; raises whatever Numba raises where it states none."""
    if isinstance(text, str):
        (stated,), _ = normalize_signature(f"({text},)")  # type: ignore[no-untyped-call]
        return stated
    ((name, fields),) = text.items()
    module, _, qualified = name.partition(":")
    named = getattr(importlib.import_module(module), qualified)
    # Only a class with named fields is a part of the type.
    return types.BaseTuple.from_types([type_of(field) for field in fields], None if named is tuple else named)  # type: ignore[no-untyped-call]


def text_of(stated: Any) -> TypeText:
    """Return the text that states a type."""
    if isinstance(stated, types.BaseTuple):
        fields: Iterable[Any] = iter(stated)  # type: ignore[call-overload]
        named: type = getattr(stated, "instance_class", tuple)
        return {f"{named.__module__}:{named.__qualname__}": [text_of(field) for field in fields]}
    return repr(stated)


def _is_compiled(group: KernelGroup) -> bool:
    """Return whether a note beside Numba's cache says so; False as well where the note cannot be read."""
    try:
        note = _note_path(group)
        return note is not None and note.read_text(encoding="utf-8") == _note_text(group)
    except (OSError, ImportError, AttributeError, TypeError, UnicodeDecodeError):
        return False


def _note_path(group: KernelGroup) -> Path | None:
    """Return where it is noted that a group is compiled; None where Numba keeps nothing."""
    folder = kernel_of(group.module, next(iter(group.argument_types))).stats.cache_path
    return Path(folder, f"{group.module}.compiled") if folder else None


def _note_text(group: KernelGroup) -> str:
    """Return what decides whether Numba can use what it has kept: source, versions, processor and types."""
    source = importlib.import_module(group.module).__file__
    deciding = (
        hashlib.sha256(Path(source).read_bytes()).hexdigest() if source else "",
        numba.__version__,
        registry.cpu_target.target_context.codegen().magic_tuple(),
        dict(group.argument_types),
    )
    return hashlib.sha256(json.dumps(deciding, sort_keys=True).encode()).hexdigest() + "\n"
