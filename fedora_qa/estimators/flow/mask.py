"""Edges in a depth, and in a flow where there is no depth: near them a pixel mixes two surfaces that move apart.

The inverse depth of a plane is affine in the pixel, so its Laplacian vanishes on every plane and marks edges, and
bilinear interpolation of it is exact. Edges are widened by the reach of the kernel that the frames are smoothed with.
"""

from typing import Final

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

EDGE: Final = 0.01
"""Relative Laplacian of inverse depth that makes an edge, and relative mismatch of it that makes an occlusion.

At such a step the flow of two neighbouring surfaces differs by 1% of their parallax: by 0.1 px where that is 10 px.
"""

LONGEST_FOOTPRINT: Final = 8.0
"""Length over width of a pixel's footprint up to which texture is known to be smoothed over all of it.

P. S. Heckbert, Fundamentals of Texture Mapping and Image Warping (1989), derives the footprint; engines end their
anisotropic filtering between 4 and 16. Beyond it distant ground shows aliases, which do not follow the flow.
"""

BREAK_PX: Final = 0.1
"""Second difference of a flow that makes a break: across lesser ones the mixing of two surfaces errs by less."""

_CROWDED_PX: Final = 0.25
"""Spread of the flows that lead to one pixel from which on they must belong to different surfaces."""

_WIDENED_PX: Final = 9
"""Edges are widened by 4 px on either side, where a mixed pixel contributes less than 1e-4 of its contrast.

At 3 px it is 1e-3, which beside a bright edge moved tiles of little texture by up to 0.1 px. Widened alike, the border
pixels are five deep, the reach of Gaussian and spline together: nearer to the border frames are extrapolated.
"""


def inverse_depth(depth_m: Float32) -> Float32:
    """Return 1 / depth (H, W), 0 where depth is invalid."""
    depth_m = np.ascontiguousarray(depth_m, dtype=np.float32)
    return np.asarray(inverse_in(depth_m, 0, 0, *depth_m.shape), dtype=np.float32)


def edges(inverse_depth_per_m: Float32, focal_px: float | None = None) -> NDArray[np.uint8]:
    """Return 1 within 4 px of an edge of the depth, of an invalid pixel or of the border, else 0; (H, W).

    With a focal length, too, of pixels whose surface is seen at so flat an angle that its texture may be aliased: over
    one pixel the inverse depth w of a plane changes by |grad w|, and the pixel's footprint is longer than wide by
    f |grad w| / w.

    Parameters
    ----------
    inverse_depth_per_m
        (H, W) 1/m, 0 where invalid.
    focal_px
        Focal length, px; None: surfaces at flat angles are not marked.
    """
    steepest = np.float32(np.inf if focal_px is None else LONGEST_FOOTPRINT / focal_px)
    return widened(mark_edges(inverse_depth_per_m, np.float32(EDGE), steepest))


def flow_conflicts(flow_px: Float32) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return where a flow (H, W, 2) itself shows edges, 1 there, else 0: maps (H, W) of the first and second frame.

    First frame: within 4 px of a break of the flow, of a missing value or of the border. Second frame: within 4 px of a
    pixel to which points of different flow lead, one of which must be occluded.
    """
    u, v = (np.ascontiguousarray(flow_px[..., i]) for i in range(2))
    is_valid = np.logical_and(np.isfinite(u), np.isfinite(v))
    u, v = np.where(is_valid, u, np.float32(0)), np.where(is_valid, v, np.float32(0))
    breaks = ~is_valid
    for component in (u, v):
        # A second difference, as of the depth: flow is smooth within a surface.
        breaks |= np.abs(cv2.Laplacian(component, cv2.CV_32F, borderType=cv2.BORDER_REPLICATE)) > BREAK_PX
    crowded = spread_at_targets(flow_px) > _CROWDED_PX**2
    return widened(breaks.astype(np.uint8)), widened(crowded.astype(np.uint8))


def widened(edge: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Widen edges (H, W), 1 and 0, of which the outermost pixels always are some."""
    for side in (edge[0], edge[-1], edge[:, 0], edge[:, -1]):
        side[...] = 1
    return np.asarray(cv2.dilate(edge, np.ones((_WIDENED_PX, _WIDENED_PX), np.uint8)), dtype=np.uint8)


@njit(cache=True, error_model="numpy")
def inverse_in(depth_m: Float32, left: int, top: int, height: int, width: int) -> Float32:
    """Return 1 / depth of a part (height, width) of a depth (H, W), 0 where that is not finite and positive."""
    inverse = np.empty((height, width), np.float32)
    for row in range(height):
        depths, line = depth_m[top + row, left : left + width], inverse[row]
        for column in range(len(line)):
            depth = depths[column]
            valid = (depth > 0) & (depth < np.float32(np.inf))
            line[column] = np.float32(1) / depth if valid else np.float32(0)
    return inverse


@njit(cache=True)
def mark_edges(inverse_per_m: Float32, largest_bend: np.float32, largest_slope: np.float32) -> NDArray[np.uint8]:
    """Return 1, (H, W), where an inverse depth is not positive, bends or slopes by more than a share of it, or ends."""
    height, width = inverse_per_m.shape
    marked = np.ones((height, width), np.uint8)
    steepest = largest_slope * largest_slope
    for row in range(1, height - 1):
        above, here, below, line = inverse_per_m[row - 1], inverse_per_m[row], inverse_per_m[row + 1], marked[row]
        for column in range(1, width - 1):
            left, right = here[column - 1], here[column + 1]
            line[column] = is_edge(here[column], left, right, above[column], below[column], largest_bend, steepest)
    return marked


@njit(cache=True)
def is_edge(
    value: np.float32,
    left: np.float32,
    right: np.float32,
    above: np.float32,
    below: np.float32,
    largest_bend: np.float32,
    steepest: np.float32,
) -> np.bool_:
    """Whether an inverse depth is invalid, or its Laplacian or squared slope exceeds a share of it or of its square."""
    bend = abs(left + right + above + below - np.float32(4) * value)
    across, down = np.float32(0.5) * (right - left), np.float32(0.5) * (below - above)
    # f |grad w| / w above LONGEST_FOOTPRINT (Heckbert 1989); squared, so that no root is taken.
    is_steep = across * across + down * down > steepest * value * value
    # Without a branch, so that many pixels are marked at once.
    return (bend > largest_bend * value) | is_steep | (value <= 0)


@njit(cache=True)
def spread_at_targets(flow_px: Float32) -> Float32:
    """Return (H, W) by how much the flows (H, W, 2) that lead to a pixel differ: the larger variance of two, px^2."""
    height, width = flow_px.shape[:2]
    count = np.zeros((height, width), np.int32)
    sums = np.zeros((height, width, 4))
    for row in range(height):
        for column in range(width):
            u, v = np.float64(flow_px[row, column, 0]), np.float64(flow_px[row, column, 1])
            x, y = np.rint(column + u), np.rint(row + v)
            if not (0 <= x < width and 0 <= y < height):  # also where flow is NaN
                continue
            to_row, to_column = int(y), int(x)
            count[to_row, to_column] += 1
            into = sums[to_row, to_column]
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
                # E[u^2] - E[u]^2 cancels: in float64 its rounding stays far below the limit of 0.06 px^2.
                spread[row, column] = max(uu / n - (u / n) ** 2, vv / n - (v / n) ** 2)
    return spread
