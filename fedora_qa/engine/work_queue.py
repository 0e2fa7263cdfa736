"""Which worker measures which windows: each its own neighbourhood, and then the far end of another's.

The halo of a window is decoded only once where the same process measures its neighbours.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

_SHARE: Final = 2 / 3
_FEWEST_WINDOWS: Final = 4
_MOST_WINDOWS: Final = 64
"""Bounds of a batch: share of the windows that are left, and their number. States of windows, some 40 MB at 1440x1080,
are written after each batch and read for the next, which takes as long as two windows there; a worker that dies loses
one batch."""


class WorkQueue:
    """The windows of a file that no worker has taken yet, in neighbourhoods.

    Parameters
    ----------
    windows
        How many there are.
    workers
        How many neighbourhoods to make of them.
    """

    def __init__(self, windows: int, workers: int) -> None:
        self._left: list[Sequence[int]] = list(equal_parts(windows, workers))

    def take(self, worker: int) -> Sequence[int]:
        """Return the next batch for a worker; empty where nothing is left.

        A long neighbourhood is taken in batches of at most two thirds of its rest, so that workers end at nearly the
        same time.
        """
        if worker < len(self._left) and self._left[worker]:
            left = self._left[worker]
            length = _length(left)
            self._left[worker] = left[length:]
            return left[:length]
        longest = max(range(len(self._left)), key=lambda number: len(self._left[number]), default=0)
        if not self._left or not self._left[longest]:
            return ()
        left = self._left[longest]
        length = _length(left)
        # From the far end: its own worker continues at the near end, beside blocks that it has decoded.
        self._left[longest] = left[:-length]
        return left[-length:]


def equal_parts(windows: int, count: int) -> tuple[Sequence[int], ...]:
    """Cut windows into neighbouring parts, none of them empty."""
    count = min(count, windows)
    bounds = [windows * number // count for number in range(count + 1)] if count else []
    return tuple(range(start, stop) for start, stop in pairwise(bounds))


def _length(left: Sequence[int]) -> int:
    return min(max(int(_SHARE * len(left)), _FEWEST_WINDOWS), _MOST_WINDOWS, len(left))
