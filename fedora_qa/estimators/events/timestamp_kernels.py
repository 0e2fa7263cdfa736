"""Compiled loops over the stamps of events, in the order of time."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int64 = NDArray[np.int64]


@njit(cache=True)
def longest_silences(t: Int64, start: int, stop: int, lengths: Int64, ends: Int64) -> tuple[int, int]:
    """Write the longest distances of successive stamps of which the later lies in [start, stop), longest first.

    Of equal ones the earlier. Return how many were written to ``lengths`` and ``ends`` (m,), the later stamps, and how
    many there are; equal stamps have no distance.
    """
    count, silences = 0, 0
    for i in range(1, len(t)):
        length = t[i] - t[i - 1]
        if length <= 0 or t[i] < start or t[i] >= stop:
            continue
        silences += 1
        if count == len(lengths) and length <= lengths[count - 1]:
            continue
        count = min(count + 1, len(lengths))
        at = count - 1
        while at > 0 and lengths[at - 1] < length:
            lengths[at], ends[at] = lengths[at - 1], ends[at - 1]
            at -= 1
        lengths[at], ends[at] = length, t[i]
    return count, silences


@njit(cache=True)
def are_crowded(t: Int64, crowd: int, share: float) -> bool:
    """Whether a share of the events lie at stamps with a ``crowd`` of them or more, of which there are as many.

    Looks no farther than it takes to tell that they do not: as a rule, at what the others may be.
    """
    crowds, alone, begin = 0, 0, 0
    for i in range(len(t)):
        if i + 1 == len(t) or t[i + 1] != t[i]:
            count = i + 1 - begin
            crowds += count >= crowd
            alone += count if count < crowd else 0
            if len(t) - alone < share * len(t):
                return False
            begin = i + 1
    return crowds >= crowd
