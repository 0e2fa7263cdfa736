"""What a result is made from: the datasets, timestamps and declarations that were read for it.

A view of a sequence, with a fault undone or planted, differs from the sequence in a few inputs. Results that were made
from none of these are the same in both.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Final, Generic, TypeVar

import numpy as np

from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.facts import Facts

Value = TypeVar("Value")

Inputs = frozenset[str]
"""Names of inputs: ``path/rgb`` for rows, ``facts.clocks.rgb`` for a fact, ``owned.rgb`` for the rows of a window."""

FACTS: Final = "facts"
OWNED: Final = "owned"


@dataclass(frozen=True, slots=True)
class Traced(Generic[Value]):
    """A value with what it was made from."""

    value: Value
    inputs: Inputs


class InputLog:
    """Notes what is read while results are made, one within another."""

    def __init__(self) -> None:
        self._open: list[set[str]] = []

    def note(self, *names: str) -> None:
        """Note inputs of every result that is being made."""
        if self._open:
            self._open[-1].update(names)

    def trace(self, make: Callable[[], Value]) -> Traced[Value]:
        """Make a result, and return it with its inputs."""
        self._open.append(set())
        try:
            value = make()
        finally:
            # What a result is made from is an input of the one around it, also where reading fails.
            inputs = self._open.pop()
            self.note(*inputs)
        return Traced(value, frozenset(inputs))


class TracedMapping(Mapping[str, Value]):
    """A mapping that notes which of its entries are read, and where all of its keys are.

    Parameters
    ----------
    values
        The mapping.
    name
        Of the mapping as an input.
    log
        Notes what is read.
    """

    def __init__(self, values: Mapping[str, Value], name: str, log: InputLog) -> None:
        self._values = values
        self._name = name
        self._log = log

    def __getitem__(self, key: str) -> Value:
        self._log.note(f"{self._name}.{key}")
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        self._log.note(self._name)
        return iter(self._values)

    def __len__(self) -> int:
        self._log.note(self._name)
        return len(self._values)


class TracedFields:
    """Facts or declarations that note which of their fields are read. Parameters as of ``TracedMapping``."""

    def __init__(self, values: Facts | Declared, name: str, log: InputLog) -> None:
        self._values = values
        self._name = name
        self._log = log

    def __getattr__(self, name: str) -> Any:
        values, path = self._values, f"{self._name}.{name}"
        if name not in type(values).__dataclass_fields__:
            # A property or method reads fields of these in turn.
            return getattr(type(values), name).__get__(self, type(values))
        value = getattr(values, name)
        if isinstance(value, Mapping):
            return TracedMapping(value, path, self._log)
        if isinstance(value, Declared):
            return TracedFields(value, path, self._log)
        self._log.note(path)
        return value


def changed_inputs(before: Any, after: Any, name: str) -> Iterator[str]:
    """Yield the names, as ``TracedFields`` and ``TracedMapping`` note them, of what differs between two facts."""
    if before is after:
        return
    if isinstance(before, Facts | Declared) and type(before) is type(after):
        for field in fields(before):
            yield from changed_inputs(getattr(before, field.name), getattr(after, field.name), f"{name}.{field.name}")
    elif isinstance(before, Mapping) and isinstance(after, Mapping):
        for key in before.keys() & after.keys():
            yield from changed_inputs(before[key], after[key], f"{name}.{key}")
        if lone := before.keys() ^ after.keys():
            yield name
            yield from (f"{name}.{key}" for key in lone)
    elif not _is_same(before, after):
        yield name


def _is_same(before: Any, after: Any) -> bool:
    """Whether two values are the same in every bit that a result can be made from; False in case of doubt."""
    if before is after:
        return True
    if type(before) is not type(after):
        return False
    if isinstance(before, np.ndarray):
        return bool(before.dtype == after.dtype and before.shape == after.shape and before.tobytes() == after.tobytes())
    if is_dataclass(before):
        return all(_is_same(getattr(before, field.name), getattr(after, field.name)) for field in fields(before))
    if isinstance(before, tuple | list):
        return len(before) == len(after) and all(map(_is_same, before, after))
    if isinstance(before, Mapping):
        return list(before) == list(after) and all(_is_same(before[key], after[key]) for key in before)
    return bool(before == after)
