"""Arrays that neighbouring windows share: decoded rows, and what is computed of single images.

The halo of a window lies in its neighbours, so that most rows are needed by two or more windows. A window leases each
array that it requests. The lease ends when a whole window has passed that did not request the array; of rows that a
later window owns, not before that window.
"""

from collections.abc import Callable, Hashable
from typing import Any, Final, TypeVar, cast

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
        if key in self._now:
            return cast(Value, self._now[key])
        if key in self._before:
            value = self._now[key] = self._before.pop(key)
            return cast(Value, value)
        if self._latest and self._latest[0] == key:
            return cast(Value, self._latest[1])
        value = make()
        size = _bytes(value)
        while self._before and size <= self.limit_bytes < self.kept_bytes + size:
            self._end(next(iter(self._before)))
        if self.kept_bytes + size <= self.limit_bytes:
            self._now[key] = value
            self.kept_bytes += size
        else:
            self._latest = key, value
        return value

    def forget(self) -> None:
        """End all leases."""
        self._before.clear()
        self._now.clear()
        self._latest = None
        self.kept_bytes = 0

    def _end(self, key: Hashable) -> None:
        self.kept_bytes -= _bytes(self._before.pop(key))


def _bytes(value: Any) -> int:
    return getattr(value, "nbytes", 0)
