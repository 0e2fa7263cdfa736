"""The tick of event timestamps, from timestamps that many events share."""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int64 = NDArray[np.int64]

_CROWD: Final = 8
"""Events at one timestamp, and such timestamps in a window, from which on they are no coincidence."""

_MOST_CROWDED: Final = 0.9
"""Ratio of the events that lie at such timestamps, where timestamps have a tick of their own."""


def crowded_step_ns(times_ns: Int64) -> int:
    """Return the usual distance of timestamps that nine of ten events share with many others; 0 where they do not.

    Parameters
    ----------
    times_ns
        (n,) timestamps of a window, sorted.

    Returns
    -------
    int
        ns.
    """
    if not are_crowded(times_ns, _CROWD, _MOST_CROWDED):
        return 0
    first = np.flatnonzero(np.diff(times_ns, prepend=times_ns[:1] - 1))
    counts = np.diff(first, append=len(times_ns))
    crowded = counts >= max(_CROWD, 0.1 * float(counts.max(initial=0)))
    if np.count_nonzero(crowded) < _CROWD or counts[crowded].sum() < _MOST_CROWDED * len(times_ns):
        return 0
    # Between crowded timestamps only: a stray event between two of them would shorten a step.
    return int(np.median(np.diff(times_ns[first[crowded]])))


@njit(cache=True)
def are_crowded(t: Int64, crowd: int, ratio: float) -> bool:
    """Whether ``ratio`` of the events or more lie at ``crowd`` or more timestamps of ``crowd`` or more events each."""
    crowds, alone, begin = 0, 0, 0
    for i in range(len(t)):
        if i + 1 == len(t) or t[i + 1] != t[i]:
            count = i + 1 - begin
            crowds += count >= crowd
            alone += count if count < crowd else 0
            # The usual window has no tick of its own, and is left as soon as too many events lie alone.
            if len(t) - alone < ratio * len(t):
                return False
            begin = i + 1
    return crowds >= crowd
