"""Compiled loops over the pixels of a depth, to see its edges, and of a flow, to see where they lead to."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def inverse_of(depth_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return 1 / depth (H, W), 0 where depth is not finite and positive."""
    inverse = np.empty(depth_m.shape, np.float32)
    for row in range(len(depth_m)):
        depths, line = depth_m[row], inverse[row]
        for column in range(len(depths)):
            depth = depths[column]
            valid = (depth > 0) & (depth < np.float32(np.inf))
            line[column] = np.float32(1) / depth if valid else np.float32(0)
    return inverse


@njit(cache=True)
def mark_edges(
    inverse_per_m: NDArray[np.float32], largest_bend: np.float32, largest_slope: np.float32
) -> NDArray[np.uint8]:
    """Return 1, (H, W), where an inverse depth is not positive, bends or slopes by more than a share of it, or ends."""
    height, width = inverse_per_m.shape
    marked = np.ones((height, width), np.uint8)
    steepest = largest_slope * largest_slope
    for row in range(1, height - 1):
        above, here, below, line = inverse_per_m[row - 1], inverse_per_m[row], inverse_per_m[row + 1], marked[row]
        for column in range(1, width - 1):
            value, left, right = here[column], here[column - 1], here[column + 1]
            over, under = above[column], below[column]
            bend = abs(left + right + over + under - np.float32(4) * value)
            across, down = np.float32(0.5) * (right - left), np.float32(0.5) * (under - over)
            steep = across * across + down * down > steepest * value * value
            line[column] = (bend > largest_bend * value) | steep | (value <= 0)
    return marked


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
