"""Compiled loop over the neighbours of every pixel."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int32 = NDArray[np.int32]

RING = 2
"""Neighbours lie up to so many pixels away along each axis: 24 of them."""


@njit(cache=True)
def rank_neighbours(around: Int32, third: Int32, deepest: Int32, depth: int) -> None:
    """Write the third largest and the ``depth``-th largest of the 24 neighbours of every pixel, (h, w) each.

    ``around`` (h + 4, w + 4) holds the counts with two pixels more on each side. A row at a time: each neighbour takes
    its place among the largest so far, which pass a smaller one on. ``depth`` is 3 at least.
    """
    height, width = third.shape
    largest, passed_on = np.empty((depth, width), np.int32), np.empty(width, np.int32)
    for row in range(height):
        largest[:] = np.iinfo(np.int32).min
        for down in range(2 * RING + 1):
            for right in range(2 * RING + 1):
                if down == RING and right == RING:
                    continue
                passed_on[:] = around[row + down, right : right + width]
                for place in range(depth):
                    _pass_on(largest[place], passed_on)
        third[row], deepest[row] = largest[2], largest[depth - 1]


@njit(cache=True)
def _pass_on(largest: Int32, passed_on: Int32) -> None:
    """Keep the larger of two rows (w,), element by element, and pass the smaller one on."""
    for column in range(len(largest)):
        kept, other = largest[column], passed_on[column]
        largest[column], passed_on[column] = max(kept, other), min(kept, other)
