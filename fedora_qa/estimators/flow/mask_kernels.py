"""Compiled loops over the pixels of a depth, to see its edges, and of a flow, to see where they lead to."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def inverse_of(depth_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return 1 / depth (H, W), 0 where depth is not finite and positive."""
    return inverse_in(depth_m, 0, 0, depth_m.shape[0], depth_m.shape[1])


@njit(cache=True, error_model="numpy")
def inverse_in(depth_m: NDArray[np.float32], left: int, top: int, height: int, width: int) -> NDArray[np.float32]:
    """Return the same of a part (height, width) of a depth (H, W), from a column and a row on."""
    inverse = np.empty((height, width), np.float32)
    for row in range(height):
        depths, line = depth_m[top + row, left : left + width], inverse[row]
        for column in range(len(line)):
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
    H: NDArray[np.float64],
    t_px: NDArray[np.float64],
    origins: NDArray[np.int64],
    size: tuple[int, int],
    inverse0: NDArray[np.float32],
    edges0: NDArray[np.uint8],
    inverse1: NDArray[np.float32],
    edges1: NDArray[np.uint8],
    tolerance: float,
    uncertainty_px: float,
) -> NDArray[np.bool_]:
    """Return which pixels of tiles (n, h, w), away from edges of the first frame, reappear in a second frame.

    What ``flow_mask.seen_in_both`` says. A pixel p of inverse depth w gets to ``H p + w t_px``, homogeneously, with
    ``H = K R K^-1`` and ``t_px = K t``; the third component is the ratio of the depths. ``tolerance`` is the relative
    mismatch of inverse depth that still agrees.
    """
    height, width = inverse1.shape
    seen = np.zeros((len(origins), size[0], size[1]), np.bool_)
    x1, y1, ratio = (np.empty(size[1]), np.empty(size[1]), np.empty(size[1]))
    for i in range(len(origins)):
        left, top = origins[i, 0], origins[i, 1]
        for j in range(size[0]):
            values, near = inverse0[top + j, left : left + size[1]], edges0[top + j, left : left + size[1]]
            y = np.float64(top + j)
            for k in range(len(x1)):  # without a branch, so that many are projected at once
                x, inverse = np.float64(left + k), np.float64(values[k])
                ratio[k] = H[2, 0] * x + H[2, 1] * y + H[2, 2] + inverse * t_px[2]
                x1[k] = (H[0, 0] * x + H[0, 1] * y + H[0, 2] + inverse * t_px[0]) / ratio[k]
                y1[k] = (H[1, 0] * x + H[1, 1] * y + H[1, 2] + inverse * t_px[1]) / ratio[k]
            of_row = seen[i, j]
            for k in range(len(x1)):
                inverse, to_x, to_y = np.float64(values[k]), x1[k], y1[k]
                if near[k] or not (inverse > 0 and ratio[k] > 0):
                    continue
                if not (0 <= to_x <= width - 1 and 0 <= to_y <= height - 1):
                    continue
                if edges1[np.uint64(to_y + 0.5), np.uint64(to_x + 0.5)]:
                    continue
                found, allowed = between(inverse1, to_x, to_y), tolerance
                if uncertainty_px > 0:
                    across = abs(between(inverse1, to_x + 1, to_y) - found)
                    down = abs(between(inverse1, to_x, to_y + 1) - found)
                    allowed += uncertainty_px * (across + down) / max(found, 1e-6)
                of_row[k] = abs(found * ratio[k] - inverse) < allowed * inverse
    return seen


@njit(cache=True)
def between(image: NDArray[np.float32], x: float, y: float) -> float:
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
