"""What is computed of single images, shared by all checks and by neighbouring windows, within a limit of bytes.

Windows look at the image after their last one; what was computed of it serves the next window as well.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, Final, TypeVar, cast

from numpy.typing import NDArray

Image = TypeVar("Image", bound=NDArray[Any])

_DEFAULT_BYTES: Final = 256 << 20


class SharedImages:
    """Keeps the latest results within a limit; what was dropped is computed again, so that no outcome depends on it."""

    def __init__(self, limit_bytes: int = _DEFAULT_BYTES) -> None:
        self.limit_bytes = limit_bytes
        self._kept: OrderedDict[Hashable, NDArray[Any]] = OrderedDict()
        self._kept_bytes = 0
        self.last_turns: dict[Hashable, int] = {}
        """The latest check, by its turn, that has asked for what is shared within a window, by kind: ``Window``."""

    def get(self, key: Hashable, compute: Callable[[], Image]) -> Image:
        """Return what ``compute`` gives, computed at most once while it is kept."""
        found = self._kept.get(key)
        if found is None:
            found = compute()
            self._keep(key, found)
        else:
            self._kept.move_to_end(key)
        return cast(Image, found)

    def forget(self) -> None:
        """Drop all results."""
        self._kept.clear()
        self._kept_bytes = 0

    def _keep(self, key: Hashable, image: NDArray[Any]) -> None:
        self._kept[key] = image
        self._kept_bytes += image.nbytes
        while self._kept_bytes > self.limit_bytes and len(self._kept) > 1:
            _, dropped = self._kept.popitem(last=False)
            self._kept_bytes -= dropped.nbytes
