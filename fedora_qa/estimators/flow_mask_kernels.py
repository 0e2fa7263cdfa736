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


@njit(cache=True)
def seen_again(
    K: NDArray[np.float64],
    R: NDArray[np.float64],
    t_m: NDArray[np.float64],
    columns: NDArray[np.float32],
    rows: NDArray[np.float32],
    inverse0: NDArray[np.float32],
    inverse1: NDArray[np.float32],
    edges1: NDArray[np.uint8],
    tolerance: float,
    uncertainty_px: float,
) -> NDArray[np.bool_]:
    """Return which pixels (n, m) reappear in a second frame: what ``flow_mask.seen_in_both`` says.

    ``tolerance`` is the relative mismatch of inverse depth that still agrees.
    """
    height, width = inverse1.shape
    per_fx, per_fy = 1.0 / K[0, 0], 1.0 / K[1, 1]
    seen = np.zeros(inverse0.shape, np.bool_)
    for i in range(len(inverse0)):
        for k in range(inverse0.shape[1]):
            inverse = np.float64(inverse0[i, k])
            if not inverse > 0:
                continue
            y = (rows[i, k] - K[1, 2]) * per_fy
            x = (columns[i, k] - K[0, 2] - K[0, 1] * y) * per_fx
            depth_m = 1.0 / inverse
            X1 = depth_m * (R[0, 0] * x + R[0, 1] * y + R[0, 2]) + t_m[0]
            Y1 = depth_m * (R[1, 0] * x + R[1, 1] * y + R[1, 2]) + t_m[1]
            Z1 = depth_m * (R[2, 0] * x + R[2, 1] * y + R[2, 2]) + t_m[2]
            if not Z1 > 0:
                continue
            nearness = 1.0 / Z1
            x1, y1 = (K[0, 0] * X1 + K[0, 1] * Y1) * nearness + K[0, 2], K[1, 1] * Y1 * nearness + K[1, 2]
            if not (0 <= x1 <= width - 1 and 0 <= y1 <= height - 1):
                continue
            if edges1[int(y1 + 0.5), int(x1 + 0.5)]:
                continue
            found, allowed = _between(inverse1, x1, y1), tolerance
            if uncertainty_px > 0:
                slope = abs(_between(inverse1, x1 + 1, y1) - found) + abs(_between(inverse1, x1, y1 + 1) - found)
                allowed += uncertainty_px * slope / max(found, 1e-6)
            seen[i, k] = abs(found * Z1 - 1.0) < allowed
    return seen


@njit(cache=True)
def _between(image: NDArray[np.float32], x: float, y: float) -> float:
    """Return an image (H, W) bilinearly at a place; all beyond it is 0."""
    column, row = int(x), int(y)
    right, below = x - column, y - row
    if column + 1 < image.shape[1] and row + 1 < image.shape[0]:
        upper, lower, at = image[row], image[row + 1], np.uint64(column)
        above = upper[at] + right * (upper[at + np.uint64(1)] - upper[at])
        return float(above + below * (lower[at] + right * (lower[at + np.uint64(1)] - lower[at]) - above))
    value = 0.0
    for j in range(2):
        for k in range(2):
            if row + j < image.shape[0] and column + k < image.shape[1]:
                value += (below if j else 1 - below) * (right if k else 1 - right) * image[row + j, column + k]
    return value
