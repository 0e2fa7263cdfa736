"""Arrays with their titles."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class TitledArrays:
    """Arrays with titles that can serve as captions.

    Attributes
    ----------
    arrays
        By name.
    titles
        Content and unit of each array, by name.
    """

    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    titles: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def titled(cls, entries: Mapping[str, tuple[NDArray[Any], str]]) -> "TitledArrays":
        """Return the arrays of name: (array, title)."""
        return cls(
            {name: array for name, (array, _) in entries.items()}, {name: title for name, (_, title) in entries.items()}
        )


def merged(parts: Iterable[TitledArrays]) -> TitledArrays:
    """Return the arrays of all parts."""
    arrays: dict[str, NDArray[Any]] = {}
    titles: dict[str, str] = {}
    for part in parts:
        arrays.update(part.arrays)
        titles.update(part.titles)
    return TitledArrays(arrays, titles)
