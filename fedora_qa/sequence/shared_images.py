"""Results computed from single images, shared by all checks and by neighbouring windows, within a limit of bytes.

Windows read the image after their last one; its results are used in the next window as well. When the limit is reached,
results that are cheap to compute are dropped first, and small results last; among each, the longest unused first.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, Final, TypeVar, cast

from numpy.typing import NDArray

Image = TypeVar("Image", bound=NDArray[Any])

_DEFAULT_BYTES: Final = 256 << 20

_LITTLE: Final = 1 / 256
"""Largest share of the limit for a small result: dropping it frees too little memory."""

_ALL_LITTLE: Final = 1 / 2
"""Share of the limit that small results together may fill."""


class SharedImages:
    """Keeps the latest results within a limit of bytes; dropped results are computed again and change no outcome."""

    def __init__(self, limit_bytes: int = _DEFAULT_BYTES) -> None:
        self.limit_bytes = limit_bytes
        self._passing, self._large, self._little = (OrderedDict[Hashable, NDArray[Any]]() for _ in range(3))
        self._kept_bytes = 0
        self._little_bytes = 0
        self.last_turns: dict[Hashable, int] = {}
        """The number of the latest check that requested a result shared within a window, by kind of the result
        (``Window``)."""

    def get(self, key: Hashable, compute: Callable[[], Image], *, in_a_moment: bool = False) -> Image:
        """Return a result, computed at most once while it is kept.

        Parameters
        ----------
        key
            Key of the result.
        compute
            Computes it.
        in_a_moment
            Whether computing it takes no longer than writing it to memory.
        """
        for kept in (self._large, self._little, self._passing):
            if key in kept:
                kept.move_to_end(key)
                return cast(Image, kept[key])
        value = compute()
        self._kept_bytes += value.nbytes
        if value.nbytes <= _LITTLE * self.limit_bytes:
            self._little[key] = value
            self._little_bytes += value.nbytes
            while self._little_bytes > _ALL_LITTLE * self.limit_bytes:
                self._drop_little()
        else:
            (self._passing if in_a_moment else self._large)[key] = value
        # The new result stays: its caller refers to it, so dropping it would free no memory.
        while self._kept_bytes > self.limit_bytes:
            # Results that are cheap to compute again are dropped first.
            for kept in (self._passing, self._large):
                oldest = next(iter(kept), key)
                if oldest != key:
                    self._kept_bytes -= kept.pop(oldest).nbytes
                    break
            else:
                if next(iter(self._little), key) == key:
                    break
                self._drop_little()
        return value

    def forget(self) -> None:
        """Drop all results."""
        for kept in (self._passing, self._large, self._little):
            kept.clear()
        self._kept_bytes = self._little_bytes = 0

    def _drop_little(self) -> None:
        _, dropped = self._little.popitem(last=False)
        self._little_bytes -= dropped.nbytes
        self._kept_bytes -= dropped.nbytes
