"""Memory for decoded blocks, apart from all other arrays: pages that the next block is decoded into.

On the heap a block would lie between what checks compute and drop, and what is free there is in pieces, too small for
the next block and too many to be given back: 160 MB of a worker at 1440x1080, more than all blocks it held. To get
fresh pages for each block costs a quarter of its decoding. So pages are used again, and given back where others are
needed.
"""

import mmap
import sys
from math import prod
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

LEAST_BYTES: Final = 1 << 20
"""Smaller arrays lie on the heap."""

_UNUSED_REFERENCES: Final = 2
"""To the array of all of a block's pages: from the block itself, and from who counts."""


def is_looked_at(block: NDArray[Any]) -> bool:
    """Return whether there are views of a block of these pages: numpy lets each refer to the array of all pages."""
    return block.base is not None and sys.getrefcount(block.base) > _UNUSED_REFERENCES


def lies_in_pages(block: NDArray[Any]) -> bool:
    """Return whether an array is one of these pages, and none of any other memory."""
    return block.base is not None and isinstance(block.base.base, _Lease)


class BlockMemory:
    """Pages for blocks.

    Attributes
    ----------
    held_bytes
        What blocks fill, those included that nobody keeps and somebody still looks at, and what the next may fill.
    """

    def __init__(self) -> None:
        self.held_bytes = 0
        self._free: dict[int, list[mmap.mmap]] = {}

    def array(self, shape: tuple[int, ...], dtype: "np.dtype[Any]") -> NDArray[Any]:
        """Return an array of any values. Its pages are free again when it and all views of it are gone."""
        size = prod(shape) * dtype.itemsize
        pages = self._free[size].pop() if self._free.get(size) else self._fresh(size)
        return np.asarray(_Lease(self, pages)).view(dtype).reshape(shape)

    def free(self, size: int) -> bool:
        """Return whether there are pages for a block of this size."""
        return bool(self._free.get(size))

    def give_back(self) -> bool:
        """Give pages that nobody uses back to the system; return whether there were any."""
        for size, pages in self._free.items():
            if pages:
                pages.pop().close()
                self.held_bytes -= size
                return True
        return False

    def return_pages(self, pages: mmap.mmap) -> None:
        """Be told that nobody looks at these pages any more."""
        self._free.setdefault(len(pages), []).append(pages)

    def _fresh(self, size: int) -> mmap.mmap:
        pages = mmap.mmap(-1, size, **_PRIVATE)
        if hasattr(mmap, "MADV_HUGEPAGE"):
            pages.madvise(mmap.MADV_HUGEPAGE)
        self.held_bytes += size
        return pages


_PRIVATE: Final[dict[str, int]] = {} if sys.platform == "win32" else {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS}


class _Lease:
    """Owns pages for as long as any array shows them, as numpy keeps a reference to it."""

    def __init__(self, memory: BlockMemory, pages: mmap.mmap) -> None:
        self._memory = memory
        self._pages = pages
        with memoryview(pages) as view:
            self.__array_interface__ = np.frombuffer(view, np.uint8).__array_interface__

    def __del__(self) -> None:
        self._memory.return_pages(self._pages)
