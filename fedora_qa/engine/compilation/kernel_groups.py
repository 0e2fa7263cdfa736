"""Which compiled functions the checks call, with which types, as ``kernels.json`` lists them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

TypeText = str | dict[str, list[Any]]
"""A type as Numba writes and reads it; a tuple as its class with the types of its elements."""

KERNELS_PATH: Final = Path(__file__).with_name("kernels.json")


@dataclass(frozen=True, slots=True)
class KernelGroup:
    """The compiled functions of a module that checks call.

    Attributes
    ----------
    module
        Where they are defined.
    subjects
        Subjects of the checks that call one of them.
    argument_types
        Of each function by its name: the types of its arguments.
    """

    module: str
    subjects: tuple[str, ...]
    argument_types: Mapping[str, Sequence[TypeText]]


def listed_groups(path: Path = KERNELS_PATH) -> tuple[KernelGroup, ...]:
    """Return the groups of a list, in the order in which they are best compiled: the dearest first."""
    return tuple(
        KernelGroup(group["module"], tuple(group["subjects"]), group["argument_types"])
        for group in json.loads(path.read_text(encoding="utf-8"))
    )
