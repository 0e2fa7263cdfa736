"""Compiled loop over the pixels of a flow, to see where they lead to."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def spread_at_targets(flow_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (H, W) by how much the flows (H, W, 2) that lead to a pixel differ: the larger variance of two, px^2."""
    height, width = flow_px.shape[:2]
    count = np.zeros((height, width), np.int32)
    sums = np.zeros((height, width, 4))
    for row in range(height):
        for column in range(width):
            u, v = np.float64(flow_px[row, column, 0]), np.float64(flow_px[row, column, 1])
            x, y = np.rint(column + u), np.rint(row + v)
            if not (0 <= x < width and 0 <= y < height):  # so it is, too, where flow is NaN
                continue
            at_row, at_column = int(y), int(x)
            count[at_row, at_column] += 1
            into = sums[at_row, at_column]
            into[0] += u
            into[1] += v
            into[2] += u * u
            into[3] += v * v
    spread = np.zeros((height, width), np.float32)
    for row in range(height):
        for column in range(width):
            n = count[row, column]
            if n > 1:
                u, v, uu, vv = sums[row, column]
                spread[row, column] = max(uu / n - (u / n) ** 2, vv / n - (v / n) ** 2)
    return spread
