"""How much of its share of the memory a process has left for decoded blocks, by measurement.

The states and temporary arrays of checks follow from the file, the effort and the selection of checks; no constant fits
all. So the memory of the process beside blocks is measured for each decoded block (Linux; elsewhere it is assumed).
"""

import ctypes
import os
import sys
from typing import Final

_LEARNING_WINDOWS: Final = 3
"""Windows after which the memory of the checks is known. Until then blocks leave the expected bytes free."""

_STATM: Final = "/proc/self/statm"

_LONGEST_STATM: Final = 256
"""Bytes: seven numbers of at most 20 digits."""

_LEAST_SHARE: Final = 0.25
"""Share of the memory that blocks may always fill."""

_TRIM_THRESHOLD: Final = -1
"""``M_TRIM_THRESHOLD`` of glibc's malloc.h."""

_MMAP_THRESHOLD: Final = -3
"""``M_MMAP_THRESHOLD`` there."""

_LARGEST_ON_HEAP_BYTES: Final = 32 << 20
"""The most that glibc allows, which its own adaptation reaches as well."""

_MOST_UNUSED_BYTES: Final = 256 << 20
"""Unused bytes at the end of the heap: more than the temporary arrays of any check."""


class MemoryBudget:
    """The part of a share of the memory that is left for blocks.

    Parameters
    ----------
    share_bytes
        Bytes that the process may hold beside those that it holds now.
    expected_bytes
        Bytes of that share that it is expected to hold beside blocks.
    """

    def __init__(self, share_bytes: int, expected_bytes: int) -> None:
        # The unused heap goes back to the system first, so that ``own_bytes`` below counts no free pages.
        return_unused_memory()
        self._share_bytes = share_bytes
        self._beside_bytes = self._expected_bytes = expected_bytes
        self._windows = 0
        self._seen_bytes = 0
        self._before_bytes = own_bytes()

    def begin_window(self) -> None:
        """Note that another window is measured from now on."""
        self._windows += 1
        if self._windows == _LEARNING_WINDOWS + 1 and self._before_bytes is not None:
            # From here on the measured peak replaces the expectation, also where it is smaller.
            self._beside_bytes = self._seen_bytes

    def for_blocks(self, held_bytes: int) -> int:
        """Return how many bytes blocks may fill, given the bytes that they hold now."""
        now = own_bytes()
        if now is not None and self._before_bytes is not None:
            # Neither blocks nor what the process held before the file: states and temporary arrays of checks.
            self._seen_bytes = max(self._seen_bytes, now - self._before_bytes - held_bytes)
            self._beside_bytes = max(self._beside_bytes, self._seen_bytes)
        return max(self._share_bytes - self._beside_bytes, int(_LEAST_SHARE * self._share_bytes))


def own_bytes() -> int | None:
    """Return the bytes that this process holds beside pages of files and shared memory; None where it is not Linux."""
    if sys.platform != "linux":
        return None
    # Read for every block; a file object of Python takes twice as long.
    statm = os.open(_STATM, os.O_RDONLY)
    try:
        # Pages, in the order of proc(5): size, resident, shared. Shared ones are those of files and of shared memory.
        _, resident, shared, *_ = os.read(statm, _LONGEST_STATM).split()
    finally:
        os.close(statm)
    return (int(resident) - int(shared)) * os.sysconf("SC_PAGE_SIZE")


def keep_unused_memory() -> None:
    """Keep what becomes unused on the heap for what is needed next, where its library is glibc.

    By default glibc returns it whenever a few images are freed at the end of the heap, and the system clears each page
    of the next ones anew: of all pages that two workers requested at 1440x1080, three in five. The peak of memory is
    the same.
    """
    if sys.platform == "linux" and (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)):
        # Once one of the two is set, glibc adapts neither of them any more (mallopt(3)): both are set.
        mallopt(_MMAP_THRESHOLD, _LARGEST_ON_HEAP_BYTES)
        mallopt(_TRIM_THRESHOLD, _MOST_UNUSED_BYTES)


def return_unused_memory() -> None:
    """Give what lies unused on the heap back to the system, where its library can (``malloc_trim`` of glibc)."""
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
        trim(0)
