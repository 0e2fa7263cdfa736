"""How much of its share of the memory a process has left for decoded blocks: measured, as checks keep what they need.

What checks remember and compute follows from the file, the effort and the selection of checks; no constant is right for
all. So what the process holds beside blocks is looked at whenever another is decoded (Linux; elsewhere it is assumed).
"""

import ctypes
import os
import sys
from typing import Final

_LEARNING_WINDOWS: Final = 3
"""Windows in which the checks show what they need. Until then blocks leave room for what is expected of them."""

_STATM: Final = "/proc/self/statm"

_LONGEST_STATM: Final = 256
"""Bytes: seven numbers of at most 20 digits."""

_LEAST_SHARE: Final = 0.25
"""Share of the memory that blocks may fill in any case."""

_TRIM_THRESHOLD: Final = -1
"""``M_TRIM_THRESHOLD`` of glibc's malloc.h."""

_MMAP_THRESHOLD: Final = -3
"""``M_MMAP_THRESHOLD`` there."""

_LARGEST_ON_HEAP_BYTES: Final = 32 << 20
"""The most that glibc allows, at which it also arrives by itself."""

_MOST_UNUSED_BYTES: Final = 256 << 20
"""At the end of the heap: more than any check needs for a moment."""


class MemoryBudget:
    """What is left of a share of the memory.

    Parameters
    ----------
    share_bytes
        What the process may hold beside what it holds now.
    expected_bytes
        What it is expected to hold of that beside blocks.
    """

    def __init__(self, share_bytes: int, expected_bytes: int) -> None:
        return_unused_memory()
        self._share_bytes = share_bytes
        self._beside_bytes = self._expected_bytes = expected_bytes
        self._windows = 0
        self._seen_bytes = 0
        self._before_bytes = own_bytes()

    def begin_window(self) -> None:
        """Be told that another window is looked at from now on."""
        self._windows += 1
        if self._windows == _LEARNING_WINDOWS + 1 and self._before_bytes is not None:
            self._beside_bytes = self._seen_bytes

    def for_blocks(self, held_bytes: int) -> int:
        """Return how many bytes blocks may fill that fill so many now."""
        now = own_bytes()
        if now is not None and self._before_bytes is not None:
            self._seen_bytes = max(self._seen_bytes, now - self._before_bytes - held_bytes)
            self._beside_bytes = max(self._beside_bytes, self._seen_bytes)
        return max(self._share_bytes - self._beside_bytes, int(_LEAST_SHARE * self._share_bytes))


def own_bytes() -> int | None:
    """Return how much memory this process holds beside files and what it shares by name; None where nothing says."""
    if sys.platform != "linux":
        return None
    statm = os.open(_STATM, os.O_RDONLY)  # asked for each block: a file of Python's takes twice as long
    try:
        _, resident, shared, *_ = os.read(statm, _LONGEST_STATM).split()  # as proc(5) describes it, in pages
    finally:
        os.close(statm)
    return (int(resident) - int(shared)) * os.sysconf("SC_PAGE_SIZE")


def keep_unused_memory() -> None:
    """Keep what becomes unused on the heap for what is needed next, where its library is glibc.

    By itself that gives it back whenever a few images are gone from the end of the heap, and the system clears each
    page of the next ones anew: of all pages that two workers asked for at 1440x1080, three in five. What is held at
    the peak is the same.
    """
    if sys.platform == "linux" and (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)):
        mallopt(_MMAP_THRESHOLD, _LARGEST_ON_HEAP_BYTES)  # to set one is to set both
        mallopt(_TRIM_THRESHOLD, _MOST_UNUSED_BYTES)


def return_unused_memory() -> None:
    """Give what lies unused on the heap back to the system, where its library can (``malloc_trim`` of glibc)."""
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
        trim(0)
