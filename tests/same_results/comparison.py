"""Compare two records of the same files field by field: identical, equal to within rounding, reworded, or different."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isclose
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

Kind = Literal["rounding", "wording", "different"]

STANDARD_ERRORS: Final = 1e-9
"""Change of a value, in its standard errors, that the order of arithmetic explains."""

ROUNDING: Final = 1e-9
"""Relative change of a value without a standard error that the order of arithmetic explains."""

NOT_RESULTS: Final = frozenset({"run", "tool", "path"})
WORDING: Final = frozenset({"message", "reason", "question", "remedy", "traceback", "fault", "evidence"})
"""Fields for readers; all others are results."""


@dataclass(frozen=True, slots=True)
class Change:
    """A field that is not identical."""

    path: str
    kind: Kind
    before: object
    after: object


@dataclass(slots=True)
class Comparison:
    """The changes of all files, by file."""

    files: int = 0
    changes: dict[str, list[Change]] = field(default_factory=dict)

    def add(self, file: str, changes: Iterator[Change]) -> None:
        """Add a file with its changes."""
        self.files += 1
        self.changes[file] = list(changes)

    def of_kind(self, kind: Kind) -> list[tuple[str, Change]]:
        """Return the changes of a kind, each with its file."""
        return [(file, change) for file, changes in self.changes.items() for change in changes if change.kind == kind]

    @property
    def same(self) -> bool:
        """Whether no result differs by more than rounding."""
        return self.files > 0 and not self.of_kind("different")


def compare_values(path: str, before: Any, after: Any, standard_error: float = 0.0) -> Iterator[Change]:
    """Yield the fields in which two JSON values differ.

    Parameters
    ----------
    standard_error
        Of the numbers, where they stand beside one; a change is rounding where it is at most ``STANDARD_ERRORS`` of it.
    """
    name = path.rpartition(".")[2]
    if isinstance(before, Mapping) and isinstance(after, Mapping) and name not in WORDING:
        error = before.get("standard_error") or 0.0
        for key in (*before, *(key for key in after if key not in before)):
            if key not in NOT_RESULTS:
                missing = "(absent)"
                yield from compare_values(f"{path}.{key}", before.get(key, missing), after.get(key, missing), error)
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for number, (old, new) in enumerate(zip(before, after, strict=True)):
            label = old.get("check") or old.get("name") or number if isinstance(old, Mapping) else number
            yield from compare_values(f"{path}[{label}]", old, new, standard_error)
    elif before != after or type(before) is not type(after):
        yield Change(path, _kind(name, before, after, standard_error), before, after)


def _kind(name: str, before: Any, after: Any, standard_error: float) -> Kind:
    if name.partition("[")[0] in WORDING:
        return "wording"
    if isinstance(before, float) and isinstance(after, float):
        bound = STANDARD_ERRORS * standard_error
        if abs(after - before) <= bound or isclose(before, after, rel_tol=ROUNDING):
            return "rounding"
    return "different"


def compare_arrays(before: Mapping[str, NDArray[Any]], after: Mapping[str, NDArray[Any]]) -> Iterator[Change]:
    """Yield the evidence arrays that differ."""
    for name in sorted(before.keys() | after.keys()):
        old, new = before.get(name), after.get(name)
        if old is None or new is None or old.dtype != new.dtype or old.shape != new.shape:
            yield Change(name, "different", _shape(old), _shape(new))
        elif old.tobytes() != new.tobytes():
            is_float = np.issubdtype(old.dtype, np.floating)
            near = is_float and np.allclose(old, new, rtol=ROUNDING, atol=0.0, equal_nan=True)
            yield Change(name, "rounding" if near else "different", _shape(old), _shape(new))


def _shape(array: NDArray[Any] | None) -> str:
    return "(absent)" if array is None else f"{array.dtype} {array.shape}"
