"""Where the pixels of one camera pose appear from another."""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray


@njit(parallel=True, cache=True)
def displacements(
    H: NDArray[np.float64], t: NDArray[np.float64], inverse_depth: NDArray[np.float64], flow_px: NDArray[np.float32]
) -> None:
    """Fill ``flow_px`` (height, width, 2) with pi(H p + inverse_depth t) - p; NaN or a point behind gives NaN."""
    height, width = inverse_depth.shape
    for y in prange(height):
        for x in range(width):
            w = inverse_depth[y, x]
            ahead = H[2, 0] * x + H[2, 1] * y + H[2, 2] + w * t[2]
            if ahead > 0.0:  # false for NaN
                flow_px[y, x, 0] = (H[0, 0] * x + H[0, 1] * y + H[0, 2] + w * t[0]) / ahead - x
                flow_px[y, x, 1] = (H[1, 0] * x + H[1, 1] * y + H[1, 2] + w * t[1]) / ahead - y
            else:
                flow_px[y, x, 0] = math.nan
                flow_px[y, x, 1] = math.nan
