"""Compiled loop that counts what combs of every width meet."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int64 = NDArray[np.int64]


@njit(cache=True)
def count_hits(there: NDArray[np.bool_], first: int, finest: int, hits: Int64) -> None:
    """Write how many occupied ticks lie on the combs through 0 of ``finest`` ticks, of one more, and so on, (k,).

    ``there`` (t,) says which ticks are occupied, from the tick ``first`` on.
    """
    for comb in range(len(hits)):
        step = np.uint64(finest + comb)
        tick, met = np.uint64((-first) % (finest + comb)), 0
        while tick < np.uint64(len(there)):
            met += there[tick]
            tick += step
        hits[comb] = met
