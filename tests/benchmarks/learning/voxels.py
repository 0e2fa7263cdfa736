"""Events as a voxel grid, bilinear in time.

Source: A. Z. Zhu, L. Yuan, K. Chaney and K. Daniilidis, Unsupervised Event-Based Learning of Optical Flow, Depth, and
Egomotion, CVPR 2019, eq. 1 and 2. There the first and last event bound the time; here the interval does, so that the
grid of few events has the same scale. Events lie on whole pixels, where the kernels of x and y are 1.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]


def voxel_grid(events: NDArray[np.int64], start_us: int, stop_us: int, bins: int, size: tuple[int, int]) -> Floats:
    """Return the voxel grid (bins, H, W) of events.

    Parameters
    ----------
    events
        (n, 4) of x, y, t in us and p, 0 or 1.
    start_us, stop_us
        Of the interval; an event outside of it counts as far as the outer bins reach.
    bins
        Number of bins, at least 2.
    size
        Width and height, px.
    """
    width, height = size
    x, y, times_us, polarity = events.T
    # eq. 1: t* = (B - 1) (t - t_start) / (t_stop - t_start)
    position = (bins - 1) * (times_us - start_us) / (stop_us - start_us)
    first = np.floor(position).astype(np.int64)
    sign = 2.0 * polarity - 1.0
    grid = np.zeros(bins * height * width)
    for place in (first, first + 1):
        # eq. 2: V(x, y, t) = sum of p k_b(t - t*), with k_b(a) = max(0, 1 - |a|)
        weight = sign * (1.0 - np.abs(place - position))
        inside = (place >= 0) & (place < bins)
        voxels = (place * height + y) * width + x
        grid += np.bincount(voxels[inside], weight[inside], grid.size)
    return grid.reshape(bins, height, width).astype(np.float32)
