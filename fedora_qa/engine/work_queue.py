"""Who measures which windows: each worker its own neighbourhood, and where that is done, the far end of another's.

What lies around a window is decoded once where its neighbours are measured by the same process.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

_SHARE: Final = 2 / 3
_FEWEST_WINDOWS: Final = 4
_MOST_WINDOWS: Final = 64
"""Of what is left, in a stretch. What windows have shown, some 40 MB at 1440x1080, is put away after each and taken up
with the next, which takes as long as two windows there; a worker that dies takes one with it."""


class WorkQueue:
    """The windows of a file that nobody measures yet, in neighbourhoods.

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
        """Return the next stretch for a worker, none where nothing is left.

        A long neighbourhood is done in stretches of at most two thirds of what is left, so that the last worker to end
        does not keep the others waiting for long.
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
        self._left[longest] = left[:-length]
        return left[-length:]


def equal_parts(windows: int, count: int) -> tuple[Sequence[int], ...]:
    """Cut windows into neighbouring parts, none of them empty."""
    count = min(count, windows)
    bounds = [windows * number // count for number in range(count + 1)] if count else []
    return tuple(range(start, stop) for start, stop in pairwise(bounds))


def _length(left: Sequence[int]) -> int:
    return min(max(int(_SHARE * len(left)), _FEWEST_WINDOWS), _MOST_WINDOWS, len(left))
