"""What no value of a scene may be, whatever its key; each option says itself what else it needs."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

LARGEST: Final = 1e12
"""Of no quantity of a scene is there more, in its unit; squares and cubes of it are far from the end of float64."""

MOST_SEED: Final = (1 << 63) - 1
"""A file stores the seed with 64 bits."""


def impossible_value(tables: Mapping[str, Any]) -> str | None:
    """Say in one sentence which value cannot be: not finite, too large, or true or false where numbers belong."""
    for key, value in _leaves(tables, ""):
        most = MOST_SEED if key.endswith("seed") else LARGEST
        if isinstance(value, bool):
            return f"Expected a number or a text, got {str(value).lower()} at {key}"
        if isinstance(value, int | float) and not (math.isfinite(value) and abs(value) <= most):
            return f"Expected a finite number of at most {most:g}, got {value:g} at {key}"
        if isinstance(value, str) and "\0" in value:
            return f"Expected text without zero bytes, got {value!r} at {key}"
    return None


def _leaves(value: Any, key: str) -> Iterator[tuple[str, Any]]:
    """Every value that is neither a table nor a list, and where it lies."""
    if isinstance(value, Mapping):
        for name, part in value.items():
            yield from _leaves(part, f"{key}.{name}" if key else name)
    elif isinstance(value, list | tuple):
        for index, part in enumerate(value):
            yield from _leaves(part, f"{key}.{index}")
    else:
        yield key, value
