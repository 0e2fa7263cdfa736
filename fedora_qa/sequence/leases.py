"""Arrays that neighbouring windows share: decoded rows, and what is computed of single images.

The halo of a window lies in its neighbours, so that most rows are needed by two or more windows. A window leases each
array that it requests. The lease ends when a whole window has passed that did not request the array; of rows that a
later window owns, not before that window.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Final, TypeVar, cast

import numpy as np

Value = TypeVar("Value")

_UNLIMITED: Final = 1 << 62


class Leases:
    """Keeps an array until a window has passed in which it was not requested.

    Where the limit of bytes is reached, leases of earlier windows end first, the oldest first. An array that still
    does not fit is not kept, and is made again at a later request: that costs time and changes no result.

    Parameters
    ----------
    limit_bytes
        Most bytes to keep.
    """

    def __init__(self, limit_bytes: int = _UNLIMITED) -> None:
        self.limit_bytes = limit_bytes
        self.kept_bytes = 0
        # Arrays that earlier windows requested and this one has not yet, and those that this one requested. Both are in
        # the order of request.
        self._before: dict[Hashable, Any] = {}
        self._now: dict[Hashable, Any] = {}
        # Bytes of each when it was made: results may keep more later.
        self._sizes: dict[Hashable, int] = {}
        # The latest array that did not fit: a search reads one block many times.
        self._latest: tuple[Hashable, Any] | None = None

    def begin_window(self, is_ahead: Callable[[Hashable], bool] = lambda _: False) -> None:
        """End the leases of arrays that the last window did not request, unless a later window is to request them.

        Parameters
        ----------
        is_ahead
            Whether the array of a key belongs to the window that begins, or to a later one.
        """
        for key in tuple(self._before):
            if not is_ahead(key):
                self._end(key)
        # Those that were requested last are the last to end where bytes are short.
        self._before, self._now = self._before | self._now, {}
        self._latest = None

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """Return the value of a key, an array or an error in its place; ``make`` makes it where it is not kept."""
        kept = self.find(key)
        if kept is not None:
            return cast(Value, kept)
        value = make()
        self.keep(key, value)
        return value

    def find(self, key: Hashable) -> Any:
        """Return the value of a key that is kept; None where it is not."""
        if key in self._now:
            return self._now[key]
        if key in self._before:
            value = self._now[key] = self._before.pop(key)
            return value
        return self._latest[1] if self._latest and self._latest[0] == key else None

    def keep(self, key: Hashable, value: object) -> None:
        """Keep the value of a key that is not kept, where it fits."""
        size = _bytes(value)
        while self._before and size <= self.limit_bytes < self.kept_bytes + size:
            self._end(next(iter(self._before)))
        if self.kept_bytes + size <= self.limit_bytes:
            self._now[key], self._sizes[key] = value, size
            self.kept_bytes += size
        else:
            self._latest = key, value

    def forget(self) -> None:
        """End all leases."""
        self._before.clear()
        self._now.clear()
        self._sizes.clear()
        self._latest = None
        self.kept_bytes = 0

    def _end(self, key: Hashable) -> None:
        del self._before[key]
        self.kept_bytes -= self._sizes.pop(key)


def _bytes(value: Any) -> int:
    """Return the bytes of an array, or of all arrays that a result holds."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, Mapping):
        return sum(map(_bytes, value.values()))
    if isinstance(value, tuple | list):
        return sum(map(_bytes, value))
    if is_dataclass(value):
        return sum(_bytes(getattr(value, field.name)) for field in fields(value))
    return 0
