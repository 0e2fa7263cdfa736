"""Memory for decoded blocks, apart from all other arrays: pages that the next block is decoded into.

On the heap, blocks would lie between the temporary arrays of checks. The gaps between them are too small for the next
block, and the heap returns few of them to the system: 160 MB of a worker at 1440x1080, more than all blocks it held. To
get fresh pages for a block takes as long as to decode it. Therefore blocks of all sizes lie one after another in one
region. Its pages are used again, and are returned to the system where memory is needed elsewhere.
"""

import mmap
import sys
from collections.abc import Iterator
from math import prod
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

LEAST_BYTES: Final = 1 << 20
"""Smaller arrays lie on the heap."""

_REGION_BYTES: Final = 256 << 20
"""Address space of one region. The system provides a page only when it is first written."""

_UNUSED_REFERENCES: Final = 2
"""References to the array of all of a block's pages without any view: of the block, and of ``getrefcount``."""


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
    used_bytes
        Bytes that blocks fill, in whole pages; dropped blocks count as long as any view of them exists.
    held_bytes
        Bytes that the system holds: the used ones, and those that the next block may fill without fresh pages.
    """

    def __init__(self) -> None:
        self.held_bytes = 0
        self._leased_bytes = 0
        self._work_queue: list[_Region] = []
        self._returned: list[_Place] = []

    @property
    def used_bytes(self) -> int:
        """See the attributes."""
        self._take_back()
        return self._leased_bytes

    def array(self, shape: tuple[int, ...], dtype: "np.dtype[Any]") -> NDArray[Any]:
        """Return an array of undefined values. Its pages are free again when it and all views of it are gone."""
        size = prod(shape) * dtype.itemsize
        place = self._best(size)
        if place is None:
            region = _Region(max(_whole_pages(size), _REGION_BYTES))
            self._work_queue.append(region)
            place = next(region.places(_whole_pages(size)))
        self.held_bytes += place.region.take(place)
        self._leased_bytes += place.size
        return np.asarray(_Lease(self, place, size)).view(dtype).reshape(shape)

    def missing(self, size: int) -> int:
        """Return how many bytes more would be held with another array of this size."""
        place = self._best(size)
        return place.fresh if place else _whole_pages(size)

    def give_back(self) -> bool:
        """Return unused pages to the system, those of the gap with the fewest; return whether there were any."""
        self._take_back()
        pieces = [(region.held(*free), region, free) for region in self._work_queue for free in region.free]
        # Wide gaps stay as long as possible, as only these can take the next large block.
        held, region, free = min(
            (piece for piece in pieces if piece[0]), key=lambda piece: piece[0], default=(0, None, (0, 0))
        )
        if region is None:
            return False
        # An empty region is dropped as a whole: that unmaps its pages also where the system has no MADV_DONTNEED.
        if free == (0, len(region.pages)):
            self._work_queue.remove(region)
        elif not region.give_back(*free):
            return False
        self.held_bytes -= held
        return True

    def give_back_all(self) -> None:
        """Return all unused pages to the system."""
        while self.give_back():
            pass

    def return_pages(self, place: "_Place") -> None:
        """Note that no view of these pages is left; may be called at any time, also within another method."""
        # Only noted here: a lease may end while another method iterates over the gaps, which must not change then.
        self._returned.append(place)

    def _take_back(self) -> None:
        while self._returned:
            place = self._returned.pop()
            place.region.free.add(place.start, place.start + place.size)
            self._leased_bytes -= place.size

    def _best(self, size: int) -> "_Place | None":
        """Return the place for which the fewest fresh pages are needed, in the narrowest gap of those."""
        self._take_back()
        places = (place for region in self._work_queue for place in region.places(_whole_pages(size)))
        # Fresh pages cost as much as decoding, so they are counted first; best fit then leaves wide gaps whole.
        return min(places, key=lambda place: (place.fresh, place.gap), default=None)


class Intervals:
    """A set of whole numbers: half-open intervals, in order, none of which touch.

    Parameters
    ----------
    *intervals
        (start, stop) of each, disjoint and not touching.
    """

    def __init__(self, *intervals: tuple[int, int]) -> None:
        self._intervals = sorted(intervals)

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return iter(self._intervals)

    def add(self, start: int, stop: int) -> None:
        """Add the numbers from ``start`` up to but without ``stop``."""
        # Touching intervals join as well: a block may fill a gap that several blocks have left.
        touching = [(begin, end) for begin, end in self._intervals if begin <= stop and start <= end]
        apart = [interval for interval in self._intervals if interval not in touching]
        joined = min([start, *(begin for begin, _ in touching)]), max([stop, *(end for _, end in touching)])
        self._intervals = sorted([*apart, joined])

    def remove(self, start: int, stop: int) -> None:
        """Remove the numbers from ``start`` up to but without ``stop``."""
        pieces = (
            piece for begin, end in self._intervals for piece in ((begin, min(end, start)), (max(begin, stop), end))
        )
        self._intervals = [(begin, end) for begin, end in pieces if begin < end]

    def overlap(self, start: int, stop: int) -> int:
        """Return how many of the numbers from ``start`` up to but without ``stop`` are in the set."""
        return sum(max(min(stop, end) - max(start, begin), 0) for begin, end in self._intervals)


class _Place(NamedTuple):
    """Where an array can lie: how many of its bytes are fresh, and the length of the gap it lies in."""

    fresh: int
    gap: int
    region: "_Region"
    start: int
    size: int


class _Region:
    """Pages one after another; ``free`` are the unused ones, ``fresh`` those for which the system holds no memory."""

    def __init__(self, size: int) -> None:
        self.pages = mmap.mmap(-1, size, **_PRIVATE)
        # One page fault for each huge page while a block is decoded, in place of one for each ordinary page.
        if hasattr(mmap, "MADV_HUGEPAGE"):
            self.pages.madvise(mmap.MADV_HUGEPAGE)
        with memoryview(self.pages) as view:
            self.address = np.frombuffer(view, np.uint8).ctypes.data
        self.free, self._fresh = Intervals((0, size)), Intervals((0, size))

    def places(self, size: int) -> "Iterator[_Place]":
        """Yield where an array of so many bytes can lie: at either end of each gap."""
        for start, stop in self.free:
            if stop - start >= size:
                # Only at the ends of a gap: a block in the middle would leave two narrower gaps.
                for at in (start, stop - size):
                    yield _Place(self._fresh.overlap(at, at + size), stop - start, self, at, size)

    def held(self, start: int, stop: int) -> int:
        """Return how many of these bytes the system holds."""
        return stop - start - self._fresh.overlap(start, stop)

    def take(self, place: _Place) -> int:
        """Mark a place as used; return by how many bytes the memory that the system holds grows."""
        self.free.remove(place.start, place.start + place.size)
        self._fresh.remove(place.start, place.start + place.size)
        return place.fresh

    def give_back(self, start: int, stop: int) -> bool:
        """Return these pages to the system; return whether it supports that."""
        if not hasattr(mmap, "MADV_DONTNEED"):
            return False
        # Their content is lost (madvise(2)); no block lies there.
        self.pages.madvise(mmap.MADV_DONTNEED, start, stop - start)
        self._fresh.add(start, stop)
        return True


# Private, as MADV_DONTNEED keeps the memory of a shared map (madvise(2)), and ``own_bytes`` leaves shared pages out.
_PRIVATE: Final[dict[str, int]] = {} if sys.platform == "win32" else {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS}


def _whole_pages(size: int) -> int:
    # madvise(2) accepts whole pages only.
    return -(-size // mmap.PAGESIZE) * mmap.PAGESIZE


class _Lease:
    """Owns a place for as long as any array shows it, as numpy keeps a reference to it."""

    def __init__(self, memory: BlockMemory, place: _Place, size: int) -> None:
        self._memory = memory
        self._place = place
        address = place.region.address + place.start
        # numpy keeps this object as the base of every view, so that the last view ends the lease. False: writable.
        self.__array_interface__ = {"version": 3, "shape": (size,), "typestr": "|u1", "data": (address, False)}

    def __del__(self) -> None:
        self._memory.return_pages(self._place)
